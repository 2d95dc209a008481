"""Process that flies a shard: ``python -m tautline._shard_process FOLDER SHARD``.

It ends once its standard input is closed, as by the end of the process that started it.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time

from . import _native

#: Longest time for the end of a flight in progress [s].
END_WITHIN_S = 30.0


def end_with_standard_input() -> None:
    """Asks this process to end once its standard input is closed. Ends it if its flight in progress takes too long."""
    # Without a lock, which the end of the interpreter would need.
    while os.read(0, 1):
        pass
    signal.raise_signal(signal.SIGINT)
    time.sleep(END_WITHIN_S)
    os._exit(1)


def main() -> int:
    """Flies a shard, and returns the exit code of the command line."""
    folder, shard = sys.argv[1:]
    # The program handles Ctrl-C itself.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    threading.Thread(target=end_with_standard_input, daemon=True).start()
    return _native.main(["tautline", "campaign", "shard", "--shard", shard, "--quiet", "--", folder])


if __name__ == "__main__":
    sys.exit(main())
