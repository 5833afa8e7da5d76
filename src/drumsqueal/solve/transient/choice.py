"""Which method goes on: the one that a scene names or, for "auto", the one that gets on."""

from typing import NamedTuple

from drumsqueal.solve.transient.runge_kutta import AUTO, DEFAULT, IMPLICIT, is_explicit
from drumsqueal.solve.transient.segment import STEP_BUDGET

# Steps a chunk that the explicit method gets where another may take over, at a tolerance of 1e-6: five times what the
# shipped scenes take beyond contact boundaries. A method of order eight takes 1.33 times as many for a tenth of the
# tolerance.
EXPLICIT_BUDGET = 10_000
MORE_STEPS = 1 / 8
MOST_PATIENCE = 64  # chunks


class Method(NamedTuple):
    """A method, how many chunks an implicit one goes on for, and how many of them it has made."""

    name: str
    patience: int = 1
    waited: int = 0


class Choice:
    """The method of a transient, chunk by chunk.

    "auto" is explicit until that takes too many steps, as it does where friction is stiff: a slow drum damps what moves
    across it, and a lining that all but sticks pivots about a point. After a chunk of the implicit method, then after
    two, four and so on, the explicit one is tried again.
    """

    def __init__(self, solver: str, tolerance: float, method: Method | None = None) -> None:
        """Begin with a method of the scene's names, or go on with the one at hand."""
        self._automatic = solver == AUTO
        self._explicit_budget = min(int(EXPLICIT_BUDGET * (1e-6 / tolerance) ** MORE_STEPS), STEP_BUDGET)
        self.method = method or Method(DEFAULT if self._automatic else solver)

    @property
    def solver(self) -> str:
        """Name of the method."""
        return self.method.name

    @property
    def explicit(self) -> str:
        """A method for what is not stiff."""
        return self.solver if is_explicit(self.solver) else DEFAULT

    @property
    def budget(self) -> int:
        """Steps that the method gets."""
        return self._explicit_budget if self._automatic and self.solver == DEFAULT else STEP_BUDGET

    def begin(self) -> None:
        """A chunk begins."""
        if not self._automatic:
            return
        if self.solver == DEFAULT:  # which got through the last one
            self.method = Method(DEFAULT)
        elif self.method.waited < self.method.patience:
            self.method = self.method._replace(waited=self.method.waited + 1)
        else:
            self.method = Method(DEFAULT, min(2 * self.method.patience, MOST_PATIENCE))

    def switch(self) -> bool:
        """The method has made all its steps; says whether another goes on from there."""
        if not self._automatic or self.solver == IMPLICIT:
            return False
        self.method = Method(IMPLICIT, self.method.patience, 1)
        return True
