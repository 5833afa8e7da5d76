"""Several shoes on a drum that does not bend: they do not feel each other, so a command takes one after the other."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from drumsqueal.errors import NothingToDoError, RequestError
from drumsqueal.files import output_folder as files
from drumsqueal.scene import Scene, load_scene
from drumsqueal.scene.quantities import printable
from drumsqueal.scene.shoes import OWN, key_of_one
from drumsqueal.terminal.reply import make_console

RUN = "run"  # the command whose folder has the scene's name alone
CYCLE = "cycle"  # the one that writes other files where it follows a range
RANGES = ("vary", "along")  # arguments that begin with a key of the scene


def take_each(name: str, command: Callable[..., None], values: Mapping[str, Any]) -> None:
    """Call a command, once for each shoe where those are problems of their own, with folders of theirs.

    Keys and folders of all shoes are looked at before the first. Raises RequestError also for results of several shoes
    in one JSON file, and SceneError of a wrong scene.
    """
    scene = values.get("scene")
    if not isinstance(scene, Path) or "settings" not in values:
        command(**values)
        return
    settings = values["settings"] or []
    loaded = load_scene(scene, settings)
    if not loaded.several or loaded.elastic_table("drum")[1] is not None:
        command(**values)
        return
    if values.get("json_file") is not None:
        choices = " or ".join(f"--set shoe={each}" for each in loaded.shoe_names)
        raise RequestError(f"--json: the drum does not bend, so each shoe has results of its own; add {choices}")
    _check_keys(loaded, values)
    folder = values.get("output") or Path("out") / (scene.stem if name == RUN else f"{scene.stem}-{name}")
    folders = {shoe: folder / shoe for shoe in loaded.shoe_names}
    there = [shoe for shoe in folders if folders[shoe].exists()]
    resume = bool(values.get("resume"))
    for each in folders.values():
        files.check_output(each, files_of(name, each, values), overwrite=resume or bool(values.get("overwrite")))
    console = make_console(quiet=bool(values.get("quiet")))
    alone = "The drum does not bend, so the shoes do not feel each other: each is a problem of its own."
    console.print(alone, soft_wrap=True)
    complete = []
    for shoe, own in folders.items():
        console.print(f"\n{shoe} shoe", style="bold")
        changed: dict[str, Any] = {"settings": [*settings, f"shoe={shoe}"]}
        changed |= {"output": own} if "output" in values else {}
        changed |= {"resume": shoe in there or not there} if resume else {}  # one may not have begun
        try:
            command(**{**values, **changed})
        except NothingToDoError as error:
            complete.append(error)
            if len(complete) == len(folders):
                raise
            console.print(printable(f"Passed over: {error}"), soft_wrap=True)


def files_of(name: str, folder: Path, values: Mapping[str, Any]) -> tuple[str, ...]:
    """What a command writes into a folder; KeyError where that was forgotten."""
    if "output" not in values:
        return ()
    if name == RUN:
        return files.files_of_run(folder)
    if name == CYCLE:
        return files.FILES["branch" if values.get("along") else CYCLE]
    return files.FILES[name]


def _check_keys(scene: Scene, values: Mapping[str, Any]) -> None:
    """Raise RequestError for ranges of a number that is not the same one for all shoes."""
    for option in RANGES:
        given = values.get(option) or ()
        for text in (given,) if isinstance(given, str) else given:
            for key in text.partition("=")[0].split(","):
                for k, name in enumerate(scene.shoe_names):
                    _check_key(scene, f"--{option} {text}", key.strip(), k, name)


def _check_key(scene: Scene, where: str, key: str, k: int, name: str) -> None:
    """The same for one shoe, whose own numbers are asked for of that shoe alone."""
    alone = key_of_one(key, k, name)
    if alone != key:
        reason = f"this is of the {name} shoe, and with a drum that does not bend each shoe is a problem of its own"
        raise RequestError(f"{where}: {reason}; take it by --set shoe={name}, and write {alone}=...")
    if key.partition(".")[0] in OWN and scene.key_of(k, key) != key:
        one_by_one = " or ".join(f"--set shoe={each}" for each in scene.shoe_names)
        raise RequestError(f"{where}: the {name} shoe has its own, {scene.key_of(k, key)}; take one, by {one_by_one}")
