"""Compiled programs that are kept: found again by all that they depend on, and by nothing less."""

import gc
import os
import threading
import weakref
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from drumsqueal import compilation, programs
from drumsqueal.findings import vibration
from drumsqueal.physics.effects.operation import Constant, Operation, PiecewiseLinear
from drumsqueal.physics.friction_law import ConstantLaw, ExponentialLaw, FunctionLaw, coefficient_at
from drumsqueal.programs import Program
from drumsqueal.solve.transient.flow import StickTransition
from processes import wait_until

PROFILE = PiecewiseLinear(np.array([0.0, 0.7, 2.0]), np.array([1.0, 3.0, 0.1]))
OPERATION, TIMES = Operation(PROFILE, Constant(2.0)), np.linspace(0.0, 2.0, 7)


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """Where programs are kept during a test."""
    monkeypatch.setattr(programs, "folder", tmp_path / "programs")
    return tmp_path / "programs"


def moments() -> Program:
    """A program that no other one knows of, as in another process."""
    return Program(vibration.moments_at._function)


def coefficient() -> Program:
    return Program(coefficient_at._function)


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def never(*_: Any) -> Any:
    raise AssertionError("it is compiled")


def same(a: Any, b: Any) -> None:
    assert jax.tree.structure(a) == jax.tree.structure(b)
    assert jax.tree.all(jax.tree.map(lambda x, y: np.array_equal(x, y), a, b))


def test_a_program_is_loaded_without_being_traced_and_gives_the_same_to_the_last_bit(folder, monkeypatch):
    first, plain = moments()(OPERATION, TIMES), moments()._traced(OPERATION, TIMES)
    same(first, plain)
    (kept,) = names(folder)
    assert kept.startswith("moments_at-")
    monkeypatch.setattr(Program, "_compile", never)
    same(moments()(OPERATION, TIMES), plain)
    same(moments()(Operation(PROFILE, Constant(7.0)), TIMES).preload, np.full(7, 7.0))  # numbers are no part of it


def test_a_call_waits_for_what_another_thread_has_begun_to_compile(folder, monkeypatch):
    program, made, asked = moments(), [], []
    compile_, lock = Program._compile, program._finding

    class Asked:
        """The lock, with a note of who asks for it."""

        def __enter__(self) -> None:
            asked.append(threading.current_thread())
            lock.acquire()

        def __exit__(self, *_: object) -> None:
            lock.release()

    def slowly(self: Program, *arguments: Any) -> Any:
        made.append(threading.current_thread())
        wait_until(lambda: threading.main_thread() in asked + made)  # it waits, or it compiles as well
        return compile_(self, *arguments)

    monkeypatch.setattr(program, "_finding", Asked())
    monkeypatch.setattr(Program, "_compile", slowly)
    before = jax.config.values["jax_persistent_cache_min_compile_time_secs"]
    program.ahead(lambda: (OPERATION, TIMES))
    wait_until(lambda: made)
    same(program(OPERATION, TIMES), moments()._traced(OPERATION, TIMES))
    assert made != [threading.current_thread()]
    assert len(made) == 1
    assert jax.config.values["jax_persistent_cache_min_compile_time_secs"] == before


def test_what_a_run_is_compared_with_is_found_beside_its_integration(folder, monkeypatch):
    from drumsqueal.findings import compare
    from drumsqueal.scene import load_scene
    from drumsqueal.simulation import run

    found = []
    program = Program(compare._observe._function)
    find = program._find

    def noted(*arguments: Any) -> Any:
        found.append(threading.current_thread())
        return find(*arguments)

    monkeypatch.setattr(program, "_find", noted)
    monkeypatch.setattr(compare, "_observe", program)
    run(load_scene("nominal", ["simulate.duration=1 ms"]))
    assert len(found) == 1  # for what is asked afterwards, too
    assert found != [threading.main_thread()]


def test_what_fails_ahead_fails_where_it_is_called(folder):
    program = Program(vibration.moments_at._function)
    program.ahead(lambda: (OPERATION, "no times"))
    with pytest.raises(TypeError):
        program(OPERATION, "no times")


