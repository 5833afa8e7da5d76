"""What can go wrong, by whose fault: the request's (exit status 2) or the run's (exit status 1).

Mistakes in a scene are `SceneError`, which stands with what reads scenes.
"""


class RequestError(ValueError):
    """What was asked for cannot be done; the message says what is wrong and what would be right."""


class SteadyStateError(ArithmeticError):
    """No steady sliding was found; the message says why."""


class IntegrationError(ArithmeticError):
    """The integration stopped before its end; the message says when and why."""


class CycleError(IntegrationError):
    """No periodic motion was found, or none that can be followed; the message says why."""
