"""Further avalanches of a trial: the trial stays what it was, and they are what its avalanches are."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from skred.campaign import Campaign, Status, read_campaign, write_campaign
from skred.simulator.draw import Trial, draw_trial
from skred.simulator.fresh import N_FRESH, draw_fresh, draw_further
from skred.simulator.listed import Response

BEFORE = {
    (301, "sparse", "nothing", None): "4d44b8b24adebcb3",
    (302, "dense", "segment_drag", 6.0): "2efd754c7d1fe479",
    (303, "sparse", "covariate_friction", 6.0): "6268a773a80ed281",
    (21, "sparse", "masked", 5.0): "8db3cc2981904e5c",
    (305, "dense", "sensor_bias", 6.0): "6ce170d5e2c3abd6",
}
"""Fingerprints of campaigns as they were drawn before there were further avalanches."""


def trial(seed: int, kind: Any, hidden: str, snr: float | None = 6.0) -> Trial:
    return draw_trial(seed, kind=kind, hidden=hidden, snr=snr)


@pytest.mark.parametrize("key", BEFORE, ids=lambda key: key[2])
def test_a_seed_gives_the_campaign_that_it_always_gave(key: tuple[int, str, str, float | None]) -> None:
    """Whether further avalanches are drawn or not."""
    found = trial(*key)
    assert found.campaign.fingerprint().startswith(BEFORE[key])
    truth = dict(found.truth)
    check_fresh(found, found.fresh)
    assert found.campaign.fingerprint().startswith(BEFORE[key]) and found.truth == truth
    assert found.fresh.fingerprint() == draw_fresh(found.source).fingerprint()


def check_fresh(found: Trial, fresh: Campaign) -> None:
    """Twelve avalanches past the same sensors, none of them the trial's."""
    own = found.campaign
    assert fresh.n_events == N_FRESH == 12 and not set(fresh.event_ids) & set(own.event_ids)
    assert fresh.sensors == own.sensors and fresh.name == own.name
    assert np.array_equal(fresh.track.x_m, own.track.x_m) and np.array_equal(fresh.track.z_m, own.track.z_m)
    assert {*fresh.events[0].covariates} == {*own.events[0].covariates}
    releases = [event.release_s_m for event in own.events]
    assert all(min(releases) <= event.release_s_m <= max(releases) for event in fresh.events)
    assert fresh.events[0].release_sd_m == own.events[0].release_sd_m
    assert not np.isin(fresh.values[np.isfinite(fresh.values)], own.values).all()
    assert np.mean(fresh.status == Status.OBSERVED) > 0.4


def test_they_can_be_written_and_read(tmp_path: Any) -> None:
    fresh = trial(301, "sparse", "nothing").fresh
    write_campaign(fresh, tmp_path / "fresh")
    assert read_campaign(tmp_path / "fresh").fingerprint() == fresh.fingerprint()


def test_a_covariate_acts_on_them_as_on_the_trial() -> None:
    """By the trial's own scale: its response at their covariates, not one standardised anew."""
    found = trial(303, "sparse", "covariate_friction")
    truth = found.source.truth
    further = draw_further(np.random.default_rng(5), truth, N_FRESH)
    (effect,) = truth.effects
    name = effect.details["covariate"]
    own, order = truth.scene.covariates[name], np.argsort(truth.scene.covariates[name])
    inside = (further.scene.covariates[name] > own.min()) & (further.scene.covariates[name] < own.max())
    assert inside.sum() > 5
    between = np.interp(further.scene.covariates[name], own[order], truth.hidden.friction[order])
    np.testing.assert_allclose(further.hidden.friction[inside], between[inside], atol=0.02)
    again = effect.weigh(np.random.default_rng(0), truth.scene.covariates, truth.scene.n_events)
    assert np.array_equal(again, effect.weight)
    assert isinstance(effect.weigh, Response) and further.hidden.friction.std() > 0.01


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["sensor_bias", "sensor_place", "release_offset", "obstacle", "deposit_history"]
)
def test_what_is_hidden_acts_on_them_too(name: str) -> None:
    truth = trial(305, "dense", name).source.truth
    further = draw_further(np.random.default_rng(5), truth, N_FRESH)
    assert np.array_equal(further.hidden.factor, truth.hidden.factor)
    assert np.array_equal(further.hidden.shift_m, truth.hidden.shift_m)
    assert truth.hidden.shift_m.any() == (name == "sensor_place")
    assert further.hidden.release_m == truth.hidden.release_m
    assert further.hidden.terms.shape[1:] == truth.hidden.terms.shape[1:]
    strongest = np.abs(truth.hidden.terms[:, :, 1]).max(initial=0.0)
    assert np.all(np.abs(further.hidden.terms[:, :, 1]) <= strongest)
    if name == "deposit_history":  # in between the trial's avalanches: both signs
        assert further.hidden.terms[:, 0, 1].min() < 0.0 < further.hidden.terms[:, 0, 1].max()
    elif name == "obstacle":
        assert np.array_equal(further.hidden.terms[:, 0], np.tile(truth.hidden.terms[0, 0], (N_FRESH, 1)))


def test_they_come_from_the_same_population() -> None:
    truth = trial(301, "sparse", "nothing").source.truth
    theta = np.concatenate([draw_further(np.random.default_rng(k), truth, N_FRESH).theta for k in range(20)])
    k = len(truth.scene.median)
    np.testing.assert_allclose(
        theta[:, :k].mean(axis=0), np.log(truth.scene.median), atol=4.0 * truth.scene.spread.max() / 240**0.5
    )
    np.testing.assert_allclose(theta[:, :k].std(axis=0), truth.scene.spread, rtol=0.2)
