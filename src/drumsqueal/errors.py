"""How a run ends, and what can go wrong, by whose fault: the request's (exit status 2) or the run's (exit status 1).

Mistakes in a scene are `SceneError`, which stands with what reads scenes.
"""

from collections.abc import Iterable
from difflib import get_close_matches
from enum import StrEnum


class RequestError(ValueError):
    """What was asked for cannot be done; the message says what is wrong and what would be right."""


class NothingToDoError(RequestError):
    """What was to be resumed is complete, or what was to be sampled is not uncertain."""


class NoSteadySliding(StrEnum):
    """Why there is no steady sliding."""

    AT_REST = "drum.speed is 0 all the time: there is no steady sliding; give the drum a speed"
    BELT_AT_REST = "the belt is at rest: there is no steady sliding; give it a speed"
    SELF_LOCKING = "self-locking: friction drags the shoe into the drum ever harder, and nothing holds it in balance"
    NOT_FOUND = (
        "no self-consistent steady sliding was found, neither directly nor by raising friction step by step from zero: "
        "the shoe may jam (self-locking), or its supports and the drum may not hold it at this load and speed"
    )
    PULLED_OFF = (
        "no steady sliding was found, not even without friction: the forces pull the shoe off the drum, or its "
        "supports do not hold it there; turn shoe.force towards the drum, or support the shoe"
    )
    NOT_HELD = "there is no steady sliding: neither support, nor spring, nor drum holds the shoe"
    NOT_FINITE = (
        "the linear model is not finite: a number is out of all proportion; check the shoe's lengths and density, "
        "the stiffnesses, contact.normal_load, friction, drum.speed and damping.ratio"
    )


class SteadyStateError(ArithmeticError):
    """No steady sliding was found, for a `reason`."""

    def __init__(self, reason: NoSteadySliding, more: str = "") -> None:
        """Take the reason, which is the message, and what there is to say of the case."""
        super().__init__(reason, more)  # so that both survive the way from another process
        self.reason = reason

    def __str__(self) -> str:
        """The reason, and the case."""
        return "; ".join(filter(None, self.args))


class IntegrationError(ArithmeticError):
    """The integration stopped before its end; the message says when and why."""


class CycleError(IntegrationError):
    """No periodic motion was found, or none that can be followed; the message says why."""


def missing_extra(what: str, extra: str) -> RequestError:
    """The error of what needs an extra that is not installed, with the command that installs it."""
    clone = f'in a clone .venv/bin/pip install ".[{extra}]"'
    return RequestError(f'{what} needs an extra; install it with: pip install "drumsqueal[{extra}]", {clone}')


def nearest(name: str, known: Iterable[str], *, most: int = 1, likeness: float = 0.6) -> list[str]:
    """The known names that were probably meant, if there are any; small letters and capitals are the same."""
    folded = {each.casefold(): each for each in known}
    return [folded[each] for each in get_close_matches(name.casefold(), folded, n=most, cutoff=likeness)]


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
