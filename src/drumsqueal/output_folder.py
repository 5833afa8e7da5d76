"""The folder of a run: nothing of value in it is overwritten unasked, and it can be written before work begins."""

import tempfile
from pathlib import Path

from drumsqueal.errors import RequestError

HISTORY, SUMMARY = "history.nc", "summary.json"


def check_output(folder: Path, *, overwrite: bool) -> None:
    """Raise RequestError where results lie already, or where the folder's place is taken by something else."""
    for part in (folder, *folder.parents):
        if part.exists() and not part.is_dir():
            raise RequestError(f"{folder}: {part} is a file, not a folder; choose another with -o")
    if (folder / HISTORY).exists() and not overwrite:
        raise RequestError(
            f"{folder / HISTORY} exists; add --overwrite to replace it, or choose another folder with -o"
        )


def claim_output(folder: Path) -> None:
    """Create the folder, prove that it can be written and clear it of an earlier run's history and summary."""
    missing = [part for part in (folder, *folder.parents) if not part.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
        for name in (HISTORY, SUMMARY):
            (folder / name).unlink(missing_ok=True)
    except OSError as error:
        for part in missing:
            if part.exists():
                part.rmdir()
        raise RequestError(
            f"{folder}: this folder cannot be written ({error.strerror or error}); choose another with -o"
        ) from None
