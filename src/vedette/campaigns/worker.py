"""What a worker process of this machine has loaded before it is started: all that its tasks need."""

from __future__ import annotations

import pyarrow  # noqa: F401
import scipy.optimize  # noqa: F401

import vedette.kernels.base.dispatchers  # noqa: F401
from vedette.campaigns.tasks import perform

__all__ = ["perform"]
