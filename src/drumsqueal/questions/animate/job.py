"""An animation into one file: a part of a history, or a mode."""

from pathlib import Path
from typing import Any

from rich.console import Console

from drumsqueal.errors import RequestError
from drumsqueal.files.saved_history import SavedHistory
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.questions.animate.animation import save_animation
from drumsqueal.questions.animate.playback import Playback, play_history, play_mode
from drumsqueal.questions.animate.window import FRAMES_PER_SECOND
from drumsqueal.scene import Scene
from drumsqueal.scene.quantities import printable
from drumsqueal.simulation import prepare
from drumsqueal.terminal.progress import counting_bar


def animate_history(
    file: Path,
    saved: SavedHistory,
    start: float | None,
    end: float | None,
    slow: float | None,
    magnification: float | None,
    console: Console,
) -> dict[str, Any]:
    """Write the animation of a part of a history, print what it shows and return that. Raises RequestError."""
    playback = play_history(saved.data, saved.scene, start=start, end=end, slow=slow, magnification=magnification)
    return _animate(file, playback, console)


def animate_mode(file: Path, scene: Scene, label: str, slow: float | None, console: Console) -> dict[str, Any]:
    """Write the animation of a mode, print what it shows and return that. Raises RequestError for no such mode."""
    stability = prepare(scene).stability
    stop_if_interrupted()
    labels = [mode.label for mode in stability.modes]
    if label not in labels:
        there = f"it has {', '.join(labels)}" if labels else "nothing oscillates in it"
        raise RequestError(f"--mode {label}: the scene has no such mode; {there}")
    return _animate(file, play_mode(scene, stability, stability.modes[labels.index(label)], slow=slow), console)


def _animate(file: Path, playback: Playback, console: Console) -> dict[str, Any]:
    stop_if_interrupted()
    file.parent.mkdir(parents=True, exist_ok=True)  # `out`, where no file was named
    with counting_bar(console) as progress:
        task = progress.add_task("drawing", total=playback.time.size)
        save_animation(playback, file, lambda: progress.advance(task))
    for note in playback.notes:
        console.print(printable(note))
    frames = playback.time.size
    told = f"{frames} frames, {frames / FRAMES_PER_SECOND:.3g} s, {file.stat().st_size / 1e6:.2g} MB, are in {file}"
    console.print(printable(told), soft_wrap=True)
    return {
        "file": str(file),
        "frames": frames,
        "frames_per_second": FRAMES_PER_SECOND,
        "from_s": playback.time[0],
        "until_s": playback.time[-1],
        "magnification": None if playback.relative else playback.magnification,
        "notes": list(playback.notes),
    }
