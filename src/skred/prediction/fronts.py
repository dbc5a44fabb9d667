"""New avalanches from many populations on one track, stored as counts and sums.

All populations use the same points of a unit cube (common random numbers), a scrambled Sobol sequence, so
that only the populations differ. Two halves are scrambled independently; their difference gives the error of
the simulation.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from skred.arrays import FloatArray, IntArray
from skred.inference.hierarchical.releases import Releases
from skred.physics.geometry import path_of, sensor_table
from skred.physics.kernel.columns import GRAVITY
from skred.physics.kernel.fronts import simulate
from skred.physics.terrain import Terrain
from skred.prediction.terms import Motion

SPEED_STEP_M_S = 0.5
"""Speeds are counted in steps: exact for probabilities of exceeding a multiple of it."""
HALVES = 2
MOST_AVALANCHES = 2**15
_ROOM = 1.5
"""Factor on the speed of a free fall where what was added may push."""
_LEAST_STEPS = 3
"""Least number of speeds counted: up to 1 m/s."""
_EDGE = 2.0**-32
"""Points of the cube keep this far from its faces, where a normal variable is infinite."""


class NewFronts(NamedTuple):
    """New avalanches by population, and the places where they are observed.

    Attributes
    ----------
    places : (n_places,) array, m
        Increasing, the last one the track's end.
    exceeding : (n_populations, n_places, n_steps) integer array
        How many avalanches are faster than step times `SPEED_STEP_M_S` there.
    exceeding_by_half : (2, n_places, n_steps) integer array
        The same over all populations, by half of the avalanches.
    passing : (2, n_populations, n_places) array
        How many avalanches come through.
    total, square : (2, n_populations, n_places) arrays, m/s and m2/s2
        Sums of their speeds and of the squares.
    runout : (n_populations, n_avalanches) array, m
        The first half of the avalanches first; the track's end for those that reach it.
    release : (n_avalanches,) array, m
    kept : (n_populations, n_avalanches, n_kept) array, m/s
        Speed of each avalanche at the places that are kept, NaN where it does not come through.
    """

    places: FloatArray
    exceeding: NDArray[np.uint16]
    exceeding_by_half: IntArray
    passing: FloatArray
    total: FloatArray
    square: FloatArray
    runout: FloatArray
    release: FloatArray
    kept: FloatArray

    @property
    def n_avalanches(self) -> int:
        """Avalanches for each population."""
        return len(self.release)


def new_fronts(
    motion: Motion,
    populations: tuple[FloatArray, FloatArray],
    terrain: Terrain,
    releases: Releases,
    places: FloatArray,
    n_avalanches: int,
    seed: int,
    *,
    weights: FloatArray | None = None,
    kept: Sequence[int] = (),
) -> NewFronts:
    """Simulate new avalanches.

    Parameters
    ----------
    motion : Motion
        The law with what is added to it; its strengths for each population.
    populations : (n, n_strengths) and (n, n_strengths, n_strengths) arrays
        Means and factors as `skred.inference.hierarchical.population.population_of` gives them.
    terrain : Terrain
    releases : Releases
        An avalanche starts from any of them.
    places : (n_places,) array, m
        Increasing, the last one the track's end.
    n_avalanches : int
        For each population: a power of 2 from 4 to 32 768.
    seed : int
    weights : (n_releases,) array, optional
        How likely an avalanche is to start from each; by default all are as likely.
    kept : sequence of int
        Numbers of the places at which the speed of each avalanche is kept.
    """
    means, factors = populations
    if n_avalanches.bit_count() != 1 or not 4 <= n_avalanches <= MOST_AVALANCHES:
        raise ValueError(
            f"expected a power of 2 from 4 to {MOST_AVALANCHES} avalanches, found {n_avalanches}"
        )
    drawn = _draws(means.shape[1], releases, n_avalanches, seed, weights, apart=motion.differs_by_release)
    path = path_of(terrain)
    sensors = sensor_table([*((s, s) for s in places.tolist()), None])
    n, n_places = len(means), len(places)
    n_steps = _n_steps(terrain, drawn.speed, _ROOM if motion.terms else 1.0)
    exceeding = np.empty((n, n_places, n_steps), dtype=np.uint16)
    by_half = np.zeros((HALVES, n_places, n_steps), dtype=np.int64)
    sums = np.empty((3, HALVES, n, n_places))
    runout, speeds_kept = np.empty((n, n_avalanches)), np.empty((n, n_avalanches, len(kept)))
    for k in range(n):
        logs = means[k] + drawn.normal @ factors[k].T
        strengths, release = motion.strengths(k, logs, drawn.event), motion.release(k, drawn.place, terrain)
        readings = simulate(strengths, release, path, motion.contributions, sensors, drawn.speed)
        speeds, runout[k] = readings[:, :-1], readings[:, -1]
        started = release[:, None] <= places
        stop = runout[k][:, None]
        through = started & ((stop > places) | (stop >= terrain.length_m))
        for number, part in enumerate((through, speeds, speeds**2)):
            sums[number, :, k] = part.reshape(HALVES, -1, n_places).sum(axis=1)
        counts = np.stack([_faster(half, n_steps) for half in speeds.reshape(HALVES, -1, n_places)])
        by_half += counts
        exceeding[k] = counts.sum(axis=0)
        speeds_kept[k] = np.where(through[:, kept], speeds[:, kept], np.nan) if len(kept) else 0.0
    used = max(_LEAST_STEPS, int(np.count_nonzero(by_half.any(axis=(0, 1)))) + 1)
    passing, total, square = sums
    counted = exceeding[..., :used], by_half[..., :used]
    return NewFronts(places, *counted, passing, total, square, runout, drawn.place, speeds_kept)


def _faster(speeds: FloatArray, n_steps: int) -> IntArray:
    """Number of avalanches faster than each step, (n_avalanches, n_places) to (n_places, n_steps)."""
    n_places = speeds.shape[1]
    step = np.minimum(np.ceil(speeds / SPEED_STEP_M_S).astype(np.int64), n_steps - 1)
    step += n_steps * np.arange(n_places)
    counts = np.bincount(step.ravel(), minlength=n_places * n_steps).reshape(n_places, n_steps)
    return len(speeds) - counts.cumsum(axis=1)


def _n_steps(terrain: Terrain, begin: FloatArray, room: float) -> int:
    """Steps up to the speed of a free fall down all that goes down, from the fastest start, times `room`."""
    fall = float(np.maximum(terrain.sin_slope, 0.0) @ np.diff(terrain.edge_s_m))
    return int(np.ceil(room * np.sqrt(2.0 * GRAVITY * fall + begin.max() ** 2) / SPEED_STEP_M_S)) + 2


class _Drawn(NamedTuple):
    """Standard normal variables (n_avalanches, n_strengths), number of the release, place and speed there."""

    normal: FloatArray
    event: IntArray
    place: FloatArray
    speed: FloatArray


def _draws(
    n_strengths: int,
    releases: Releases,
    n_avalanches: int,
    seed: int,
    weights: FloatArray | None,
    *,
    apart: bool,
) -> _Drawn:
    """New avalanches before they start; `apart` where releases differ in more than place and speed."""
    # Here, because it takes a third of a second.
    from scipy.stats import qmc

    each = releases.mean, releases.sd, releases.speed, releases.speed_sd
    same = not apart and all(np.ptp(values) == 0.0 for values in each)
    certain = not releases.uncertain.any()
    rng = np.random.default_rng([seed, 7])
    n_axes = n_strengths + (not same) + (not certain)
    exponent = (n_avalanches // HALVES).bit_length() - 1
    halves = [qmc.Sobol(n_axes, scramble=True, rng=rng).random_base2(exponent) for _ in range(HALVES)]
    points = np.clip(np.concatenate(halves), _EDGE, 1.0 - _EDGE)
    event = np.zeros(n_avalanches, dtype=np.int64)
    if not same:
        event = _chosen(points[:, n_strengths], len(releases.mean), weights)
    # Cut off at the same limits as in the likelihood.
    deviation = np.zeros(n_avalanches) if certain else releases.drawn(event, points[:, -1])
    begin = releases.places(event, deviation), releases.speeds(event, deviation)
    return _Drawn(ndtri(points[:, :n_strengths]), event, *begin)


def _chosen(uniform: FloatArray, n: int, weights: FloatArray | None) -> IntArray:
    """One of n, by weights or each as likely."""
    if weights is None:
        return (uniform * n).astype(np.int64)
    ends = np.cumsum(weights) / np.sum(weights)
    return np.minimum(np.searchsorted(ends, uniform, side="right"), n - 1)
