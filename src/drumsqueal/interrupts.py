"""Ctrl-C as a wish that is granted between two steps, not an exception wherever the program happens to be.

As an exception it tears what is being written, and where it falls into a callback (JAX has one in every collection of
garbage) Python prints a traceback and goes on as if nothing had been pressed. A step lasts some seconds; a chunk whose
step size collapses may last longer, in space some minutes.
"""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

_pressed = threading.Event()


def note_interrupts() -> None:
    """Note Ctrl-C from now on, for `stop_if_interrupted`, unless it is ignored or handled already."""
    # Only the main thread may say so; no other one is ever interrupted.
    if threading.current_thread() is threading.main_thread() and _is_raised():
        _pressed.clear()
        signal.signal(signal.SIGINT, lambda *_: _pressed.set())


@contextmanager
def noted_interrupts() -> Iterator[None]:
    """Note Ctrl-C within a block, and leave it as it was after that; raises KeyboardInterrupt for one not granted."""
    handler = signal.getsignal(signal.SIGINT)
    note_interrupts()
    if signal.getsignal(signal.SIGINT) is handler:  # noted, or ignored, by somebody outside: theirs to grant
        yield
        return
    try:
        yield
        stop_if_interrupted()
    finally:
        _pressed.clear()
        signal.signal(signal.SIGINT, handler)


def stop_if_interrupted() -> None:
    """Raise KeyboardInterrupt if Ctrl-C has been pressed."""
    if _pressed.is_set():
        _pressed.clear()
        raise KeyboardInterrupt


def _is_raised() -> bool:
    return signal.getsignal(signal.SIGINT) is signal.default_int_handler
