"""A part of a record is asked for, and refused, in the same words everywhere."""

import pytest

from drumsqueal.errors import RequestError
from drumsqueal.findings.history import time_window

COVERED, INTERVAL = (0.5, 2.0), 1e-3


@pytest.mark.parametrize(
    ("asked", "wanted"),
    [
        ((None, None), (0.5, 2.0)),
        ((0.7, None), (0.7, 2.0)),
        ((None, 0.7), (0.5, 0.7)),
        ((0.6, 0.7), (0.6, 0.7)),
        ((0.5 - INTERVAL, 2.0 + INTERVAL), (0.5, 2.0)),  # a record of N samples lasts N intervals
    ],
)
def test_a_part_within_the_record_is_taken(asked, wanted):
    assert time_window("the record", COVERED, INTERVAL, *asked) == wanted


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        ((-1.0, None), "--from -1 s: the record has 0.5 to 2 s; take a time within it"),
        ((None, 99.0), "--until 99 s: the record has 0.5 to 2 s; take a time within it"),
        ((None, 2.0 + 1.01 * INTERVAL), "--until 2.00101 s: the record has 0.5 to 2 s; take a time within it"),
        ((2.5, None), "--from 2.5 s: the record has 0.5 to 2 s; take a time within it"),
        ((None, float("nan")), "--until nan s: the record has 0.5 to 2 s; take a time within it"),
        ((1.0, 0.9), "--from 1 s is not before --until 0.9 s; the record has 0.5 to 2 s"),
        ((2.0, None), "--from 2 s is not before the end at 2 s; the record has 0.5 to 2 s"),
        ((None, 0.5), "the start at 0.5 s is not before --until 0.5 s; the record has 0.5 to 2 s"),
    ],
)
def test_what_the_record_does_not_cover_is_refused(asked, told):
    with pytest.raises(RequestError) as caught:
        time_window("the record", COVERED, INTERVAL, *asked)
    assert str(caught.value) == told
