"""Bodies that roll out on level ground behind a ramp, in closed form: friction, and a drag with U^2."""

from __future__ import annotations

import numpy as np

from skred.campaign import Campaign, Event, Sensor, Status, Track

G_M_S2 = 9.81
"""Standard gravity to the digits that matter here."""
STEEP = np.pi / 6.0
"""Angle of the ramp."""
RAMP_M, LEVEL_M, RELEASE_M = 100.0, 900.0, 20.0
"""Lengths of ramp and level ground, and from where the bodies start, on the ramp."""
PLACES_M = (140.0, 290.0, 440.0, 590.0, 740.0, 840.0)


WAVE_M = 400.0
"""Length of the waves of the level ground, if there are any."""


def speed(
    s: float, release: float, friction: float, drag: float, waves: float = 0.0, lossless: bool = False
) -> float:
    """Front speed [m/s]: dv/ds = 2 g (sin(phi) - friction cos(phi)) - 2 drag v on ramp and level ground.

    On a lossless ramp nothing retards: it is made up, to give bodies the speed that they came with.
    """
    if lossless:
        v = 2.0 * G_M_S2 * np.sin(STEEP) * (RAMP_M - release)
        return after_waves(v, s - RAMP_M, friction, drag, waves)
    end = G_M_S2 * (np.sin(STEEP) - friction * np.cos(STEEP)) / drag
    v = end * (1.0 - np.exp(-2.0 * drag * (RAMP_M - release)))
    return after_waves(v, s - RAMP_M, friction, drag, waves)


def after_waves(v: float, x: float, friction: float, drag: float, waves: float) -> float:
    """Front speed [m/s] at x on level ground that begins with v = U^2.

    Waves add -2 waves sin(2 pi x / 400 m).
    """
    end, decay, turn = -G_M_S2 * friction / drag, 2.0 * drag, 2.0 * np.pi / WAVE_M
    by_waves = (decay * np.sin(turn * x) - turn * np.cos(turn * x) + turn * np.exp(-decay * x)) * (
        -2.0 * waves / (decay**2 + turn**2)
    )
    return float(np.sqrt(max(end + (v - end) * np.exp(-decay * x) + by_waves, 0.0)))


def entering(drag: float, waves: float, n_events: int = 14, seed: int = 2) -> Campaign:
    """The same bodies on level ground alone, their speed stated where it begins."""
    rng = np.random.default_rng(seed)
    entry = 26.0 + 0.5 * rng.standard_normal(n_events)
    frictions = 0.006 * np.exp(0.1 * rng.standard_normal(n_events))
    places = np.arange(50.0, 801.0, 75.0)
    values = np.array(
        [
            [after_waves(v0**2, x, mu, drag, waves) for x in places]
            for v0, mu in zip(entry, frictions, strict=True)
        ]
    )
    values += 0.1 * rng.standard_normal(values.shape)
    stated = entry + 0.1 * rng.standard_normal(n_events)
    along = np.arange(0.0, LEVEL_M + 1.0, 10.0)
    return Campaign(
        name="entering",
        description="bodies rolling out from a speed that is stated",
        source="closed form",
        origin="simulated",
        reference_s_m=None,
        track=Track(along, np.zeros_like(along)),
        sensors=tuple(
            Sensor(f"s{k}", "front_velocity", place, place, relative_sd=0.0, absolute_sd=0.1)
            for k, place in enumerate(places)
        ),
        events=tuple(
            Event(f"run{k:02d}", 0.0, None, {}, release_speed_m_s=v0, release_speed_sd_m_s=0.1)
            for k, v0 in enumerate(stated)
        ),
        values=values,
        status=np.full(values.shape, int(Status.OBSERVED), dtype=np.int8),
        stated_sd=np.full(values.shape, np.nan),
    )


def rolling(
    drag: float,
    n_events: int = 20,
    friction: float = 0.006,
    seed: int = 1,
    waves: float = 0.0,
    lossless: bool = False,
) -> Campaign:
    """Runs of bodies whose friction and releases vary, read at six places to 0.1 m/s."""
    rng = np.random.default_rng(seed)
    frictions = friction * np.exp(0.1 * rng.standard_normal(n_events))
    releases = RELEASE_M + 2.0 * rng.standard_normal(n_events)
    values = np.array(
        [
            [speed(s, release, mu, drag, waves, lossless) for s in PLACES_M]
            for mu, release in zip(frictions, releases, strict=True)
        ]
    )
    values += 0.1 * rng.standard_normal(values.shape)
    x = np.array([0.0, RAMP_M * np.cos(STEEP), RAMP_M * np.cos(STEEP) + LEVEL_M])
    z = np.array([RAMP_M * np.sin(STEEP), 0.0, 0.0])
    along = np.unique(np.concatenate([np.linspace(0.0, x[1], 21), np.linspace(x[1], x[2], 91)]))
    sensors = tuple(
        Sensor(f"s{k}", "front_velocity", place, place, relative_sd=0.0, absolute_sd=0.1)
        for k, place in enumerate(PLACES_M)
    )
    events = tuple(
        Event(f"run{k:02d}", release_s_m=RELEASE_M, release_sd_m=2.0, covariates={}) for k in range(n_events)
    )
    return Campaign(
        name="rolling",
        description="bodies rolling out",
        source="closed form",
        origin="simulated",
        reference_s_m=None,
        track=Track(along, np.interp(along, x, z)),
        sensors=sensors,
        events=events,
        values=values,
        status=np.full(values.shape, int(Status.OBSERVED), dtype=np.int8),
        stated_sd=np.full(values.shape, np.nan),
    )
