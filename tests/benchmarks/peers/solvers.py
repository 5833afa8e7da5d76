"""The configurations of all packages that are installed, and the names of those that are not."""

from importlib import import_module

from . import with_scipy
from .configuration import Configuration


def _gather() -> tuple[tuple[Configuration, ...], tuple[str, ...]]:
    found, missing = [], []
    for module, package in {"with_numbalsoda": "numbalsoda", "with_sundials": "sksundae"}.items():
        try:
            found += import_module(f".{module}", __package__).CONTENDERS
        except ModuleNotFoundError as error:
            if error.name is None or error.name.split(".")[0] != package:
                raise
            missing.append("scikit-sundae" if package == "sksundae" else package)
    return (*found, *with_scipy.CONTENDERS), tuple(missing)


CONTENDERS, MISSING = _gather()


def configuration(name: str) -> Configuration:
    """The configuration of that name."""
    return next(each for each in CONTENDERS if each.name == name)
