"""What can be checked without a posterior: the bowl, retardations, correlations, plain fits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skred.inference.pooled.problem import PooledProblem
from skred.physics.geometry import contributions_of
from skred.physics.kernel.columns import GRAVITY
from skred.physics.kernel.fronts import simulate
from skred.physics.mechanisms import Mechanism
from skred.physics.terrain import Terrain

FloatArray = NDArray[np.float64]
BELOW_BOWL_S_M = 1000.0
"""A front that gets here has passed the bowl: the track is steep again."""


def bisect(passes: Callable[[float], bool], low: float, high: float, tolerance: float = 1e-7) -> float:
    """Largest value that passes, where `low` does and `high` does not."""
    if not passes(low) or passes(high):
        raise ValueError(f"expected {low} to pass and {high} not to")
    while high - low > tolerance:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if passes(middle) else (low, middle)
    return low


def bowl_limit(
    problem: PooledProblem, mechanisms: Sequence[Mechanism], high: float, release_s_m: float
) -> tuple[float, FloatArray]:
    """Largest strength of a one-parameter law with which a front passes the bowl, and its readings."""

    def readings(strength: float) -> FloatArray:
        return response(problem, mechanisms, [strength], release_s_m)

    # The runout is the last sensor of the Ryggfonn campaigns.
    limit = bisect(lambda strength: bool(readings(strength)[-1] > BELOW_BOWL_S_M), 0.0, high)
    return limit, readings(limit)


def response(
    problem: PooledProblem, mechanisms: Sequence[Mechanism], strengths: Sequence[float], release_s_m: float
) -> FloatArray:
    """Readings of one front from a given place, (n_sensors,)."""
    law = contributions_of(mechanisms, problem.terrain)
    readings = simulate(
        np.array([strengths], float), np.array([float(release_s_m)]), problem.path, law, problem.sensors
    )
    return np.asarray(readings[0])


def start_for_limit(problem: PooledProblem, mechanisms: Sequence[Mechanism], strength: float) -> float:
    """Lowest start [m] above the bowl from which a front with this strength still passes it.

    Raises
    ------
    ValueError
        If it does not pass even from the top, or passes from everywhere above.
    """

    def passes(start_m: float) -> bool:
        return bool(response(problem, mechanisms, [strength], start_m)[-1] > BELOW_BOWL_S_M)

    return bisect(passes, 0.0, 0.5 * BELOW_BOWL_S_M, tolerance=0.01)


def start_for_runout(
    problem: PooledProblem, mechanisms: Sequence[Mechanism], strength: float, runout_s_m: float
) -> float:
    """Lowest place [m] in the bowl from which a front still gets as far as a given runout.

    Above the steep part of the bowl a lower start leaves less energy; NaN if none of the places above
    `BELOW_BOWL_S_M` / 2 is low enough.
    """
    starts = np.arange(0.0, 0.5 * BELOW_BOWL_S_M, 1.0)
    law = contributions_of(mechanisms, problem.terrain)
    runs = np.full((len(starts), 1), float(strength))
    reached = simulate(runs, starts, problem.path, law, problem.sensors)[:, -1]
    short = np.flatnonzero(reached < runout_s_m)
    return float(starts[short[0]]) if len(short) else float("nan")


def drop(terrain: Terrain, from_s_m: float, to_s_m: float) -> float:
    """Fall of the track between two places [m], positive downhill."""
    fall = np.concatenate([[0.0], np.cumsum(terrain.sin_slope * np.diff(terrain.edge_s_m))])
    upper, lower = np.interp([from_s_m, to_s_m], terrain.edge_s_m, fall)
    return float(lower - upper)


def mean_retardation(u_from: FloatArray, u_to: FloatArray, length_m: float, drop_m: float) -> FloatArray:
    """Mean a_ret [m/s²] over a stretch: (U_to^2 - U_from^2) / (2 length) - g drop / length.

    From dU^2 / (2 ds) = g sin(phi) + a_ret, integrated; negative where the front is retarded.
    """
    return np.asarray((u_to**2 - u_from**2) / (2.0 * length_m) - GRAVITY * drop_m / length_m)


@dataclass(frozen=True, eq=False)
class RecordedRetardation:
    """Mean retardation of each event between two sensors.

    Attributes
    ----------
    events : tuple of str
        Those with a reading at both.
    values, reading_sd : (n,) arrays, m/s²
        Mean a_ret, and what the stated errors of the two speeds make of it.
    length_m, drop_m : float
        Of the stretch.
    """

    events: tuple[str, ...]
    values: FloatArray
    reading_sd: FloatArray
    length_m: float
    drop_m: float

    @property
    def mean(self) -> float:
        """Mean over events."""
        return float(self.values.mean())

    @property
    def sd(self) -> float:
        """Standard deviation over events."""
        return float(self.values.std(ddof=1))

    def groups(self) -> tuple[list[str], list[str], float]:
        """Events on the two sides of the widest gap, strongest retardation first, and the gap's width."""
        order = np.argsort(self.values)
        gaps = np.diff(self.values[order])
        widest = int(np.argmax(gaps))
        names = [self.events[i] for i in order]
        return names[: widest + 1], names[widest + 1 :], float(gaps[widest])

    def mean_of(self, events: Sequence[str]) -> float:
        """Mean over some events."""
        return float(np.mean([v for e, v in zip(self.events, self.values, strict=True) if e in events]))


