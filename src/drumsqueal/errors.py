"""What can go wrong, by whose fault: the request's (exit status 2) or the run's (exit status 1).

Mistakes in a scene are `SceneError`, which stands with what reads scenes.
"""

from collections.abc import Iterable
from difflib import get_close_matches


class RequestError(ValueError):
    """What was asked for cannot be done; the message says what is wrong and what would be right."""


class SteadyStateError(ArithmeticError):
    """No steady sliding was found; the message says why."""


class IntegrationError(ArithmeticError):
    """The integration stopped before its end; the message says when and why."""


class CycleError(IntegrationError):
    """No periodic motion was found, or none that can be followed; the message says why."""


def missing_extra(what: str, extra: str) -> RequestError:
    """The error of what needs an extra that is not installed, with the command that installs it."""
    clone = f'in a clone .venv/bin/pip install ".[{extra}]"'
    return RequestError(f'{what} needs an extra; install it with: pip install "drumsqueal[{extra}]", {clone}')


def nearest(name: str, known: Iterable[str]) -> list[str]:
    """The known name that was probably meant, if there is one; small letters and capitals are the same."""
    folded = {each.casefold(): each for each in known}
    return [folded[each] for each in get_close_matches(name.casefold(), folded, n=1)]
