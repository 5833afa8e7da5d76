"""What Python and a notebook show: names, what was found, progress and plots."""

import io
import os
import pickle
import re
import sys
import threading
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure
from rich.console import Console

import drumsqueal
from drumsqueal import progress
from drumsqueal.questions.cycle.study import find_cycle
from drumsqueal.questions.run.answer import print_findings
from drumsqueal.questions.stability import print_stability
from drumsqueal.questions.stability import print_stability as as_printed
from drumsqueal.scene import load_scene
from drumsqueal.simulation import prepare, run_whole
from drumsqueal.solve.motion import integrate
from drumsqueal.terminal.reply import Reply
from processes import wait_until

LONG = 500  # characters: more than a few lines


def test_no_public_name_is_that_of_a_module():
    # Who imports that module would find it in the place of what is public.
    modules = {path.stem for path in Path(drumsqueal.__file__).parent.iterdir()}
    assert not modules & set(drumsqueal.__all__)


@pytest.fixture(scope="module")
def damped():
    return load_scene(Path(__file__).parents[1] / "scenarios" / "damped.toml")


@pytest.fixture(scope="module")
def result(nominal):
    return run_whole(prepare(nominal.with_values({"simulate.duration": 0.02})))


@pytest.fixture(scope="module")
def stick_slip():
    block = drumsqueal.block_on_belt(drumsqueal.StepLaw(1.0, 0.5), belt_speed=0.2)
    return integrate(block, {"velocity": {"X": 0.2}}, 20.0, sample_rate=50.0)


@pytest.fixture
def axes():
    return Figure().subplots()


def printed(print_it, found) -> str:
    """What a command prints, without what rich does to it for a terminal."""
    console = Console(file=io.StringIO(), width=80, highlight=False, markup=False, emoji=False)
    print_it(console, found)
    return console.file.getvalue().rstrip()  # pyright: ignore[reportAttributeAccessIssue]


def test_the_public_names_are_what_completion_offers():
    names = dir(drumsqueal)
    assert names == drumsqueal.__all__
    assert not {name for name in names if not hasattr(drumsqueal, name)}


def test_types_are_found_by_those_who_install_the_package():
    from importlib.resources import files

    assert files("drumsqueal").joinpath("py.typed").is_file()


@pytest.mark.thorough
def test_results_are_short_by_name_and_whole_when_printed(result, stick_slip):
    for found in (result, result.findings, result.stability, result.stability.modes[0], stick_slip):
        assert len(repr(found)) < LONG
    assert repr(result).endswith(result.findings.verdict)
    assert repr(result.findings.prediction).startswith("Prediction(eigenvalues=<12 tuple>")
    assert str(result) == str(result.findings) == printed(print_findings, result.findings)
    assert str(result.stability) == printed(as_printed, result.stability)


@pytest.mark.thorough
def test_a_notebook_shows_what_the_command_prints(result):
    for found, print_it in ((result, print_findings), (result.stability, print_stability)):
        page = found._repr_html_()
        last = printed(print_it, getattr(found, "findings", found)).splitlines()[-1]
        assert page.startswith("<pre")
        assert last.split()[-1] in page
    # A title is the user's own words, and no element of the page.
    titled = result.findings.model_copy(update={"held_though_they_would_move": ("<b>",)})
    assert "&lt;b&gt;" in titled._repr_html_()
    assert result.findings.prediction._repr_html_() is None


# Progress: public functions show a bar unless their caller takes what they report.


def computes(steps, progress=progress.silent):
    for step in range(steps):
        progress("computing", step + 1, steps)
    return progress


def test_who_takes_progress_gets_it_and_others_see_a_bar():
    heard = []
    shown = progress.with_bar(computes, __name__)
    assert shown(2, lambda *report: heard.append(report)) is not progress.silent
    assert heard == [("computing", 1, 2), ("computing", 2, 2)]
    assert shown(1) is not progress.silent
    assert shown(1, progress=progress.silent) is progress.silent


def test_a_thread_that_works_for_another_one_shows_nothing():
    shown, used = progress.with_bar(computes, __name__), []
    thread = threading.Thread(target=lambda: used.append(shown(1)))
    thread.start()
    thread.join()
    assert used == [progress.silent]


def test_a_public_function_can_be_sent_to_another_process():
    assert pickle.loads(pickle.dumps(drumsqueal.run)) is drumsqueal.run


def test_the_bar_of_a_notebook_follows_and_goes(monkeypatch):
    pages = []
    place = SimpleNamespace(update=pages.append)
    fake = SimpleNamespace(HTML=str, display=lambda page, display_id: place)
    monkeypatch.setitem(sys.modules, "ipykernel", SimpleNamespace())
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(display=fake))
    monkeypatch.setitem(sys.modules, "IPython.display", fake)
    with progress.bar() as show:
        show("<integrating>", 1.0, 4.0)
        show("comparing", 0.0, None)
    first, second, last = pages
    assert 'value="0.2500"' in first
    assert "&lt;integrating&gt;" in first
    assert "value" not in second
    assert last == ""


# Plots on axes of the caller's.


