"""The error models' numbers, and recordings as they read them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from error_cases import standardised_errors, within_binomial_limits
from numpy.testing import assert_allclose, assert_array_equal

from skred.campaign import Campaign, Sensor, Status, find_campaign, read_campaign
from skred.inference.error_model import ERROR_MODELS, event_readings, fronts_seen

CAMPAIGN = read_campaign(find_campaign("ryggfonn"))


@pytest.mark.parametrize("name", ERROR_MODELS)
def test_every_mixture_is_one(name: str) -> None:
    model = ERROR_MODELS[name]
    errors = model.errors
    assert model.id == name and len(errors.weights) == len(errors.scales) == len(errors.shares)
    assert_allclose(errors.weights.sum(), 1.0, rtol=1e-12)
    assert np.all(errors.weights > 0) and np.all(errors.scales > 0)
    assert np.all((errors.shares >= 0) & (errors.shares < 0.1))
    assert_allclose(np.exp(errors.log_weights), errors.weights, rtol=1e-12)
    assert_allclose(np.exp(errors.log_scales), errors.scales, rtol=1e-12)
    assert errors.degrees >= 0 and 0 <= errors.common < 1


def test_factor_of_the_scaled_errors_is_log_normal() -> None:
    """Moments E[factor^k] = exp(k^2 / 8) of a log standard deviation of 0.5."""
    weights, scales, *_ = ERROR_MODELS["scaled"].errors
    for k in (-2, -1, 1, 2, 3):
        assert_allclose(weights @ scales**k, np.exp(0.125 * k**2), rtol=5e-3)
    assert_allclose(weights @ np.log(scales) ** 2, 0.25, rtol=1e-3)


def with_a_span() -> Campaign:
    """Four events, three gates of which the second is a span, and the runout."""
    rows = [CAMPAIGN.event_ids.index(name) for name in ("19970208", "19920311", "19831031", "19970417")]
    sensors = list(CAMPAIGN.sensors)
    sensors[1] = Sensor("gate", "front_velocity", 1750.0, 1850.0, 0.2, 0.5)
    stated = np.array(CAMPAIGN.stated_sd[rows])
    stated[0, 0] = 3.5
    return replace(
        CAMPAIGN,
        sensors=tuple(sensors),
        events=tuple(CAMPAIGN.events[row] for row in rows),
        values=CAMPAIGN.values[rows],
        status=CAMPAIGN.status[rows],
        stated_sd=stated,
    )


def test_readings_are_what_the_campaign_says() -> None:
    campaign = with_a_span()
    readings = event_readings(campaign, place_sd_m=5.0)
    assert_array_equal(readings.observed, campaign.status == Status.OBSERVED)
    assert_array_equal(readings.values[0], [45.0, 43.0, 40.0, 2135.0])
    assert np.all(readings.values[~readings.observed] == 0.0)
    assert_allclose(readings.stated_sd[0], [3.5, 0.0, 0.0, 22.9])
    assert_allclose(readings.stated_sd[2], [0.0, 0.0, 0.0, 12.0])
    assert_allclose(readings.relative_sd, [0.1, 0.2, 0.1, 0.0])
    assert_allclose(readings.absolute_sd, [1.0, 0.5, 1.0, 12.0])
    assert_array_equal(readings.is_velocity, [True, True, True, False])
    assert readings.place_sd == 5.0
    assert all(np.all(np.isfinite(getattr(readings, name))) for name in ("values", "stated_sd"))


def test_where_a_front_stopped() -> None:
    """A speed above 0 was reached, to the end of its span; a speed of 0 tells nothing."""
    campaign = with_a_span()
    readings = event_readings(campaign)
    # 19970208: past the last gate. 19920311: 0 at the first, not at the span. 19970417: 0 at the last.
    assert_array_equal(readings.reached, [1910.0, -np.inf, -np.inf, 1850.0])
    assert_array_equal(readings.not_reached, [np.inf, 1850.0, np.inf, np.inf])
    passed = campaign.sensors[0]
    last = replace(campaign, sensors=(replace(passed, s_from_m=500.0, s_to_m=600.0), *campaign.sensors[1:]))
    assert event_readings(last).reached[3] == 1850.0


def test_a_span_above_the_end_of_which_a_front_stopped_was_read_up_to_its_stop() -> None:
    """As the format allows it: over a span that begins above a stop, or above a sensor not reached.

    By a runout, an upper bound of one or the lower of two, and by a point where the front was read to stand;
    not by a lower bound, and not where it stopped at the end itself.
    """
    point, runout = CAMPAIGN.sensors[0], CAMPAIGN.sensors[-1]
    sensors = (
        replace(point, id="span", s_from_m=180.0, s_to_m=260.0),
        replace(point, id="point", s_from_m=200.0, s_to_m=200.0),
        runout,
        replace(runout, id="again"),
    )
    none, stop, see = np.nan, Status.NOT_REACHED, Status.OBSERVED
    rows: list[tuple[list[float], list[int], float]] = [
        ([9.0, none, none, none], [see, stop, Status.MISSING, Status.MISSING], 180.0),
        ([9.0, 8.0, none, none], [see, see, Status.MISSING, Status.MISSING], 260.0),
        ([9.0, 0.0, none, none], [see, see, Status.MISSING, Status.MISSING], 180.0),
        ([9.0, none, 250.0, none], [see, Status.MISSING, see, Status.MISSING], 180.0),
        ([9.0, none, 260.0, none], [see, Status.MISSING, see, Status.MISSING], 260.0),
        ([9.0, none, 300.0, 240.0], [see, Status.MISSING, see, see], 180.0),
        ([9.0, none, 250.0, none], [see, Status.MISSING, Status.AT_MOST, Status.MISSING], 180.0),
        ([9.0, none, 250.0, none], [see, Status.MISSING, Status.AT_LEAST, Status.MISSING], 260.0),
        ([0.0, 8.0, none, none], [see, see, Status.MISSING, Status.MISSING], 200.0),
    ]
    campaign = replace(
        CAMPAIGN,
        sensors=sensors,
        events=tuple(replace(CAMPAIGN.events[0], id=f"e{k}") for k in range(len(rows))),
        values=np.array([row[0] for row in rows]),
        status=np.array([row[1] for row in rows]),
        stated_sd=np.full((len(rows), 4), np.nan),
        values_to=np.empty(0),
    )
    readings = event_readings(campaign)
    assert_array_equal(readings.reached, [row[2] for row in rows])
    assert_array_equal(readings.not_reached, [200.0, *[np.inf] * (len(rows) - 1)])
    some = fronts_seen(campaign).take(np.array([4, 3]))
    assert_array_equal(some.between()[0], [260.0, 180.0])


def test_readings_in_any_order_of_sensors() -> None:
    campaign = with_a_span()
    order = [3, 2, 0, 1]
    other = replace(
        campaign,
        sensors=tuple(campaign.sensors[j] for j in order),
        values=campaign.values[:, order],
        status=campaign.status[:, order],
        stated_sd=campaign.stated_sd[:, order],
    )
    one, two = event_readings(campaign), event_readings(other)
    assert_array_equal(one.reached, two.reached)
    assert_array_equal(one.not_reached, two.not_reached)
    assert_array_equal(one.values[:, order], two.values)
    assert_array_equal(one.is_velocity[order], two.is_velocity)


@pytest.mark.parametrize("name", ERROR_MODELS)
def test_drawn_readings_cover(name: str) -> None:
    """90 % intervals of drawn readings hold 90 % of readings that another route simulates."""
    is_velocity, front = np.array([True, True, False]), np.array([40.0, 25.0, 2100.0])
    sd, rng, n = np.array([4.0, 3.0, 12.0]), np.random.default_rng(11), 4000
    drawn = ERROR_MODELS[name].draw(np.tile(front, (200_000, 1)), sd, is_velocity, rng)
    low, high = np.quantile(drawn, [0.05, 0.95], axis=0)
    z = standardised_errors(name, is_velocity, len(drawn), rng)
    readings = front + sd * z[:n]
    for covered in ((low <= readings) & (readings <= high)).T:
        assert within_binomial_limits(covered)
    if name != "student":  # its fourth moment is infinite
        assert_allclose(np.cov(((drawn - front) / sd).T), np.cov(z.T), atol=0.05)


def test_a_reading_s_own_error_goes_before_its_sensor_s() -> None:
    readings = event_readings(with_a_span())
    fronts = np.full((2, 4), 30.0)
    assert_allclose(readings.sensor_sd(fronts)[0], np.hypot([3.0, 6.0, 3.0, 0.0], [1.0, 0.5, 1.0, 12.0]))
    assert_allclose(readings.sd(0, fronts)[1, [0, 1, 3]], [3.5, np.hypot(6.0, 0.5), 22.9])
    assert_array_equal(readings.sd(np.array([0, 2]), fronts), [readings.sd(k, fronts)[0] for k in (0, 2)])