def test_a_result_may_hold_what_is_no_array(folder, monkeypatch):
    from drumsqueal.physics.composition import compose
    from drumsqueal.physics.model import assemble
    from drumsqueal.scene import load_scene

    scene = load_scene(Path(__file__).parents[1] / "scenarios" / "nominal.toml")
    arguments = compose(scene), {key: np.asarray(value) for key, value in scene.numbers().items()}
    made = Program(assemble._function)(*arguments)
    monkeypatch.setattr(Program, "_compile", never)
    loaded = Program(assemble._function)(*arguments)
    same(loaded, made)
    assert loaded.names == ("X", "Y", "Tz")


@pytest.mark.parametrize(
    "change",
    [
        lambda content: content[:-40],  # cut short
        lambda content: content[:900] + bytes([content[900] ^ 1]) + content[901:],
        lambda content: b"",
        lambda content: b"something else",
    ],
)
def test_a_damaged_file_is_compiled_anew_and_replaced(folder, change):
    expected = moments()(OPERATION, TIMES)
    (path,) = folder.iterdir()
    good = path.read_bytes()
    path.write_bytes(change(good))
    same(moments()(OPERATION, TIMES), expected)
    assert len(path.read_bytes()) > 0.9 * len(good)


def test_a_file_under_the_name_of_another_is_not_taken(folder, monkeypatch):
    coefficient()(ConstantLaw(0.5), TIMES)
    (other,) = folder.iterdir()
    expected = moments()(OPERATION, TIMES)
    (own,) = (path for path in folder.iterdir() if path != other)
    other.replace(own)
    same(moments()(OPERATION, TIMES), expected)


@pytest.mark.parametrize(
    "changed",
    [
        lambda patch: patch.setattr(programs, "_sources_and_versions", lambda: ("another source",)),
        lambda patch: patch.setattr(programs, "version", lambda name: f"{name} of tomorrow"),
        lambda patch: patch.setenv("XLA_FLAGS", "--xla_cpu_enable_fast_math=false"),
        lambda patch: patch.setattr(os, "sched_getaffinity", lambda _: set(range(99)), raising=False),
    ],
)
def test_a_program_of_other_circumstances_is_another_one(folder, monkeypatch, changed):
    first = moments()(OPERATION, TIMES)
    programs._sources_and_versions.cache_clear()
    changed(monkeypatch)
    same(moments()(OPERATION, TIMES), first)
    assert len(names(folder)) == 2
    monkeypatch.undo()
    programs._sources_and_versions.cache_clear()


def test_every_source_counts(monkeypatch, tmp_path):
    def digest() -> tuple[str, ...]:
        programs._sources_and_versions.cache_clear()
        return programs._sources_and_versions()

    monkeypatch.setattr(programs, "PACKAGE", tmp_path)
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / "source.py").write_text("a = 1")
    before = digest()
    (tmp_path / "deep" / "source.py").write_text("a = 2")
    changed = digest()
    (tmp_path / "deep" / "source.py").rename(tmp_path / "deep" / "other.py")
    assert len({before, changed, digest()}) == 3
    monkeypatch.undo()
    programs._sources_and_versions.cache_clear()


def test_each_kind_of_processor_has_a_folder_of_its_own(monkeypatch):
    here = compilation.cache_folder()
    monkeypatch.setattr(compilation, "_processor", lambda: "another")
    assert compilation.cache_folder().parent == here.parent
    assert compilation.cache_folder() != here


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ((ConstantLaw(0.5), TIMES), (ExponentialLaw(0.5, 0.3, 1.0), TIMES)),
        ((ConstantLaw(0.5), TIMES), (ConstantLaw(0.5), TIMES[:3])),
        ((ConstantLaw(0.5), TIMES), (ConstantLaw(0.5), TIMES.astype(np.float32))),
    ],
)
def test_programs_of_other_arguments_are_told_apart(folder, one, other):
    called = coefficient()
    called(*one)
    found = called(*other)
    same(found, coefficient()._traced(*other))
    assert len(names(folder)) == 2


def test_arguments_of_the_same_arrays_in_other_places_are_told_apart(folder):
    called, three = moments(), (Constant(3.0), Constant(2.0))
    pushed = called(Operation(*three, pushes=(Constant(7.0),)), TIMES)
    of_two = called(Operation(*three, further=(Constant(7.0),)), TIMES)
    assert (len(pushed.pushes), len(pushed.further)) == (1, 0)
    assert (len(of_two.pushes), len(of_two.further)) == (0, 1)
    assert len(names(folder)) == 2


