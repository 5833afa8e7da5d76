"""What a long computation reports on its way; whoever listens may stop it by raising an exception."""

from collections.abc import Callable

Progress = Callable[[str, float, float | None], None]
"""Called with what is being done, how much of it is done, and the whole (None: not known), in any one unit."""


def silent(what: str, done: float = 0.0, total: float | None = None) -> None:
    """Report nothing."""
