"""The program: it imports the command line where Ctrl-C is already told in a word."""

import signal
import sys
from types import FrameType

INTERRUPTED = 130


def main() -> None:
    """Run the command line. An interruption while it is imported ends as one of a command does.

    SIGTERM, with which services are ended, interrupts like Ctrl-C.
    """
    if signal.getsignal(signal.SIGTERM) == signal.SIG_DFL:
        signal.signal(signal.SIGTERM, _interrupt)
    try:
        from vedette.cli import app

        app()
    except (KeyboardInterrupt, RuntimeError) as error:
        if not isinstance(error, KeyboardInterrupt) and not isinstance(error.__cause__, KeyboardInterrupt):
            raise  # Python raises a RuntimeError from an interruption while it makes a class
        print("\ninterrupted", file=sys.stderr)
        raise SystemExit(INTERRUPTED) from None


def _interrupt(number: int, frame: FrameType | None) -> None:
    """Do what Ctrl-C does now, or interrupt if it is ignored, as in the background of a shell."""
    handler = signal.getsignal(signal.SIGINT)
    (handler if callable(handler) else signal.default_int_handler)(number, frame)


if __name__ == "__main__":
    main()
