"""drumsqueal: when does a drum brake squeal, how, and do eigenvalues and nonlinear transient agree?

`load_scene` reads a scene and `run` runs it. `study_onset` finds where along a parameter it squeals, `study_accuracy`
how large its errors are, and `study_effects` which effects it needs. `build_model`, `analyse_stability` and
`growth_rate` are the linear analysis, for any parameters. `integrate_many` integrates many models at once,
`sweep_parameters` many scenes. `read_measured` and `compare_measured` compare a measured record with a history.
`help(drumsqueal.run)` describes `run`.

In a terminal and in a notebook, what takes long shows how far it has come; `progress=silent` shows nothing, and any
other function of (what, done, total) is called in place of the bar.

The public names are those of `__init__.pyi`. They are imported when they are first used: reading a scene does not load
JAX, and the command line can prepare its environment first.
"""

import ast as _ast
import importlib as _importlib
from pathlib import Path as _Path

_STUB = _ast.parse(_Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
_FOUND = [found for found in _STUB.body if isinstance(found, _ast.ImportFrom)]
_HOME = {each.name: str(found.module) for found in _FOUND for each in found.names}
__all__ = sorted(_HOME)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> object:
    """Import a public name from its module."""
    if name not in _HOME:
        raise AttributeError(f"module 'drumsqueal' has no attribute {name!r}")
    from drumsqueal.progress import with_bar

    value = with_bar(getattr(_importlib.import_module(_HOME[name]), name), __name__)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """The public names."""
    return __all__
