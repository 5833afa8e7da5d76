"""An animation into one file: a part of a history, or a mode."""

from collections.abc import Callable
from pathlib import Path

from rich.console import Console

from drumsqueal.errors import RequestError
from drumsqueal.figures.animation import MovingSection
from drumsqueal.figures.playback import Playback, play_history, play_mode
from drumsqueal.figures.window import FRAMES_PER_SECOND
from drumsqueal.files.animation_file import write_animation
from drumsqueal.files.saved_history import SavedHistory
from drumsqueal.interrupts import noted_interrupts, stop_if_interrupted
from drumsqueal.jobs.progress import counting_bar
from drumsqueal.scene import Scene
from drumsqueal.scene.quantities import printable
from drumsqueal.simulation import prepare


def animate_history(
    file: Path,
    saved: SavedHistory,
    start: float | None,
    end: float | None,
    slow: float | None,
    magnification: float | None,
    console: Console,
) -> None:
    """Write the animation of a part of a history and print what it shows. Raises RequestError before anything."""
    playback = play_history(saved.data, saved.scene, start=start, end=end, slow=slow, magnification=magnification)
    _animate(file, playback, console)


def animate_mode(file: Path, scene: Scene, label: str, slow: float | None, console: Console) -> None:
    """Write the animation of a mode and print what it shows. Raises RequestError for a mode that there is not."""
    stability = prepare(scene).stability
    stop_if_interrupted()
    labels = [mode.label for mode in stability.modes]
    if label not in labels:
        there = f"it has {', '.join(labels)}" if labels else "nothing oscillates in it"
        raise RequestError(f"--mode {label}: the scene has no such mode; {there}")
    _animate(file, play_mode(scene, stability, stability.modes[labels.index(label)], slow=slow), console)


def save_animation(playback: Playback, path: Path | str, on_frame: Callable[[], None] | None = None) -> None:
    """Write an animation as .gif, or as .mp4 where there is ffmpeg; `on_frame` is called after each frame.

    Raises RequestError for another name, OSError where it cannot be written, and KeyboardInterrupt between two frames.
    """
    section = MovingSection(playback)

    def render(frame: int):
        stop_if_interrupted()
        image = section.image(frame)
        if on_frame is not None:
            on_frame()
        return image

    with noted_interrupts():
        write_animation(Path(path), render, section.frames, FRAMES_PER_SECOND)


def _animate(file: Path, playback: Playback, console: Console) -> None:
    stop_if_interrupted()
    with counting_bar(console) as progress:
        task = progress.add_task("drawing", total=playback.time.size)
        save_animation(playback, file, lambda: progress.advance(task))
    for note in playback.notes:
        console.print(printable(note))
    frames = playback.time.size
    told = f"{frames} frames, {frames / FRAMES_PER_SECOND:.3g} s, {file.stat().st_size / 1e6:.2g} MB, are in {file}"
    console.print(printable(told), soft_wrap=True)
