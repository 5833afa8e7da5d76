"""The program `drumsqueal`, or `python -m drumsqueal`: it loads the command line and runs it."""

import gc
import signal
import threading

from drumsqueal.interrupts import note_interrupts
from drumsqueal.terminal.streams import prepare_streams


def main() -> None:
    """Run the command line, with Ctrl-C noted from the loading of it to its end."""
    prepare_streams()
    note_interrupts()
    # Loading and tracing make some million objects that stay. Where Python looks for garbage among them after every 700
    # new ones, `check simplex` takes 16.5 s of processor time, and 14 with these numbers, as without any looking.
    gc.set_threshold(20_000, 20, 100)
    try:
        from drumsqueal.command_line import main as run

        run()
    finally:
        # Nothing is left to be stopped: while Python shuts down, Ctrl-C would only take the place of the exit status.
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGINT, signal.SIG_IGN)


if __name__ == "__main__":
    main()
