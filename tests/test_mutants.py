"""That every fault in `mutants.toml` is still one of the source."""

import tomllib
from pathlib import Path

import drumsqueal


def test_every_mutant_changes_one_place_of_the_source():
    mutants = tomllib.loads(Path(__file__).with_name("mutants.toml").read_text())["mutant"]
    source = Path(drumsqueal.__file__).parent
    assert not [each for each in mutants if (source / each["file"]).read_text().count(each["old"]) != 1]
    assert not [each for each in mutants if each["old"] == each["new"]]
