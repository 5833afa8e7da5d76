"""Ctrl-C as a wish that is granted between two steps, not an exception wherever the program happens to be.

As an exception it tears what is being written, and where it falls into a callback (JAX has one in every collection of
garbage) Python prints a traceback and goes on as if nothing had been pressed. A step lasts some seconds; a chunk whose
step size collapses may last longer, in space some minutes. So a thread reports at once that Ctrl-C was heard: Python
itself calls no handler before the compiled code at hand returns. Pressed again, it ends the program at once.
"""

import os
import signal
import socket
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType

FAILED = 1  # exit status
HEARD = "drumsqueal: Ctrl-C was heard: the step at hand is finished, and what was computed is written"
AGAIN = "; press it again to end at once"
ENDED = "drumsqueal: ended at once, with the step at hand unfinished; what was written until then is kept"

_pressed = threading.Event()


def note_interrupts() -> None:
    """Note Ctrl-C from now on, for `stop_if_interrupted`, unless it is ignored or handled already.

    The second one ends the program.
    """
    # Only the main thread may do so; no other one is ever interrupted.
    if threading.current_thread() is threading.main_thread() and _is_raised():
        _pressed.clear()
        signal.signal(signal.SIGINT, _note)
        _listen(ends_program=True)[1].detach()  # open to the end


@contextmanager
def noted_interrupts() -> Iterator[None]:
    """Note Ctrl-C within a block, and leave it as it was after that; raises KeyboardInterrupt for one not granted.

    The second one is an exception wherever the block is.
    """
    # Noted, or ignored, by somebody outside: theirs to grant.
    if threading.current_thread() is not threading.main_thread() or not _is_raised():
        yield
        return
    _pressed.clear()
    handler = signal.signal(signal.SIGINT, _note_once)
    before, ours = _listen(ends_program=False)
    try:
        yield
        stop_if_interrupted()
    finally:
        _pressed.clear()
        signal.signal(signal.SIGINT, handler)
        signal.set_wakeup_fd(before)
        ours.close()


def stop_if_interrupted() -> None:
    """Raise KeyboardInterrupt if Ctrl-C has been pressed."""
    if _pressed.is_set():
        _pressed.clear()
        raise KeyboardInterrupt


def _note(*_: object) -> None:
    _pressed.set()


def _note_once(number: int, frame: FrameType | None) -> None:
    if _pressed.is_set():
        signal.default_int_handler(number, frame)
    _pressed.set()


def _listen(*, ends_program: bool) -> tuple[int, socket.socket]:
    """Have a thread report every Ctrl-C until the socket that is returned is closed; with what listened before."""
    theirs, ours = socket.socketpair()
    ours.setblocking(False)
    before = signal.set_wakeup_fd(ours.fileno(), warn_on_full_buffer=False)
    threading.Thread(target=_report, args=(theirs, ends_program), daemon=True).start()
    return before, ours


def _report(source: socket.socket, ends_program: bool) -> None:
    """Report on standard error what Python's own handler writes as it is called: a byte for each signal."""
    heard = 0
    with source:
        while byte := source.recv(1):
            heard += byte[0] == signal.SIGINT
            if heard == 1:
                _say(HEARD + AGAIN * ends_program)
            elif heard > 1 and ends_program:
                _say(ENDED)
                os._exit(FAILED)  # as kill does: no file is left in a state that the next command does not take


def _say(text: str) -> None:
    with suppress(OSError, ValueError):  # nobody listens
        shown = "\x1b[?25h\n" * sys.stderr.isatty()  # which a bar of progress hides; and a line of its own, after ^C
        os.write(sys.stderr.fileno(), f"{shown}{text}\n".encode())


def _is_raised() -> bool:
    return signal.getsignal(signal.SIGINT) is signal.default_int_handler
