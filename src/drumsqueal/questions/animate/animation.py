"""The moving section: shoe and drum, contact along the arc, and the displacements with the time in them."""

import contextlib
import subprocess
import tempfile
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.animation import FFMpegWriter
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import ListedColormap
from matplotlib.patches import FancyArrowPatch, Patch
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray
from PIL import Image
from rich.console import Console

from drumsqueal.coordinates import is_rotation
from drumsqueal.errors import RequestError
from drumsqueal.files.output_folder import check_ending, write_whole
from drumsqueal.findings.schema import Finding
from drumsqueal.physics.bodies.brake import Placed
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.animate.playback import (
    FRAMES_PER_SECOND,
    REVERSED,
    SEPARATED,
    STUCK,
    TICK,
    TOUCHING,
    Playback,
)
from drumsqueal.questions.animate.section import (
    CIRCLE,
    MILLI,
    Motion,
    lining_parts,
    moved,
    moved_drum,
    on_circle,
    shoe_outline,
)
from drumsqueal.scene.quantities import printable
from drumsqueal.terminal import style

# Animations as files: GIF through Pillow, _MP4 through ffmpeg.


GIF, _MP4 = ".gif", ".mp4"
_COLOURS, _SAMPLED = 256, 12  # of the palette, one for all frames of a GIF, made of that many of them

_Render = Callable[[int], NDArray[np.uint8]]


def check_animation_name(path: Path) -> None:
    """Raise RequestError for a file that is neither .gif nor .mp4, and for .mp4 where there is no ffmpeg."""
    check_ending(path, (GIF, _MP4), "an animation")
    if path.suffix.lower() == _MP4 and not FFMpegWriter.isAvailable():
        raise RequestError(f"{path}: an .mp4 needs ffmpeg, which is not installed; save as .gif, or install ffmpeg")


def write_animation(path: Path, render: _Render, frames: int, frames_per_second: int) -> None:
    """Write frames 0, 1, ... of `render`, red, green and blue (height, width, 3), as GIF or MP4: whole or not at all.

    A GIF runs in a loop. Raises RequestError for another name, OSError where the disk or ffmpeg fails.
    """
    check_animation_name(path)
    encode = _gif if path.suffix.lower() == GIF else _mp4
    write_whole(path, encode(render, frames, frames_per_second))


def _gif(render: _Render, frames: int, frames_per_second: int) -> bytes:
    """One palette without dithering: what stands still is equal in all frames, and takes no room."""
    sampled = np.linspace(0, frames - 1, min(frames, _SAMPLED)).astype(int).tolist()
    palette = Image.fromarray(np.concatenate([render(k) for k in sampled])).quantize(_COLOURS, dither=Image.Dither.NONE)
    images = (Image.fromarray(render(k)).quantize(palette=palette, dither=Image.Dither.NONE) for k in range(frames))
    content = BytesIO()
    duration = 1000 // frames_per_second  # ms, to be a multiple of 10
    next(images).save(content, "gif", save_all=True, append_images=images, duration=duration, loop=0)
    return content.getvalue()


def _mp4(render: _Render, frames: int, frames_per_second: int) -> bytes:
    height, width, _ = render(0).shape
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"animation{_MP4}"
        command = [
            FFMpegWriter.bin_path(), "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24",
            "-s", f"{width}x{height}", "-r", str(frames_per_second), "-i", "-",
            "-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "20", "-movflags", "+faststart", str(file),
        ]  # fmt: skip
        # In a session of its own Ctrl-C does not reach it, and is granted between two frames.
        with subprocess.Popen(
            command, stdin=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True
        ) as process:
            assert process.stdin is not None
            try:
                with contextlib.suppress(BrokenPipeError):  # it has given up, and says why
                    for k in range(frames):
                        process.stdin.write(render(k).tobytes())
                complaint = process.communicate()[1].decode(errors="replace").strip()
            except BaseException:
                process.kill()
                raise
        if process.returncode:
            raise OSError(f"ffmpeg failed: {complaint or f'exit status {process.returncode}'}")
        return file.read_bytes()


PIXELS, DOTS_PER_INCH = (700, 760), 115
# State: colour and name.
STATES = {
    TOUCHING: (style.TOUCHING, "touches and slips"),
    REVERSED: (style.REVERSED, "slip reversed"),
    SEPARATED: (style.SEPARATED, "lifted off"),
    STUCK: (style.STUCK, "sticks"),
}
# Fractions of the thickness: the ring that stands for the drum, and depths of what shows state and pressure.
RING, STATE_DEPTH, PRESSURE_DEPTH = 0.5, 0.09, 0.36
ARROW = {"arrowstyle": "-|>", "mutation_scale": 8, "linewidth": 0.9, "color": style.DARK}
LABEL: Any = {"fontsize": style.SMALL_SIZE, "ha": "center", "va": "center", "color": style.DARK}
STATES_LINE = 0.25  # of the figure's height


