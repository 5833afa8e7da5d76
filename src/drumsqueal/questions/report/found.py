"""What a folder holds that a page is made from."""

from pathlib import Path

from drumsqueal.errors import RequestError
from drumsqueal.files.output_folder import HISTORY, ONSET_SUMMARY, ONSET_TABLE, SUMMARY

RUN, ONSET = "run", "onset"


def what_is_in(folder: Path) -> str:
    """Whether a folder holds a run or a study of the onset. Raises RequestError where it holds neither, or both."""
    kinds = {RUN: (SUMMARY, HISTORY), ONSET: (ONSET_SUMMARY, ONSET_TABLE)}
    try:
        if not folder.is_dir():
            there = "a file, not a folder" if folder.exists() else "not there"
            raise RequestError(f"{folder} is {there}; name the folder that drumsqueal run or drumsqueal onset has left")
        held = [kind for kind, files in kinds.items() if any((folder / name).is_file() for name in files)]
    except (OSError, ValueError) as error:
        if isinstance(error, RequestError):
            raise
        raise RequestError(f"{folder}: cannot be read ({getattr(error, 'strerror', None) or error})") from None
    if not held:
        fault = f"{folder} holds neither a run ({SUMMARY}, {HISTORY}) nor a study of the onset ({ONSET_SUMMARY})"
        raise RequestError(f"{fault}; name the folder that one of them has left")
    if len(held) > 1:
        raise RequestError(f"{folder} holds a run and a study of the onset; put one of them into a folder of its own")
    return held[0]
