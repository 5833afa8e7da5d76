"""The Stribeck curve: friction that falls from rest on within a slip speed, and rises with a viscous part."""

from typing import Annotated, Any, ClassVar, Literal

from drumsqueal.scene.quantities import Quantity
from drumsqueal.scene.tables import Coefficient, FrictionTable
from drumsqueal.scene.usual import SLIDING, STATIC, Usual


class StribeckFriction(FrictionTable):
    """μ = kinetic + (static − kinetic) exp(−(s/stribeck_speed)²) + viscous s."""

    name = "Stribeck law"
    usual: ClassVar = {
        "static": STATIC,
        "kinetic": SLIDING,
        # From stick-slip rigs to the fade of friction over the speeds of a stop.
        "stribeck_speed": Usual(1e-4, 100, "m/s", "0.1 mm/s to 100 m/s", (("mm/s", 1e-3),)),
        # Less than 0.5 more at 10 m/s; 0 stands for none.
        "viscous": Usual(0, 0.05, "s/m", "0 to 0.05 s/m"),
    }

    law: Literal["stribeck"]
    static: Coefficient
    """μ at rest."""
    kinetic: Coefficient
    """μ of faster slip, without the viscous part."""
    stribeck_speed: Annotated[float, Quantity("m/s", above=0)]
    """The slip speed within which μ falls."""
    viscous: Annotated[float, Quantity("s/m", least=0)] = 0.0
    """Rise of μ with the slip speed."""

    @staticmethod
    def mu(slip_speed: Any, xp: Any, *, static: Any, kinetic: Any, stribeck_speed: Any, viscous: Any) -> Any:
        """μ at slip speeds s ≥ 0 (m/s)."""
        fraction = slip_speed / stribeck_speed
        return kinetic + (static - kinetic) * xp.exp(-fraction * fraction) + viscous * slip_speed

    @staticmethod
    def cuts(xp: Any, *, stribeck_speed: Any, **numbers: Any) -> tuple[Any, Any]:
        """3 and 7 times the Stribeck speed: of what is left from there on, nothing counts."""
        del numbers
        # Sixteen Gauss nodes resolve each stretch of exp(−x²) between these cuts to 1e-12, also where the slip speed is
        # extreme within it (`custom_friction.find_breakpoints`); exp(−49) is 5e-22.
        return xp.asarray([3.0, 7.0]) * stribeck_speed, xp.zeros(0)