class MovingSection:
    """A figure of which only what moves is drawn anew from frame to frame."""

    @style.styled()
    def __init__(self, playback: Playback) -> None:
        """Draw everything, at the first frame."""
        self.playback = playback
        self._parts = playback.parts
        self._radius = float(playback.parts[0].shoe.outer_radius)
        self._thickness = min(float(part.shoe.thickness) for part in playback.parts)
        self._outlines = [shoe_outline(part) for part in playback.parts]
        depths = np.array([0.0, STATE_DEPTH, PRESSURE_DEPTH]) * self._thickness
        both = list(zip(playback.parts, playback.arcs, strict=True))
        self._linings = [
            [lining_parts(part, arc.edges, (depths[k], depths[k + 1])) for part, arc in both] for k in range(2)
        ]
        self.figure = style.new_figure(playback.title, playback.subject)
        self.figure.set_layout_engine("none")
        self.figure.set_dpi(DOTS_PER_INCH)
        self.figure.set_size_inches((PIXELS[0] / DOTS_PER_INCH, PIXELS[1] / DOTS_PER_INCH))
        top, line = 0.95, 0.026
        for place, note in enumerate(playback.notes):
            self.figure.text(0.01, top - line * place, note, fontsize=style.SMALL_SIZE, va="top", parse_math=False)
        below = top - line * len(playback.notes)
        self._section = self.figure.add_axes((0.01, 0.27, 0.84, below - 0.275))
        self._draw_drum()
        self._draw_shoe()
        self._draw_key(self.figure.add_axes((0.872, 0.36, 0.02, below - 0.46)))
        self._draw_curves(self.figure.add_axes((0.125, 0.07, 0.85, 0.13)))
        # What stands still is drawn once, and each frame over it.
        self._moving = sorted(
            (artist for artist in self.figure.findobj() if artist.get_animated()), key=lambda artist: artist.zorder
        )
        self.show(0)
        self._canvas = FigureCanvasAgg(self.figure)
        self._canvas.draw()
        self._background = self._canvas.copy_from_bbox(self.figure.bbox)

    @property
    def frames(self) -> int:
        """How many frames there are."""
        return self.playback.time.size

    def show(self, frame: int) -> None:
        """Move everything to a frame."""
        shown = self.playback
        motion = {name: values[frame] for name, values in shown.motion.items()}
        for body, part, outline in zip(self._bodies, self._parts, self._outlines, strict=True):
            body.set_xy(self._drawn(outline, part, motion, shown.z))
        for shapes, linings in zip((self._state, self._pressure), self._linings, strict=True):
            both = zip(self._parts, linings, strict=True)
            shapes.set_verts([each for part, corners in both for each in self._drawn(corners, part, motion, shown.z)])
        circle = on_circle(self._radius, CIRCLE)
        drum = moved_drum(CIRCLE, self._parts[0], motion, shown.z)
        self._drum.set_data(*(circle + shown.magnification * drum).T)
        self._state.set_array(self._states[frame])
        self._pressure.set_array(self._colour_values[frame])
        for lines, part, outline in zip(self._face_lines, self._parts, self._outlines, strict=True):
            for line, face in zip(lines, shown.faces or (), strict=True):
                line.set_data(*self._drawn(outline, part, motion, face).T)
        if shown.drum_turn is not None:
            self._ticks.set_segments(list(self._tick_lines(shown.drum_turn[frame])))
        moment = MILLI * shown.time[frame]
        self._marker.set_xdata([moment, moment])
        self._clock.set_text(f"t = {moment:.{self._decimals}f} ms")

    @style.styled()
    def image(self, frame: int) -> NDArray[np.uint8]:
        """Red, green and blue (height, width, 3) of a frame."""
        self.show(frame)
        self._canvas.restore_region(self._background)
        for artist in self._moving:
            artist.draw(self._canvas.get_renderer())
        return np.asarray(self._canvas.buffer_rgba())[..., :3].copy()

    def _drawn(self, points: NDArray[np.float64], part: Placed, motion: Motion, z: float) -> NDArray[np.float64]:
        return points + self.playback.magnification * moved(points, part, motion, z)

    def _draw_drum(self) -> None:
        """The ring, its marks, the limits of the picture, and angles along the arc."""
        axes, radius, ring = self._section, MILLI * self._radius, MILLI * RING * self._thickness
        inner, outer = (on_circle((radius + more) / MILLI, CIRCLE) for more in (0.0, ring))
        axes.fill(*np.concatenate([outer, inner[::-1]]).T, color=style.PALE, linewidth=0, zorder=1)
        axes.plot(*outer.T, color=style.FAINT, linewidth=0.6, zorder=1)
        # Above the shoe: how far it is drawn inside the drum is the magnification's doing.
        (self._drum,) = axes.plot(
            *inner.T, color=style.DARK, linewidth=0.7, linestyle=(0, (4, 2)), zorder=5, animated=True
        )
        self._ticks = LineCollection([], colors=style.DARK, linewidths=0.7, zorder=2, animated=True)
        axes.add_collection(self._ticks, autolim=False)
        limit = radius + 1.35 * MILLI * self._thickness  # of the thickness, around the drum
        axes.set_xlim(-limit, limit)
        axes.set_ylim(-limit, limit)
        axes.set_aspect("equal")
        axes.axis("off")
        for part in self._parts:
            half = float(part.shoe.half_angle)
            # Of a half angle of 160° and more the labels of the ends would meet.
            for angle in (-half, 0.0, half) if half < np.deg2rad(160.0) else (0.0,):
                x, y = on_circle((radius + 1.9 * ring) / MILLI, part.position + angle)
                axes.text(x, y, f"{np.rad2deg(angle):.3g}°".replace("-", "−"), **LABEL)
            if part.name:
                x, y = on_circle((radius - 1.6 * MILLI * self._thickness) / MILLI, part.position)
                axes.text(x, y, part.name, rotation=90 if abs(x) > abs(y) else 0, **LABEL)
        within = radius - MILLI * self._thickness
        tip, beyond = 0.3 * within, 0.37 * within
        for name, right, up in (("x", 1, 0), ("y", 0, 1)):
            axes.add_patch(FancyArrowPatch((0, 0), (tip * right, tip * up), shrinkA=0, shrinkB=0, **ARROW))
            axes.text(beyond * right, beyond * up, name, **LABEL)
        if self.playback.drum_sense:
            self._draw_sense(0.85 * within)

    def _draw_sense(self, radius: float) -> None:
        """An arrow within the drum, the way that it turns, where a short shoe is not."""
        ends = np.pi + self.playback.drum_sense * np.array([-0.3, 0.3])
        tail, head = on_circle(radius / MILLI, ends)
        # Curved to the drum's circle: the arc's height over its chord.
        bend = 0.5 * self.playback.drum_sense * np.tan(0.3 / 2)
        self._section.add_patch(FancyArrowPatch(tail, head, connectionstyle=f"arc3,rad={bend}", **ARROW))
        self._section.text(-0.93 * radius, 0.0, "drum\nturns", **LABEL | {"ha": "left"})

    def _tick_lines(self, turn: float) -> NDArray[np.float64]:
        """Marks on the drum's ring (marks, 2, 2)."""
        angles = turn % TICK + np.arange(-np.pi, np.pi, TICK)
        radius, depth = self._radius, RING * self._thickness
        return np.stack([on_circle(radius + part * depth, angles) for part in (0.35, 1.0)], axis=1)

    def _draw_shoe(self) -> None:
        axes, look = self._section, {"facecolor": "#DDDDDD", "edgecolor": style.DARK, "linewidth": 0.8}
        self._bodies = [axes.fill(*place.T, **look, zorder=3, animated=True)[0] for place in self._outlines]
        for place in self._outlines:
            axes.plot(*place.T, color=style.DARK, linewidth=0.5, linestyle=":", zorder=5, animated=True)
        colours = ListedColormap([STATES[k][0] for k in range(len(STATES))])
        self._state = PolyCollection([], cmap=colours, edgecolors="face", linewidths=0.3, zorder=4, animated=True)
        self._state.set_clim(-0.5, len(STATES) - 0.5)
        self._pressure = PolyCollection([], edgecolors="face", linewidths=0.3, zorder=4, animated=True)
        for parts in (self._state, self._pressure):
            axes.add_collection(parts, autolim=False)
        self._face_lines = [
            [
                axes.plot([], [], color=style.DARK, linewidth=0.9, linestyle=look, zorder=6, animated=True)[0]
                for look, _ in zip(("-", "--"), self.playback.faces or (), strict=False)
            ]
            for _ in self._parts
        ]

    def _draw_key(self, axes: Axes) -> None:
        """The scale of the pressure, and the names of the states that occur."""
        shown = self.playback
        pressure, self._states = (
            np.concatenate([getattr(arc, name) for arc in shown.arcs], axis=1) for name in ("pressure", "state")
        )
        change = any(arc.change for arc in shown.arcs)
        largest = float(np.abs(pressure).max()) or 1.0
        unit, scale = "relative", 1.0
        if not shown.relative:
            unit, scale = ("MPa", 1e6) if largest >= 1e5 else ("kPa", 1e3) if largest >= 100 else ("Pa", 1.0)
        values, largest = pressure / scale, largest / scale
        self._colour_values = np.ma.masked_where(self._states == SEPARATED, values)
        signed = change or values.min() < 0
        self._pressure.set_cmap(colormaps["RdBu_r" if signed else "YlGnBu"].with_extremes(bad="white"))
        self._pressure.set_clim(-largest if signed else 0.0, largest)
        bar = self.figure.colorbar(self._pressure, cax=axes)
        bar.set_label(f"{'Change of pressure' if change else 'Pressure'} ({unit})", fontsize=style.SMALL_SIZE)
        bar.locator = MaxNLocator(5)
        bar.ax.tick_params(labelsize=style.SMALL_SIZE)
        handles: list[Artist] = [
            Patch(color=colour, label=name) for key, (colour, name) in STATES.items() if np.any(self._states == key)
        ]
        self.figure.legend(
            handles=handles, loc="center left", bbox_to_anchor=(0.11, STATES_LINE), ncols=len(handles),
            borderaxespad=0.0, title=None, fontsize=style.SMALL_SIZE,
        )  # fmt: skip

    def _draw_curves(self, axes: Axes) -> None:
        shown = self.playback
        scale = 1 / max(np.abs(values).max() for values in shown.curves.values()) if shown.relative else 1.0
        time = MILLI * shown.curve_time
        for name, values in shown.curves.items():
            axes.plot(
                time,
                scale * values,
                color=style.COLOUR[name],
                label=f"R {name}" if is_rotation(name) else name,
                linewidth=1.1,
            )
        self._marker = axes.axvline(time[0], color=style.DARK, linewidth=1.0, animated=True)
        axes.set_xlim(time[0], time[-1])
        step = float(np.diff(shown.time).min()) * MILLI
        self._decimals = max(0, int(np.ceil(-np.log10(step))))
        style.frame(axes, "Time (ms)", f"Displacement\n({'relative' if shown.relative else 'µm at lining'})")
        look = {"ncols": 6, "borderaxespad": 0.1, "handlelength": 1.2, "columnspacing": 1.2}
        style.legend_above(axes, **look, fontsize=style.SMALL_SIZE)
        # In the line of the states: that of the curves' names may be full.
        self._clock = self.figure.text(
            0.975, STATES_LINE, "", ha="right", va="center", fontsize=style.TEXT_SIZE, animated=True
        )


