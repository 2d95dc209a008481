"""The command line: ``tautline``, or ``python -m tautline``."""

from __future__ import annotations

import signal
import sys

from . import _native


def main() -> int:
    """Runs the command in ``sys.argv`` and returns its exit code."""
    # The program handles Ctrl-C itself.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _native.main(["tautline", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
