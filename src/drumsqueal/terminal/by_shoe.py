"""Several shoes on a drum that does not bend: they do not feel each other, so a command takes one after the other."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from drumsqueal.errors import RequestError
from drumsqueal.scene import load_scene
from drumsqueal.terminal.reply import make_console

RUN = "run"  # the command whose folder has the scene's name alone


def each_problem(name: str, values: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """The arguments of a command, once for each shoe where those are problems of their own, with folders of theirs.

    Raises RequestError for results of several shoes in one JSON file, and SceneError of a wrong scene.
    """
    scene = values.get("scene")
    if not isinstance(scene, Path) or "settings" not in values:
        yield values
        return
    settings = values["settings"] or []
    loaded = load_scene(scene, settings)
    if not loaded.several or loaded.elastic_table("drum")[1] is not None:
        yield values
        return
    if values.get("json_file") is not None:
        choices = " or ".join(f"--set shoe={each}" for each in loaded.shoe_names)
        raise RequestError(f"--json: the drum does not bend, so each shoe has results of its own; add {choices}")
    console = make_console(quiet=bool(values.get("quiet")))
    alone = "The drum does not bend, so the shoes do not feel each other: each is a problem of its own."
    console.print(alone, soft_wrap=True)
    folder = values.get("output") or Path("out") / (scene.stem if name == RUN else f"{scene.stem}-{name}")
    for shoe in loaded.shoe_names:
        console.print(f"\n{shoe} shoe", style="bold")
        own = {"settings": [*settings, f"shoe={shoe}"]}
        yield {**values, **own, **({"output": folder / shoe} if "output" in values else {})}
