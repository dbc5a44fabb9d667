"""The mean of the evidence over places: against what many places have, where the places looked at are few."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import qmc

from skred.diagnosis.compare.over_places import Area, over_places
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.spec import Shape

SETTING: Any = SimpleNamespace(recorded_m=(300.0, 900.0))


def rows(*lengths: float) -> list[Shape]:
    """Stretches of some lengths, every 100 m."""
    return [Shape(end - length, end) for length in lengths for end in np.arange(400.0, 901.0, 100.0)]


def mean_over(area: Area, height: Any, shapes: list[Shape]) -> float:
    heights = np.array([height(*one) for one in area.within(shapes)])
    found = over_places(area, shapes, heights)
    mean = float(np.logaddexp.reduce(found.log_means))
    assert np.logaddexp.reduce(found.log_weights + heights) == pytest.approx(mean)
    return mean


@pytest.mark.parametrize("lengths", [(80.0,), (80.0, 200.0)])
def test_where_all_places_have_the_same_evidence_so_has_their_mean(lengths: tuple[float, ...]) -> None:
    shapes = rows(*lengths)
    area = Area.around(shapes, SETTING)
    assert mean_over(area, lambda end, length: 7.0, shapes) == pytest.approx(7.0)
    assert mean_over(area, lambda end, length: 7.0, shapes[:1]) == pytest.approx(7.0)


@pytest.mark.parametrize(("by_end", "by_length"), [(3.0, -2.0), (40.0, 25.0), (-90.0, 0.0)])
def test_evidence_that_is_linear_is_integrated_exactly(by_end: float, by_length: float) -> None:
    """The corners of the area are looked at, too: nothing is continued beyond the outermost places."""
    area = Area.around(rows(80.0, 200.0), SETTING)
    shapes = [*rows(80.0, 200.0), *(area.shape(np.array(at)) for at in ((0, 0), (0, 1), (1, 0), (1, 1)))]

    def height(end: float, length: float) -> float:
        return by_end * end + by_length * length

    exact = sum(
        np.log(np.expm1(abs(by)) / abs(by)) - max(-by, 0.0) if by else 0.0 for by in (by_end, by_length)
    )
    assert mean_over(area, height, shapes) == pytest.approx(exact, abs=0.02)


def test_it_is_the_mean_of_what_lies_between_the_places() -> None:
    """Of a peak that the places are close to, and of one that goes on beyond what may be."""
    for centre in ((0.45, 0.5), (1.0, 0.2)):

        def height(end: float, length: float, of: tuple[float, float] = centre) -> float:
            return -0.5 * (((end - of[0]) / 0.2) ** 2 + ((length - of[1]) / 0.3) ** 2)

        area = Area.around(rows(80.0, 120.0, 200.0), SETTING)
        near = rows(60.0, 80.0, 98.0, 120.0, 155.0, 200.0, 260.0)
        shapes = [*near, *(Shape(one.s_from_m + 50.0, one.s_to_m + 50.0) for one in near)]  # type: ignore[operator]
        heights = [height(*at) for at in qmc.Sobol(2, rng=1).random(1 << 14)]
        exact = np.logaddexp.reduce(heights) - np.log(len(heights))
        assert mean_over(area, height, shapes) == pytest.approx(exact, abs=0.15)


def test_shapes_at_one_place_share_it() -> None:
    """Stretches that are opposed by more and by less: what they have is their mean, wherever they stand."""
    shapes = rows(80.0, 200.0)
    area = Area.around(shapes, SETTING)
    heights = np.zeros(len(shapes))
    alone = over_places(area, shapes, heights).log_means
    more = over_places(area, [*shapes, shapes[3]], np.append(heights, np.log(3.0))).log_means
    shared = np.logaddexp(more[3], more[-1])
    assert more[-1] - more[3] == pytest.approx(np.log(3.0))
    assert alone[3] < shared < alone[3] + np.log(2.0)  # of 1 and 3, and less than that between it and others


def test_a_place_that_is_far_below_all_others_adds_nothing() -> None:
    shapes = rows(80.0, 200.0)
    area = Area.around(shapes, SETTING)
    heights = np.where(np.arange(len(shapes)) == 4, -1e3, 50.0)
    found = over_places(area, shapes, heights)
    assert np.isfinite(found).all() and found.log_means[4] < 45.0
    assert 48.0 < np.logaddexp.reduce(found.log_means) < 50.0


def test_weights_stay_near_the_truth_where_the_evidence_becomes_another_one() -> None:
    """Without some avalanches a peak is lower and wider."""

    def height(end: float, length: float, nats: float) -> float:
        return nats - nats * ((end - 0.5) ** 2 + (length - 0.5) ** 2)

    near = rows(60.0, 80.0, 98.0, 120.0, 155.0, 200.0, 260.0)
    shapes = [*near, *(Shape(one.s_from_m + 50.0, one.s_to_m + 50.0) for one in near)]  # type: ignore[operator]
    area = Area.around(rows(80.0, 120.0, 200.0), SETTING)
    many, few = (np.array([height(*at, nats) for at in area.within(shapes)]) for nats in (60.0, 10.0))
    weights = over_places(area, shapes, many).log_weights
    exact = np.logaddexp.reduce(over_places(area, shapes, few).log_means)
    assert np.logaddexp.reduce(weights + few) == pytest.approx(exact, abs=0.5)


def test_what_may_be_is_the_recorded_part_and_somewhat_longer_or_shorter() -> None:
    area = Area.around(rows(80.0, 200.0), SETTING)
    first, last = area.shape(np.zeros(2)), area.shape(np.ones(2))
    assert (first.s_to_m, last.s_to_m) == (300.0, 900.0)
    assert first.s_from_m == pytest.approx(300.0 - 80.0 * np.sqrt(80.0 / 200.0))
    assert last.s_from_m == pytest.approx(900.0 - 200.0 * np.sqrt(200.0 / 80.0))
    # Stretches that the track's beginning cuts off are no lengths of their own.
    cut = [*rows(80.0, 200.0), Shape(0.0, 60.0), Shape(0.0, 150.0)]
    assert Area.around(cut, SETTING).low[1] == pytest.approx(area.low[1])
    assert Area.around(cut, SETTING).high[1] == pytest.approx(area.high[1])


@pytest.mark.parametrize("recorded_m", [(199.0, 1187.42), (200.0, 1190.0), (113.0, 1486.5)])
def test_lengths_that_rounding_alone_tells_apart_are_one(recorded_m: tuple[float, float]) -> None:
    """All obstacles are as long: only where they stand is integrated over."""
    added = mechanisms()["obstacle"].added
    assert added is not None
    setting: Any = SimpleNamespace(recorded_m=recorded_m, terrain=SimpleNamespace(length_m=1900.0))
    shapes = [one for one in added.shapes(setting) if one.constants == (("J/gh [1]", 1.0),)]
    area = Area.around(shapes, setting)
    assert np.ptp([area.low[1], area.high[1]]) == pytest.approx(1.0)
    heights = np.array([-0.5 * ((one.place_m - 900.0) / 100.0) ** 2 for one in shapes])  # type: ignore[operator]
    exact = np.log(100.0 * np.sqrt(2.0 * np.pi) / (area.high[0] - area.low[0]))
    assert np.logaddexp.reduce(over_places(area, shapes, heights).log_means) == pytest.approx(exact, abs=0.05)
