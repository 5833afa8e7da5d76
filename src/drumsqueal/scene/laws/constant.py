"""The same coefficient at every slip speed."""

from typing import Any, ClassVar, Literal

from drumsqueal.scene.tables import Coefficient, FrictionTable
from drumsqueal.scene.usual import SLIDING


class ConstantFriction(FrictionTable):
    """μ = coefficient."""

    name = "constant law"
    usual: ClassVar = {"coefficient": SLIDING}

    law: Literal["constant"]
    coefficient: Coefficient
    """μ at every slip speed."""

    @staticmethod
    def mu(slip_speed: Any, xp: Any, *, coefficient: Any) -> Any:
        """μ."""
        del slip_speed, xp
        return coefficient

    @staticmethod
    def cuts(xp: Any, **numbers: Any) -> tuple[Any, Any]:
        """None."""
        del numbers
        return xp.zeros(0), xp.zeros(0)
