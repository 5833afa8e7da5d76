"""Intervals of a number: what they have in common, and what is left of them."""

from drumsqueal.findings.squeals import common, joined, without


def test_intervals_that_touch_are_one():
    assert joined([(5.0, 6.0), (0.0, 4.0), (1.0, 2.0), (6.0, 7.0)]) == ((0.0, 4.0), (5.0, 7.0))


def test_what_is_common_to_intervals_and_what_is_left_of_them():
    some, others = [(0.0, 4.0), (5.0, 7.0)], [(1.0, 2.0), (3.0, 6.0)]
    assert common(some, others) == ((1.0, 2.0), (3.0, 4.0), (5.0, 6.0))
    assert without(some, others) == ((0.0, 1.0), (2.0, 3.0), (6.0, 7.0))
