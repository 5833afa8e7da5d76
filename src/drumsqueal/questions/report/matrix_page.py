"""The page of a noise matrix: which cells squeal, at what frequency, how loud, and after what disturbance."""

import math
from pathlib import Path
from typing import Any

from drumsqueal.errors import RequestError
from drumsqueal.files.output_folder import MATRIX, MATRIX_DATA, MATRIX_SUMMARY, figure_file
from drumsqueal.findings.schema import read_findings
from drumsqueal.questions.matrix.found import NoiseMatrix, shown_levels
from drumsqueal.questions.report.page import picture

NO_FIGURE = "The figure is not in the folder: the matrix has too many cells for one, or the figure was removed."


def matrix_content(folder: Path) -> tuple[NoiseMatrix, dict[str, Any]]:
    """A noise matrix and what else the template takes. Raises RequestError for files that are none of it."""
    if not (folder / MATRIX_SUMMARY).exists():
        raise RequestError(f"{folder}: there is {MATRIX_DATA}, but no {MATRIX_SUMMARY}; resume the noise matrix")
    found = read_findings(folder / MATRIX_SUMMARY, NoiseMatrix)
    text = f"{found.headline}. Each that squeals has its frequency and is coloured by its level; the table has both."
    drawn = picture(folder / figure_file(MATRIX), ("Noise matrix", text))
    return found, {
        "kind": "report of a noise matrix",
        "title": found.title or "Noise matrix",
        "warning": None,
        "headline": f"{found.headline}.",
        "pictures": [] if drawn is None else [drawn],
        "missing": "" if drawn else NO_FIGURE,
        "rows": [(cell, shown_levels(found, cell)) for cell in found.cells],
        "procedures": any(math.isfinite(cell.time_s) for cell in found.cells),
    }