class Animation(Finding):
    """What an animation file shows: frames, the times of the first and last (s), magnification (None: no size)."""

    file: str
    frames: int
    frames_per_second: int
    from_s: float
    until_s: float
    magnification: float | None
    notes: tuple[str, ...]


def save_animation(playback: Playback, path: Path | str, progress: Progress = silent) -> Animation:
    """Write an animation as .gif, or as .mp4 where there is ffmpeg, whole or not at all; return what it shows.

    `progress` is called before each frame. Raises RequestError for another name, OSError where it cannot be written.
    """
    section = MovingSection(playback)

    def render(frame: int) -> NDArray[np.uint8]:
        progress(f"frame {frame + 1} of {section.frames}", frame, section.frames)
        return section.image(frame)

    write_animation(Path(path), render, section.frames, FRAMES_PER_SECOND)
    return Animation(
        file=str(path),
        frames=section.frames,
        frames_per_second=FRAMES_PER_SECOND,
        from_s=playback.time[0],
        until_s=playback.time[-1],
        magnification=None if playback.relative else playback.magnification,
        notes=playback.notes,
    )


def print_animation(console: Console, shown: Animation) -> None:
    """Print what an animation shows."""
    for note in shown.notes:
        console.print(printable(note))
    size = Path(shown.file).stat().st_size / 1e6
    console.print(f"{shown.frames} frames, {shown.frames / shown.frames_per_second:.3g} s, {size:.2g} MB")