def test_what_a_program_is_made_of_is_told_to_the_sign_of_zero():
    assert len({programs.kind_of(each) for each in (0.0, -0.0, 0, False, "0", None)}) == 6
    assert len({str(list(programs._told(each))) for each in (0.0, -0.0, 0, False, "0", None, (), ((),), {"": 0})}) == 9


def test_laws_that_are_python_functions_are_never_mistaken_for_each_other(folder):
    def law_of(value: float) -> FunctionLaw:
        def law(slip: jax.Array) -> jax.Array:
            return value + 0 * slip

        return FunctionLaw(law)

    called = coefficient()
    assert [float(called(law_of(value), TIMES)[0]) for value in (0.1, 0.2)] == [0.1, 0.2]
    assert not folder.exists() or not names(folder)


def test_a_class_of_the_users_own_is_not_known_by_its_name(folder):
    class OwnLaw(type(ConstantLaw(0.5))):
        def coefficient(self, slip_speed: jax.Array) -> jax.Array:
            return 3 * super().coefficient(slip_speed)

    base = ConstantLaw(0.5)
    assert float(jnp.max(coefficient()(OwnLaw(base.law, base.numbers), TIMES))) == 1.5
    assert not folder.exists() or not names(folder)


def test_within_another_program_it_is_traced(folder):
    def largest(speed: Any) -> Any:
        return jnp.max(coefficient()(ExponentialLaw(0.5, 0.3, 1.0), speed))

    plain = jax.grad(lambda speed: 0.3 + 0.2 * jnp.exp(-speed))(0.4)
    assert float(jax.jit(jax.grad(largest))(0.4)) == pytest.approx(float(plain), rel=1e-12)
    assert not folder.exists() or not names(folder)


@pytest.mark.skipif(os.name != "posix", reason="needs permissions of POSIX")
def test_a_folder_in_which_others_may_write_is_left_alone(folder):
    folder.mkdir()
    folder.chmod(0o777)
    same(moments()(OPERATION, TIMES), moments()._traced(OPERATION, TIMES))
    assert not names(folder)
    folder.chmod(0o700)
    moments()(OPERATION, TIMES)
    (kept,) = folder.iterdir()
    assert kept.stat().st_mode & 0o077 == 0


def test_where_nothing_can_be_written_all_goes_on(folder):
    folder.write_text("a file in the place of the folder")
    same(moments()(OPERATION, TIMES), moments()._traced(OPERATION, TIMES))


def test_writers_at_the_same_time_leave_one_whole_file(folder, monkeypatch):
    with ThreadPoolExecutor(4) as pool:
        calls = [pool.submit(moments(), OPERATION, TIMES) for _ in range(4)]
        found = [call.result() for call in calls]
    assert len(names(folder)) == 1
    monkeypatch.setattr(Program, "_compile", never)
    for each in found:
        same(each, moments()(OPERATION, TIMES))


def test_the_folder_keeps_what_was_used_last(folder, monkeypatch):
    lengths = (7, 3, 2)
    made = []
    for age, length in enumerate(lengths):
        coefficient()(ConstantLaw(0.5), TIMES[:length])
        (path,) = set(folder.iterdir()) - set(made)
        os.utime(path, (1e9 + age, 1e9 + age))
        made.append(path)
    monkeypatch.setattr(programs, "MOST_BYTES", sum(path.stat().st_size for path in made) - 1)
    made[2].unlink()
    coefficient()(ConstantLaw(0.5), TIMES)  # the oldest is loaded, and so is the youngest now
    coefficient()(ConstantLaw(0.5), TIMES[:2])  # for which there is no room
    assert names(folder) == {made[0].name, made[2].name}


def test_what_calls_back_to_python_is_not_kept(folder, monkeypatch):
    def shouted(operation: Operation, times: jax.Array) -> Any:
        return jax.pure_callback(lambda t: 2 * t, jax.ShapeDtypeStruct((7,), np.float64), times)

    shouted.__module__, shouted.__qualname__ = vibration.__name__, "shouted"
    call: Callable[..., Any] = Program(shouted)
    same(call(OPERATION, TIMES), jnp.asarray(2 * TIMES))
    assert not names(folder)


