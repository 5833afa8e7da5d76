"""Set-up that several test files share."""

import os
import sys
from collections.abc import Callable
from pathlib import Path

import jax
import pytest
from jax.experimental.compilation_cache import compilation_cache

import drumsqueal.precision  # noqa: F401 (switches it on before any test, also where a file runs alone)
from drumsqueal import command_line as cli
from drumsqueal.interrupts import noted_interrupts
from drumsqueal.scene import Scene, load_scene

# Error checks that are compiled in would hide behind NaN, or change what is compiled, were this set from outside.
assert "EQX_ON_ERROR" not in os.environ, "unset EQX_ON_ERROR to run the tests"


@pytest.fixture(scope="session", autouse=True)
def _compiled_once(tmp_path_factory):
    """What takes long to compile is compiled once in a session, also where several processes share it.

    The folder is new in every session, so that nothing hangs on what an earlier one left.
    """
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent  # that of one process lies in that of all
    jax.config.update("jax_compilation_cache_dir", str(folder / "compiled"))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.2)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
    compilation_cache.reset_cache()  # what was compiled before settled that there is none


@pytest.fixture(autouse=True)
def _double_precision():
    """Every test starts and ends in double precision, which the import of the package switches on."""
    yield
    assert jax.config.read("jax_enable_x64")


@pytest.fixture(scope="session")
def nominal() -> Scene:
    """Return the paper's brake (Seo & Kang 2023, Table 1), as it is shipped."""
    return load_scene(Path(__file__).parents[1] / "scenarios" / "nominal.toml")


@pytest.fixture(scope="session")
def cache(tmp_path_factory) -> Path:
    """Folder of compiled programs: only the first process that a test starts has to compile them."""
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(name="drumsqueal")
def _command_line(monkeypatch, capsys) -> Callable[..., tuple[int, str, str]]:
    """Run the command line in this process: exit status, standard output, standard error."""
    monkeypatch.setattr(cli, "prepare_environment", lambda: None)  # JAX is imported already

    def call(*arguments: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["drumsqueal", *arguments])
        status = 0
        try:
            with noted_interrupts():
                cli.main()
        except SystemExit as stop:
            status = int(stop.code or 0)
        captured = capsys.readouterr()
        return status, captured.out, captured.err

    return call
