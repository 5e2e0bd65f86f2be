"""The program: it imports the command line where Ctrl-C is already told in a word."""

from __future__ import annotations

import sys

INTERRUPTED = 130


def main() -> None:
    """Run the command line; an interruption while it is imported ends as one of a command does."""
    try:
        from vedette.cli import app

        app()
    except KeyboardInterrupt:
        print("\ninterrupted", file=sys.stderr)
        raise SystemExit(INTERRUPTED) from None


if __name__ == "__main__":
    main()