def test_a_setting_of_the_whole_process_is_made_by_the_first_and_taken_back_by_the_last():
    done = []

    def make():
        done.append("made")
        return lambda: done.append("back")

    setting = programs._WhileAny(make)
    for _ in range(2):
        with setting:
            with setting:
                assert done == ["made"]
            assert done == ["made"]
        assert done == ["made", "back"]
        done.clear()


def test_while_a_program_is_compiled_jax_keeps_nothing_and_while_one_is_loaded_xla_is_silent(monkeypatch):
    name, levels = "jax_persistent_cache_min_compile_time_secs", []
    monkeypatch.setattr(programs.log, "absl_set_min_log_level", levels.append)
    before = jax.config.values[name]
    with programs._not_cached_by_jax:
        assert jax.config.values[name] == float("inf")
    assert jax.config.values[name] == before
    for given, usual in ((None, 1), ("0", 0)):
        monkeypatch.delenv("TF_CPP_MIN_LOG_LEVEL", raising=False)
        if given is not None:
            monkeypatch.setenv("TF_CPP_MIN_LOG_LEVEL", given)
        with programs._silent:
            assert levels == [3]
        assert levels == [3, usual]
        levels.clear()


def test_settings_of_jax_count_unless_they_change_no_program(monkeypatch):
    def told() -> list[str]:
        return [str(each) for each in programs._circumstances()]

    first = told()
    with jax.numpy_rank_promotion("warn"):
        assert told() != first
    with jax.log_compiles(True), jax.explain_cache_misses(True):
        assert told() == first
    for name, value in (("default_backend", lambda: "gpu"), ("device_count", lambda: 2)):
        with monkeypatch.context() as patch:
            patch.setattr(jax, name, value)
            with pytest.raises(programs._UntoldError):
                told()
    jax.config.update("jax_enable_compilation_cache", False)
    try:
        with pytest.raises(programs._UntoldError):
            told()
    finally:
        jax.config.update("jax_enable_compilation_cache", True)


def test_what_a_program_depends_on_is_told_whole_and_in_one_order():
    def told(value: Any) -> list[Any]:
        return list(programs._told(value))

    assert told({"b": 1, "a": (True, None)}) == told({"a": (True, None), "b": 1})
    assert told({"b": 1, "a": 2}) != told({"b": 2, "a": 1})
    apart = [
        ConstantLaw(0.5), ExponentialLaw(0.5, 0.3, 1.0), type(ConstantLaw(0.5)), compilation.Path,
        StickTransition.STICKS,
        StickTransition.SLIPS, "sticks", [1, 2], (1, 2), [(1,), 2], np.zeros(2), np.zeros((2, 1)), np.zeros(2,
        np.float32),
    ]  # fmt: skip
    found = []
    for each in apart:
        try:
            found.append(str(told(each)))
        except programs._UntoldError:
            assert each is compilation.Path  # which is not of this package
    assert len(set(found)) == len(apart) - 1
    # Numbers in arrays are no part of it; those of a law are arrays.
    assert told(ConstantLaw(0.5)) == told(ConstantLaw(0.6))
    for unknown in (object(), len, lambda: 0, {1, 2}, Path()):
        with pytest.raises(programs._UntoldError):
            told(unknown)


def test_laws_of_ones_own_are_given_back_when_others_have_come(folder, monkeypatch):
    monkeypatch.setattr(programs, "MOST_UNTOLD", 2)
    program, speeds, gone = coefficient(), np.array([0.0, 0.5]), []
    for _ in range(3):  # what cannot be compiled takes no place
        with pytest.raises(jax.errors.ConcretizationTypeError):
            program(FunctionLaw(lambda s: s if s[0] > 0 else -s), speeds)
    for size in (1.0, 2.0, 3.0):
        law = FunctionLaw(lambda s, size=size: size * jnp.exp(-s))
        gone.append(weakref.ref(law.function))
        np.testing.assert_allclose(program(law, speeds), size * np.exp(-speeds), rtol=1e-14)
    del law
    gc.collect()
    assert len(program._ready) == 2
    assert [each() is None for each in gone] == [True, False, False]
