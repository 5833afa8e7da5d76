"""What a motion is called, and that each number which decides it has its reason beside it."""

import inspect
import itertools

import pytest

from drumsqueal.findings.kinds import Criteria, Kind


@pytest.mark.parametrize("word", ["unknown", "not determined", "not settled"])
def test_files_of_earlier_versions_are_read(word):
    assert Kind(word) is Kind.UNDECIDED


def test_what_is_no_kind_of_motion_is_refused():
    with pytest.raises(ValueError, match="is not a valid Kind"):
        Kind("loud")


def test_what_goes_on_by_itself_squeals_and_what_is_not_clear_does_not():
    squealing = {each for each in Kind if each.squeals}
    assert squealing == {Kind.SQUEALS, Kind.PERIODIC, Kind.QUASI_PERIODIC, Kind.CHAOTIC, Kind.IRREGULAR}
    unclear = {each for each in Kind if not each.clear}
    assert unclear == {Kind.GROWS, Kind.RUNS_AWAY, Kind.UNDECIDED, Kind.FAILED}


def test_each_criterion_has_its_reason():
    lines = [line.strip() for line in inspect.getsource(Criteria).splitlines()]
    reasons = {}
    for before, line in itertools.pairwise(lines):
        name, _, value = line.partition(" = ")
        if value:  # beside it, or above it and those that share its reason
            reasons[name] = "#" in value or before.startswith("#") or reasons.get(before.partition(" = ")[0], False)
    assert set(reasons) == {name for name in vars(Criteria) if not name.startswith("_")}
    assert all(reasons.values())
