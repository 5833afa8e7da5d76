"""Make matrix.json, which tests print and draw, of matrix.toml: `python tests/data/make.py`, ten seconds.

A thorough test in `tests/questions/test_matrix.py` compares it with the study, and fails where it is to be made anew.
"""

from pathlib import Path

import drumsqueal as ds
from drumsqueal.files.output_folder import write_json

if __name__ == "__main__":
    here = Path(__file__).parent
    write_json(ds.study_matrix(here / "matrix.toml"), here / "matrix.json")
