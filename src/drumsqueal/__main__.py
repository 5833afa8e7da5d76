"""The program `drumsqueal`, or `python -m drumsqueal`: it loads the command line and runs it."""

import os
import signal
import threading

from drumsqueal.interrupts import note_interrupts
from drumsqueal.terminal.streams import prepare_streams


def main() -> None:
    """Run the command line, with Ctrl-C noted from the loading of it to its end."""
    # Matrices of some hundred rows are solved no faster by several threads, which wait for one another by spinning:
    # beside other work `stability` of a brake that bends took three times as long. NumPy reads it when it is loaded.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    prepare_streams()
    note_interrupts()
    try:
        from drumsqueal.command_line import main as run

        run()
    finally:
        # Nothing is left to be stopped: while Python shuts down, Ctrl-C would only take the place of the exit status.
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGINT, signal.SIG_IGN)


if __name__ == "__main__":
    main()
