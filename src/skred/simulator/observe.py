"""Turn exact readings into what a campaign would hold: errors, gaps, stops above sensors, nasty habits."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from skred.arrays import FloatArray
from skred.campaign import Campaign, Event, Sensor, Status, Track
from skred.campaign.order_rules import LARGEST_SDS
from skred.simulator.fitting import predict
from skred.simulator.strength import Truth

NASTY = ("heavy_tails", "correlated_errors", "odd_event", "outlying_readings")
HEAVY_TAIL_SCALE = 0.8
"""Of Student's t with three degrees of freedom: its standard deviation is 1.4 times the stated one."""


def _deviations(rng: np.random.Generator, shape: tuple[int, int], nasty: str | None) -> FloatArray:
    """Errors in units of the stated standard deviation."""
    if nasty == "heavy_tails":
        return HEAVY_TAIL_SCALE * rng.standard_t(3.0, shape)
    white = rng.standard_normal(shape)
    if nasty == "correlated_errors":
        share = rng.uniform(0.4, 0.7)
        common = rng.standard_normal((shape[0], 1))
        white[:, :-1] = np.sqrt(share) * common + np.sqrt(1.0 - share) * white[:, :-1]
    if nasty == "outlying_readings":
        n = int(rng.integers(2, 5))
        at = rng.choice(white.size, n, replace=False)
        white.flat[at] += rng.choice([-1.0, 1.0], n) * rng.uniform(5.0, 9.0, n)
    return white


def _odd_theta(rng: np.random.Generator, truth: Truth) -> tuple[FloatArray, int]:
    """Latent parameters with one event far off; it still stops on the track."""
    ground = truth.scene.setting.ground
    for _ in range(50):
        theta, event = truth.theta, int(rng.integers(truth.scene.n_events))
        off = rng.uniform(4.0, 6.0) * np.maximum(truth.scene.spread, 0.08)
        theta[event, : len(off)] += rng.choice([-1.0, 1.0], len(off)) * off
        runout = predict(truth.scene.setting, theta, truth.hidden)[0][event, -1]
        if truth.scene.place(0.25) < runout < ground.length_m - 60.0:
            return theta, event
    return truth.theta, -1


def _sensors(truth: Truth) -> tuple[Sensor, ...]:
    """The campaign's sensors."""
    setting = truth.scene.setting
    to_campaign, places = setting.ground.to_campaign, setting.sensors
    from_m, to_m = (np.round(to_campaign(s), 1) for s in (places.s_from_m, places.s_to_m))
    word = "gate" if len(from_m) > 10 else "v"
    speeds = [
        Sensor(
            f"{word}{j + 1:02d}", "front_velocity", float(from_m[j]), float(to_m[j]),
            float(setting.relative_sd[j]), float(setting.absolute_sd[j]),
        )
        for j in range(len(from_m))
    ]  # fmt: skip
    return (*speeds, Sensor("runout", "runout", np.nan, np.nan, 0.0, float(setting.absolute_sd[-1])))


def _events(truth: Truth) -> tuple[Event, ...]:
    """The campaign's events."""
    setting = truth.scene.setting
    noted = np.round(setting.ground.to_campaign(setting.releases_m), 1)
    sd = setting.release_sd_m if setting.release_sd_m > 0 else None
    return tuple(
        Event(
            f"e{i + 1:02d}",
            float(noted[i]),
            sd,
            {name: float(values[i]) for name, values in truth.scene.covariates.items()},
        )
        for i in range(truth.scene.n_events)
    )


def _without_contradictions(
    values: FloatArray, status: NDArray[np.int8], sensors: tuple[Sensor, ...]
) -> NDArray[np.int8]:
    """Statuses without runouts so far above a place where the front moved that no campaign may hold them.

    Whoever records them sees that they are wrong, and writes that they are missing. They are rare: one in a
    thousand outlying readings.
    """
    places = np.array([sensor.s_from_m for sensor in sensors[:-1]])
    moving = (status[:, :-1] == Status.OBSERVED) & (values[:, :-1] > 0.0)
    lowest = np.where(moving, places, -np.inf).max(axis=1)
    sd = np.hypot(sensors[-1].relative_sd * values[:, -1], sensors[-1].absolute_sd)
    kept = status.copy()
    kept[values[:, -1] + LARGEST_SDS * sd < lowest, -1] = Status.MISSING
    return kept


def observe(rng: np.random.Generator, truth: Truth, nasty: str | None) -> tuple[Campaign, dict[str, Any]]:
    """Record a trial's avalanches.

    Parameters
    ----------
    rng : numpy.random.Generator
        Where chance comes from.
    truth : Truth
        The avalanches.
    nasty : str, optional
        One of `NASTY`.

    Returns
    -------
    campaign : Campaign
        What a diagnosis sees.
    facts : dict
        Exact readings, true parameters and what is odd, for the truth's record.
    """
    setting, ground = truth.scene.setting, truth.scene.setting.ground
    theta, odd = _odd_theta(rng, truth) if nasty == "odd_event" else (truth.theta, -1)
    exact, reached = predict(setting, theta, truth.hidden)
    exact[:, -1] = ground.to_campaign(exact[:, -1])
    sd = np.hypot(setting.relative_sd * exact, setting.absolute_sd)
    values = exact + sd * _deviations(rng, exact.shape, nasty)
    values[:, :-1] = np.round(np.maximum(values[:, :-1], 0.0), 2)
    values[:, -1] = np.round(np.clip(values[:, -1], 0.0, np.floor(ground.polyline_s_m[-1])), 1)
    status = np.where(reached, Status.OBSERVED, Status.NOT_REACHED)
    status = np.where(setting.recorded, status, Status.MISSING).astype(np.int8)
    sensors = _sensors(truth)
    status = _without_contradictions(values, status, sensors)
    values = np.where(status == Status.OBSERVED, values, np.nan)
    letters = "".join(rng.choice(list("abcdefghijklmnopqrstuvwxyz"), 6))
    n_speeds = exact.shape[1] - 1
    campaign = Campaign(
        name=f"path-{letters}",
        description=f"Simulated avalanches on one path: {n_speeds} front speeds and the runout.",
        source="skred.trials",  # sealed as this: it stays where the room moves
        origin="simulated",
        reference_s_m=None,
        track=Track(ground.track_x_m, ground.track_z_m),
        sensors=sensors,
        events=_events(truth),
        values=values,
        status=status,
        stated_sd=np.full(values.shape, np.nan),
    )
    facts = {
        "odd_event": None if odd < 0 else f"e{odd + 1:02d}",
        "log_base_parameters": theta[:, : len(truth.scene.median)].tolist(),
        "exact_readings": np.round(exact, 3).tolist(),
        "peak_exact_m_s": float(exact[:, :-1].max()),
    }
    return campaign, facts
