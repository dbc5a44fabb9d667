"""What a comparison's choices cost: the draws of place and length, against an integral that is known."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

from benchmarks.choices import places
from skred.physics.mechanisms.spec import Shape


def of_length(length: float) -> Any:
    return SimpleNamespace(mechanism=None, shape=Shape(100.0, 100.0 + length))


def test_lengths_stand_for_what_is_half_way_to_the_next() -> None:
    low, high = places.range_of([75.0, 200.0, 500.0])
    assert math.exp(low) == pytest.approx(75.0 * math.sqrt(75.0 / 200.0))
    assert math.exp(high) == pytest.approx(500.0 * math.sqrt(500.0 / 200.0))


@pytest.mark.parametrize(("centre", "sd"), [((0.3, 0.6), (0.2, 0.3)), ((0.71, 0.42), (0.02, 0.05))])
def test_draws_of_place_and_length_find_a_normal_peak(
    centre: tuple[float, float], sd: tuple[float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Wide or narrow, and cut off at the edges of what may be."""

    def heights(base: Any, mechanism: Any, points: np.ndarray, low: float, high: float) -> np.ndarray:
        return 40.0 + norm.logpdf(points, centre, sd).sum(axis=1)

    monkeypatch.setattr(places, "heights", heights)
    own = [of_length(75.0), of_length(200.0), of_length(500.0)]
    found, error, effective, n = places.by_draws(None, own, np.random.default_rng(1))  # type: ignore[arg-type]
    inside = np.prod(norm.cdf(1.0, centre, sd) - norm.cdf(0.0, centre, sd))
    assert found == pytest.approx(40.0 + math.log(inside), abs=4.0 * error) and error < 0.2
    assert effective > 30.0 and n == 448
