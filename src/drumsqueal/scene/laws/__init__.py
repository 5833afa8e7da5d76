"""Friction laws, one a file. A file that is put here is found, and is then known everywhere."""

import pkgutil
from collections.abc import Mapping
from importlib import import_module
from typing import get_args

from drumsqueal.scene.tables import FrictionTable


def _find_laws() -> dict[str, type[FrictionTable]]:
    """Every law by its name in a scene; raises TypeError for one that lacks what `FrictionTable` asks for."""
    for module in pkgutil.iter_modules(__path__):
        import_module(f"{__name__}.{module.name}")
    found = {}
    for law in sorted(FrictionTable.__subclasses__(), key=lambda law: law.__module__):
        if lacks := lacking(law):
            raise TypeError(f"the friction law {law.__name__} lacks {', '.join(lacks)}; see scene.tables.FrictionTable")
        found[get_args(law.model_fields["law"].annotation)[0]] = law
    return found


def lacking(law: type[FrictionTable]) -> list[str]:
    """What `FrictionTable` asks of a law that this one does not have."""
    ranges = [f"usual[{key!r}]" for key in law.number_keys() if key not in getattr(law, "usual", {})]
    return [*sorted(law.__abstractmethods__), *(name for name in ("name", "usual") if not hasattr(law, name)), *ranges]


LAWS: Mapping[str, type[FrictionTable]] = _find_laws()
