"""A study of sensitivity into one folder: derivatives and their figure first, then the quiet scene where wanted."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from drumsqueal.errors import IntegrationError
from drumsqueal.files.json_file import write_json
from drumsqueal.files.output_folder import (
    QUIET_SCENE,
    SENSITIVITY,
    SENSITIVITY_SUMMARY,
    SENSITIVITY_TABLE,
    write_whole,
)
from drumsqueal.interrupts import noted_interrupts, stop_if_interrupted
from drumsqueal.questions.sensitivity.decay import Decay, nonlinear_decay
from drumsqueal.questions.sensitivity.figure import draw_sensitivity
from drumsqueal.questions.sensitivity.quieting import Quieting, quieten, variable_numbers
from drumsqueal.questions.sensitivity.study import SensitivityStudy, check_modes, study_sensitivity
from drumsqueal.questions.sensitivity.table import (
    describe_study,
    print_quieting,
    print_sensitivity,
    quiet_sentence,
    to_csv,
)
from drumsqueal.scene import Scene
from drumsqueal.scene.quantities import printable
from drumsqueal.simulation import check_sample_rate, prepare
from drumsqueal.terminal.study import told_what_is_kept
from drumsqueal.terminal.style import save_figures


def check_request(scene: Scene, keys: Sequence[str] | None, *, until_stable: bool) -> None:
    """Raise SceneError or RequestError for what cannot be studied, before there is a folder."""
    prepared = prepare(scene)
    check_modes(prepared.stability)
    if until_stable:
        check_sample_rate(prepared)
        variable_numbers(scene, keys)


def study_into(
    folder: Path, scene: Scene, keys: Sequence[str] | None, console: Console, *, until_stable: bool
) -> dict[str, Any]:
    """Study a scene, write table, figure and, where it is wanted, the quiet scene; print and return what was found.

    Raises IntegrationError for a study that failed or was interrupted, and where no change makes the scene quiet.
    """
    table = folder / SENSITIVITY_TABLE
    with told_what_is_kept(table), _progress(console, "derivatives"):
        study = study_sensitivity(scene)
        write_whole(table, to_csv(study).encode())
        found = describe_study(study)
        write_json(found, folder / SENSITIVITY_SUMMARY)
        save_figures({SENSITIVITY: draw_sensitivity(study)}, folder)
        stop_if_interrupted()
    print_sensitivity(console, study)
    if until_stable:
        found = _quieten_into(folder, study, keys, console) or found
    console.print(printable(f"What was found is in {folder}"), soft_wrap=True)
    return found


def _quieten_into(
    folder: Path, study: SensitivityStudy, keys: Sequence[str] | None, console: Console
) -> dict[str, Any] | None:
    """The study with what was found, None where there was nothing to make quiet."""
    if not study.stability.unstable and study.stability.divergence is None:
        console.print("Nothing in this scene is unstable: there is nothing to make quiet.", style="bold")
        return None
    with told_what_is_kept(folder / SENSITIVITY_TABLE), noted_interrupts():
        with _progress(console, "searching the smallest change"):
            quiet = quieten(study.scene, keys, state_matrix=study.state_matrix)
        write_json(describe_study(study, quiet), folder / SENSITIVITY_SUMMARY)
        if not quiet.found:
            least = f"the least that was reached is a growth of {quiet.largest_growth:+.4g} 1/s"
            names = ", ".join(change.key for change in quiet.changes)
            raise IntegrationError(f"no change of {names} within bounds was found that makes every mode decay; {least}")
        _write_scene(folder, study, quiet, ())
        with _progress(console, "transients of the changed scene"):
            decays = nonlinear_decay(quiet.scene)
        found = _write_scene(folder, study, quiet, decays)
        stop_if_interrupted()
    print_quieting(console, quiet, decays)
    return found


def _write_scene(folder: Path, study: SensitivityStudy, quiet: Quieting, decays: Sequence[Decay]) -> dict[str, Any]:
    found = describe_study(study, quiet, decays)
    write_json(found, folder / SENSITIVITY_SUMMARY)
    remark = f"# {printable(quiet_sentence(quiet, decays))}\n"
    write_whole(folder / QUIET_SCENE, f"{remark}{quiet.scene.to_toml()}".encode())
    return found


def _progress(console: Console, what: str):
    return console.status(what)