def recorded_retardation(
    problem: PooledProblem, upper: str, lower: str, shift_upper_m: float = 0.0, shift_lower_m: float = 0.0
) -> RecordedRetardation:
    """Mean retardation of each event from the recorded speeds at two point sensors.

    Parameters
    ----------
    problem : PooledProblem
    upper, lower : str
        Ids of the sensors.
    shift_upper_m, shift_lower_m : float
        Take them to stand this much further down the track.
    """
    campaign, ids = problem.campaign, problem.campaign.sensor_ids
    i, j = ids.index(upper), ids.index(lower)
    both = problem.observed[:, i] & problem.observed[:, j]
    place = [campaign.sensors[k].s_from_m + d for k, d in ((i, shift_upper_m), (j, shift_lower_m))]
    length_m, drop_m = place[1] - place[0], drop(problem.terrain, *place)
    u_from, u_to = problem.values[both, i], problem.values[both, j]
    sd = campaign.reading_sd()[both]
    error = np.hypot(u_from * sd[:, i], u_to * sd[:, j]) / length_m
    events = tuple(event for event, kept in zip(campaign.event_ids, both, strict=True) if kept)
    return RecordedRetardation(
        events, mean_retardation(u_from, u_to, length_m, drop_m), error, length_m, drop_m
    )


def modelled_retardation(
    problem: PooledProblem, mechanisms: Sequence[Mechanism], strengths: FloatArray, from_m: float, to_m: float
) -> FloatArray:
    """Mean a_ret [m/s²] of a law's front over a stretch, (n, n_strengths) to (n,).

    The same formula as for the recordings, so curvature counts as it does along the whole stretch and
    not at one cell, where it is mostly roughness.
    """
    edge = problem.terrain.edge_s_m
    i, j = np.searchsorted(edge, [from_m, to_m])
    speeds = problem.speeds(mechanisms, strengths, float(problem.releases[0]))
    return mean_retardation(
        speeds[:, i], speeds[:, j], float(edge[j] - edge[i]), drop(problem.terrain, edge[i], edge[j])
    )


def retardation_at(
    problem: PooledProblem, friction: float, drag: float, speed: float, place_m: float
) -> float:
    """-(mu max(0, g cos(phi) + kappa U^2) + D U^2) [m/s²] in the cell of one place."""
    terrain = problem.terrain
    i = int(np.searchsorted(terrain.edge_s_m, place_m, side="right")) - 1
    normal = max(0.0, GRAVITY * terrain.cos_slope[i] + terrain.curvature[i] * speed**2)
    return -(friction * normal + drag * speed**2)


def fit_means(
    problem: PooledProblem,
    mechanisms: Sequence[Mechanism],
    targets: FloatArray,
    weights: FloatArray,
    cells: int = 201,
) -> tuple[FloatArray, FloatArray]:
    """Least squares of the mean response against given means, by a grid that closes in.

    A grid, not a descent: a front that stops in the bowl makes the sum of squares jump.

    Parameters
    ----------
    targets, weights : (n_sensors,) arrays
        Means, and the weight of each squared difference; 0 leaves a sensor out.

    Returns
    -------
    strengths : (n_strengths,) array
    readings : (n_sensors,) array
    """
    scales = np.array([mechanism.strength.prior_scale for mechanism in mechanisms])
    low, high = np.zeros(len(scales)), 2.0 * scales
    for _ in range(6):
        axes = [np.linspace(a, b, cells) for a, b in zip(low, high, strict=True)]
        nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
        readings = problem.simulate(mechanisms, nodes).mean(axis=1)
        best = int(np.argmin(((readings - targets) ** 2 * weights).sum(axis=1)))
        width = 0.1 * (high - low)
        low, high = np.maximum(nodes[best] - width, 0.0), nodes[best] + width
    return nodes[best], np.asarray(readings[best])


def correlation(problem: PooledProblem) -> FloatArray:
    """Correlation of the recordings from Sigma, (n_sensors, n_sensors)."""
    sd = np.sqrt(np.diag(problem.covariance))
    return np.asarray(problem.covariance / np.outer(sd, sd))
