"""Numbers for people, and what is none."""

import math

import pytest

from skred.report.shared.numbers import ABSENT, counted, fixed, is_number, rounded, share, three_digits


@pytest.mark.parametrize("value", [10**400, -(10**400), math.nan, math.inf, None, True, "1", []])
def test_what_is_no_finite_number_is_not_available(value):
    assert not is_number(value)
    assert {fixed(value), three_digits(value), share(value), rounded(value, 2)} == {ABSENT}


def test_things_are_counted():
    assert [counted(n, "avalanche") for n in (0, 1, 22)] == ["0 avalanches", "1 avalanche", "22 avalanches"]
    assert counted(None, "sensor") == "n/a sensors"
