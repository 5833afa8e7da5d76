"""A study of effects into one folder: the table grows on disk run by run, then the figure and the reduced scene."""

from pathlib import Path
from typing import Any

from rich.console import Console

from drumsqueal.files.output_folder import EFFECTS, EFFECTS_TABLE, REDUCED_SCENE, write_whole
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.questions.effects.figure import draw_effects
from drumsqueal.questions.effects.reductions import reductions_of
from drumsqueal.questions.effects.study import EffectStudy, reservations, study_effects, verdict
from drumsqueal.questions.effects.table import print_study, to_csv, to_data
from drumsqueal.questions.effects.variants import Variant
from drumsqueal.scene import Scene
from drumsqueal.scene.quantities import printable
from drumsqueal.terminal.progress import progress_bar
from drumsqueal.terminal.study import told_what_is_kept
from drumsqueal.terminal.style import save_figures


def study_into(folder: Path, scene: Scene, within: float, console: Console) -> dict[str, Any]:
    """Study the effects of a scene, write table, figure and reduced scene into the folder, print and return what it is.

    Raises IntegrationError for a study that failed or was interrupted; the runs made until then are in the table.
    """
    ran: list[Variant] = []
    with told_what_is_kept(folder / EFFECTS_TABLE):
        study = _study(folder, scene, within, console, ran)
        write_whole(folder / EFFECTS_TABLE, to_csv(study.variants, study).encode())
        write_whole(folder / REDUCED_SCENE, reduced_scene(study).encode())
        stop_if_interrupted()
        save_figures({EFFECTS: draw_effects(study)}, folder)
        stop_if_interrupted()
    print_study(console, study)
    console.print(printable(f"Table, figure and the reduced scene are in {folder}"), soft_wrap=True)
    return to_data(study)


def reduced_scene(study: EffectStudy) -> str:
    """The scene with what it needs, as a file that says what was left out."""
    remarks = "".join(f"# {printable(remark)}\n" for remark in (verdict(study), *reservations(study)))
    return f"{remarks}{study.reduced.to_toml()}"


def _study(folder: Path, scene: Scene, within: float, console: Console, ran: list[Variant]) -> EffectStudy:
    with progress_bar(console) as progress:
        task = progress.add_task("compiling", total=scene.simulate.duration, reached="")
        runs = 2 + len(reductions_of(scene))  # and then some of them together

        def keep(variant: Variant) -> None:
            ran.append(variant)
            write_whole(folder / EFFECTS_TABLE, to_csv(ran).encode())

        def show(label: str, reached: float) -> None:
            counted = f"{len(ran) + 1} of {runs}: " if len(ran) < runs else ""
            progress.update(task, description=f"{counted}{label}", completed=reached, reached=f"{reached:.4f} s")

        return study_effects(scene, within, on_variant=keep, on_progress=show)
