"""What a worker process on this machine does before anything else."""

from __future__ import annotations

import signal


def dask_setup(_: object) -> None:
    """Leave Ctrl-C to the process that the person started: it stops its workers."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
