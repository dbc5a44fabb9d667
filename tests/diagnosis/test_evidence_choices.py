"""What a comparison's choices cost: the draws of place and length, against an integral that is known."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

from benchmarks.choices import places
from skred.diagnosis.compare.over_places import Area
from skred.physics.mechanisms.spec import Shape

SETTING: Any = SimpleNamespace(recorded_m=(100.0, 900.0))


def of_length(length: float) -> Any:
    return SimpleNamespace(mechanism=None, shape=Shape(100.0, 100.0 + length))


@pytest.mark.parametrize(("centre", "sd"), [((0.3, 0.6), (0.2, 0.3)), ((0.71, 0.42), (0.02, 0.05))])
def test_draws_of_place_and_length_find_a_normal_peak(
    centre: tuple[float, float], sd: tuple[float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Wide or narrow, and cut off at the edges of what may be."""

    def heights(base: Any, mechanism: Any, points: np.ndarray, area: Area) -> np.ndarray:
        return 40.0 + norm.logpdf(points, centre, sd).sum(axis=1)

    monkeypatch.setattr(places, "heights", heights)
    own = [of_length(75.0), of_length(200.0), of_length(500.0)]
    base: Any = SimpleNamespace(setting=SETTING)
    found, error, effective, n = places.by_draws(base, own, np.random.default_rng(1))
    inside = np.prod(norm.cdf(1.0, centre, sd) - norm.cdf(0.0, centre, sd))
    assert found == pytest.approx(40.0 + math.log(inside), abs=4.0 * error) and error < 0.2
    assert effective > 30.0 and n == 448
