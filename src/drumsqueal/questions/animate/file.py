"""Animations as files: GIF through Pillow, MP4 through ffmpeg."""

import contextlib
import subprocess
import tempfile
from collections.abc import Callable
from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib.animation import FFMpegWriter
from numpy.typing import NDArray
from PIL import Image

from drumsqueal.errors import RequestError
from drumsqueal.files.output_folder import check_ending, write_whole

GIF, MP4 = ".gif", ".mp4"
COLOURS, SAMPLED = 256, 12  # of the palette, one for all frames of a GIF, made of that many of them

Render = Callable[[int], NDArray[np.uint8]]


def check_animation_name(path: Path) -> None:
    """Raise RequestError for a file that is neither .gif nor .mp4, and for .mp4 where there is no ffmpeg."""
    check_ending(path, (GIF, MP4), "an animation")
    if path.suffix.lower() == MP4 and not FFMpegWriter.isAvailable():
        raise RequestError(f"{path}: an .mp4 needs ffmpeg, which is not installed; save as .gif, or install ffmpeg")


def write_animation(path: Path, render: Render, frames: int, frames_per_second: int) -> None:
    """Write frames 0, 1, ... of `render`, red, green and blue (height, width, 3), as GIF or MP4: whole or not at all.

    A GIF runs in a loop. Raises RequestError for another name, OSError where the disk or ffmpeg fails.
    """
    check_animation_name(path)
    encode = _gif if path.suffix.lower() == GIF else _mp4
    write_whole(path, encode(render, frames, frames_per_second))


def _gif(render: Render, frames: int, frames_per_second: int) -> bytes:
    """One palette without dithering: what stands still is equal in all frames, and takes no room."""
    sampled = np.linspace(0, frames - 1, min(frames, SAMPLED)).astype(int).tolist()
    palette = Image.fromarray(np.concatenate([render(k) for k in sampled])).quantize(COLOURS, dither=Image.Dither.NONE)
    images = (Image.fromarray(render(k)).quantize(palette=palette, dither=Image.Dither.NONE) for k in range(frames))
    content = BytesIO()
    duration = 1000 // frames_per_second  # ms, to be a multiple of 10
    next(images).save(content, "gif", save_all=True, append_images=images, duration=duration, loop=0)
    return content.getvalue()


def _mp4(render: Render, frames: int, frames_per_second: int) -> bytes:
    height, width, _ = render(0).shape
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"animation{MP4}"
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
