"""How a run, or a study, ended: one of a few ways, and the words that go with it."""

from enum import StrEnum


class Ending(StrEnum):
    """The ways in which a run ends; one that was killed could not write how."""

    COMPLETE = "complete"
    FAILED = "failed"
    INTERRUPTED = "interrupted"
    CUT_OFF = "cut off"
    IMPOSSIBLE = "cannot be run"
    SKIPPED = "not made"

    def because(self, reason: str) -> str:
        """Ending and reason in words."""
        return f"{self}: {reason}" if reason else str(self)


class Outcome(str):
    """The words of an outcome, such as "failed: the step size collapsed", and which `ending` that is."""

    ending: Ending

    def __new__(cls, ending: Ending, words: str = "") -> "Outcome":
        """Without words, an ending is its own word."""
        made = super().__new__(cls, words or ending.value)
        made.ending = ending
        return made


COMPLETE = Outcome(Ending.COMPLETE)
