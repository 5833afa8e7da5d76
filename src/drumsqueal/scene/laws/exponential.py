"""Friction that falls with the slip speed, as in Seo & Kang (2023), equation (16)."""

from typing import Annotated, Any, ClassVar, Literal

from drumsqueal.scene.quantities import Quantity
from drumsqueal.scene.tables import Coefficient, FrictionTable
from drumsqueal.scene.usual import SLIDING, STATIC, Usual


class ExponentialFriction(FrictionTable):
    """μ = kinetic + (static − kinetic) exp(−decay s)."""

    name = "exponential law"
    usual: ClassVar = {
        "static": STATIC,
        "kinetic": SLIDING,
        # The slip speed over which friction falls, 1/decay, from 1 mm/s (stick-slip rigs) to 100 m/s; 0 stands for none
        "decay": Usual(0.01, 1000, "s/m", "0.01 to 1000 s/m"),
    }

    law: Literal["exponential"]
    static: Coefficient
    """μ at rest."""
    kinetic: Coefficient
    """μ of fast slip."""
    decay: Annotated[float, Quantity("s/m", least=0)]
    """How fast μ falls with the slip speed."""

    @staticmethod
    def mu(slip_speed: Any, xp: Any, *, static: Any, kinetic: Any, decay: Any) -> Any:
        """μ at slip speeds s ≥ 0 (m/s)."""
        return kinetic + (static - kinetic) * xp.exp(-decay * slip_speed)

    @staticmethod
    def cuts(xp: Any, *, decay: Any, **numbers: Any) -> tuple[Any, Any]:
        """12 and 40 over the decay: of what is left from there on, nothing counts."""
        del numbers
        # With sixteen Gauss nodes on each stretch between these cuts of exp(−decay s) the error of a contact integral
        # was 3e-15 of the load at the worst of 2000 random motions; exp(−40) is 4e-18. 1e-30 s/m keeps the slip speeds
        # finite where nothing decays.
        return xp.asarray([12.0, 40.0]) / xp.maximum(xp.abs(decay), 1e-30), xp.zeros(0)