@pytest.mark.thorough
def test_histories_are_drawn_on_the_axes_that_are_given(result, stick_slip, axes):
    assert drumsqueal.plot_history(result, ["Y"], ax=axes) is axes
    moved = result.history["displacement"].sel(coordinate="Y").values
    np.testing.assert_allclose(axes.lines[0].get_ydata(), 1e6 * moved)  # µm
    np.testing.assert_allclose(axes.lines[0].get_xdata(), 1e3 * result.history["time"].values)  # ms
    drumsqueal.plot_history(stick_slip, ax=axes)
    np.testing.assert_allclose(axes.lines[1].get_ydata(), stick_slip.displacement[:, 0])  # a metre is not small
    with pytest.raises(drumsqueal.RequestError, match="'W' is no coordinate; there are X, Y"):
        drumsqueal.plot_history(result, ["W"], ax=axes)


def test_modes_spectra_and_portraits_are_drawn(result, stick_slip, axes):
    drumsqueal.plot_eigenvalues(result.stability, ax=axes)
    drawn = {line.get_gid(): line.get_xydata()[0] for line in axes.lines if line.get_gid()}
    for mode in result.stability.modes:
        np.testing.assert_allclose(drawn[f"predicted {mode.label}"], [mode.growth_rate, mode.frequency_Hz / 1e3])
    for plot in (drumsqueal.plot_growth, drumsqueal.plot_spectrum, drumsqueal.plot_phase):
        fresh = Figure().subplots()
        assert plot(result, ax=fresh) is fresh
        assert fresh.lines
        assert fresh.get_ylabel()
    drumsqueal.plot_phase(stick_slip, ax=axes)
    np.testing.assert_allclose(axes.lines[-1].get_ydata(), stick_slip.velocity[:, 0])


def test_without_axes_a_figure_is_made(result):
    from matplotlib import pyplot

    before = pyplot.get_backend()
    pyplot.switch_backend("agg")
    try:
        assert drumsqueal.plot_growth(result).figure.number in pyplot.get_fignums()  # pyright: ignore[reportAttributeAccessIssue]
    finally:
        pyplot.close("all")
        pyplot.switch_backend(before)


@pytest.mark.thorough
def test_cycles_are_drawn(damped, axes):
    cycle = find_cycle(damped.with_values({"simulate.duration": 0.3}))
    drumsqueal.plot_cycle(cycle, ax=axes)
    assert np.ptp(axes.lines[0].get_xdata()) / 2 == pytest.approx(1e6 * cycle.amplitude["Y"], rel=1e-2)  # samples
    assert len(repr(cycle)) < LONG
    assert cycle.verdict in " ".join(str(cycle).split())


@pytest.mark.thorough
def test_the_page_of_the_documentation_runs(monkeypatch):
    from matplotlib import pyplot

    root = Path(__file__).parents[1]
    monkeypatch.chdir(root)
    code = re.findall("```python\n(.*?)```", (root / "docs" / "python.md").read_text(encoding="utf-8"), re.DOTALL)[-2:]
    monkeypatch.setattr(Figure, "savefig", lambda *_, **__: None)
    before, found = pyplot.get_backend(), {}
    pyplot.switch_backend("agg")
    try:
        exec("".join(code), found)
    finally:
        pyplot.close("all")
        pyplot.switch_backend(before)
    assert [len(found[side].lines) > 3 for side in ("left", "right")] == [True, True]


def test_a_file_is_told_what_takes_long_but_not_each_step(monkeypatch):
    monkeypatch.setattr(progress, "MOST_SILENT", 0.01)
    file = io.StringIO()
    console = Console(file=file, width=80)

    def printed():
        return file.getvalue().splitlines()

    with progress.bar(console) as show:
        wait_until(lambda: printed()[:2] == ["preparing", "preparing (0 s so far)"])
        show("integrating", 1.0, 4.0)
        wait_until(lambda: "integrating: 25 %" in printed())
    said = len(printed())
    monkeypatch.setattr(progress, "MOST_SILENT", 600.0)
    with progress.bar(console) as show:  # what is quick is not delayed by it, and says nothing
        show("integrating", 2.0, 4.0)
    assert len(printed()) == said


def test_progress_of_a_command_is_on_standard_error_and_never_among_its_answers(capsys, monkeypatch):
    monkeypatch.setattr(progress, "MOST_SILENT", 0.01)

    def is_told():
        answers, errors = capsys.readouterr()
        assert answers == ""
        return "integrating" in errors

    for json_file in ("-", None):
        with Reply(False, json_file, overwrite=False).progress() as show:
            show("integrating", 0.0, 4.0)
            wait_until(is_told)
    before = threading.active_count()
    with Reply(True, None, overwrite=False).progress() as show:
        show("integrating", 0.0, 4.0)
        assert threading.active_count() == before  # nobody is there who would say it
    assert capsys.readouterr() == ("", "")


def test_a_pipe_that_nobody_reads_costs_no_answer(monkeypatch):
    monkeypatch.setattr(progress, "MOST_SILENT", 0.01)
    reader, writer = os.pipe()
    os.close(reader)
    answers = os.fstat(1)
    file, before = os.fdopen(writer, "w"), threading.active_count()
    with progress.bar(Console(file=file)) as show:
        show("integrating", 0.0, None)
        wait_until(lambda: threading.active_count() == before)  # who tells it has tried, and given up
    with suppress(BrokenPipeError):
        file.close()
    assert os.path.samestat(answers, os.fstat(1))
