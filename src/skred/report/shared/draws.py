"""Posterior draws and recordings, as the figures want them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from skred.arrays import FloatArray
from skred.report.shared.labels import figure_text, unit_text
from skred.report.shared.style import tint

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

    from skred.campaign import Sensor
    from skred.report.shared.recordings import Recordings


INTERVAL = 0.9
"""Probability of the equal-tailed intervals in the figures."""
MAX_SENSORS = 12
"""Panels that stay legible in one figure."""


def chains_of(tree: xr.DataTree, name: str, group: str = "posterior") -> FloatArray:
    """Draws of a parameter, (n_chains, n_draws)."""
    values = tree[group].to_dataset()[name].transpose("chain", "draw").values
    return np.asarray(values, dtype=float)


def interval(values: ArrayLike, probability: float = INTERVAL) -> tuple[float, float]:
    """Equal-tailed interval of draws."""
    tail = (1.0 - probability) / 2.0
    low, high = np.quantile(np.asarray(values, dtype=float), [tail, 1.0 - tail])
    return float(low), float(high)


def density(values: ArrayLike, grid: FloatArray, *, lower: float | None = None) -> FloatArray:
    """Gaussian kernel density of draws on a grid.

    Parameters
    ----------
    values : (n,) array
    grid : (n_grid,) array
        Where to evaluate it.
    lower : float, optional
        A limit that the values cannot pass; the kernels are reflected at it, or else a density that
        is largest at its limit would seem to fall there.
    """
    draws = np.asarray(values, dtype=float).ravel()
    draws = draws[np.isfinite(draws)]
    spread = min(float(np.std(draws)), float(np.subtract(*np.quantile(draws, [0.75, 0.25]))) / 1.34)
    width = 0.9 * (spread or float(np.std(draws))) * len(draws) ** -0.2
    width = max(width, 1e-3 * float(np.ptp(grid)), 1e-12)
    counts, edges = np.histogram(draws, bins=min(2000, max(10, len(draws))))
    centres, weights = (edges[1:] + edges[:-1]) / 2, counts / counts.sum()
    smooth = kernels(grid, centres, width) @ weights
    if lower is not None:
        smooth = smooth + kernels(grid, 2 * lower - centres, width) @ weights
    return np.asarray(smooth)


def kernels(grid: FloatArray, centres: FloatArray, width: float) -> FloatArray:
    """Gaussian kernels, (n_grid, n_centres)."""
    z = (grid[:, None] - centres[None, :]) / width
    return np.asarray(np.exp(-0.5 * z**2) / (width * np.sqrt(2 * np.pi)))


def region_levels(mass: FloatArray, shares: Sequence[float]) -> list[float]:
    """Heights of contours that hold shares of the mass on a grid, one for each share.

    Parameters
    ----------
    mass : (n, m) array
        Of the cells, one in all.
    shares : sequence of float
    """
    ordered = np.sort(mass.ravel())[::-1]
    inside = np.cumsum(ordered)
    return [float(ordered[min(int(np.searchsorted(inside, share)), ordered.size - 1)]) for share in shares]


def gate_text(tree: xr.DataTree) -> str:
    """One line on the convergence of a calibration; empty where the tree does not say."""
    try:
        gate = json.loads(tree.attrs["gate"])
        state = "converged" if gate["passed"] else "NOT CONVERGED"
        sizes = min(gate["ess_bulk_min"], gate["ess_tail_min"])
        return f"{state}: r-hat at most {gate['r_hat_max']:.3f}, effective draws at least {sizes:.0f}"
    except (KeyError, TypeError, ValueError):
        return ""


@dataclass(frozen=True, eq=False)
class Recorded:
    """What one sensor recorded.

    Attributes
    ----------
    sensor : Sensor
    offset : float
        Subtracted from the values [m]: the campaign's reference, for a runout.
    recorded : (n_recorded,) array
    n_not_reached, n_missing, n_bounds : int
    """

    sensor: Sensor
    offset: float
    recorded: FloatArray
    n_not_reached: int
    n_missing: int
    n_bounds: int

    @property
    def axis_label(self) -> str:
        """Quantity and unit."""
        if not self.sensor.is_runout:
            return f"front speed [{unit_text('m s-1')}]"
        return "runout relative to the reference [m]" if self.offset else "runout s [m]"


@dataclass(frozen=True, eq=False)
class SensorDraws(Recorded):
    """What one sensor recorded, and what a law says of it.

    Attributes
    ----------
    response : (n_draws,) array
        Mean response; where events differ in their release points, averaged over the events.
    reading : (n_draws * n_events,) array
        Predictive distribution of a reading.
    """

    response: FloatArray
    reading: FloatArray


@dataclass(frozen=True, eq=False)
class NewAvalanche(Recorded):
    """What one sensor recorded, and what a new avalanche of the population would do there.

    Attributes
    ----------
    reached : float
        Share of new avalanches that get there.
    front, reading : (n,) arrays
        Of those: what the front does, and what is read of it.
    """

    reached: float
    front: FloatArray
    reading: FloatArray


def shown_sensors(recordings: Recordings) -> tuple[Sensor, ...]:
    """The sensors that a figure with one panel each shows."""
    return recordings.sensors[:MAX_SENSORS]


def left_out(n_sensors: int) -> str:
    """Says that sensors are left out; empty where none is."""
    return f" (the first {MAX_SENSORS} of {n_sensors} sensors)" if n_sensors > MAX_SENSORS else ""


def recorded_at(recordings: Recordings, sensor: Sensor) -> dict[str, Any]:
    """The fields of `Recorded` of one sensor."""
    column = recordings.sensors.index(sensor)
    offset = recordings.reference_s_m or 0.0 if sensor.is_runout else 0.0
    observed = recordings.observed[:, column]
    return {
        "sensor": sensor,
        "offset": offset,
        "recorded": recordings.values[observed, column] - offset,
        "n_not_reached": int(recordings.not_reached[:, column].sum()),
        "n_missing": int(recordings.missing[:, column].sum()),
        "n_bounds": int(recordings.bounded[:, column].sum()),
    }


def sensor_draws(tree: xr.DataTree, recordings: Recordings, sensor: Sensor) -> SensorDraws:
    """Gather what belongs to one sensor of a pooled calibration."""
    recorded = recorded_at(recordings, sensor)
    column = recordings.sensors.index(sensor)
    predictive, responses = tree["new_avalanches"].to_dataset(), tree["mean_response"].to_dataset()
    response = responses["response"].transpose("chain", "draw", "release", "sensor").values[..., column]
    begin = np.column_stack([recordings.release_s_m, recordings.release_speed_m_s])
    _, events_per_release = np.unique(begin, axis=0, return_counts=True)
    reading = predictive["reading"].transpose("chain", "draw", "event", "sensor").values[..., column]
    return SensorDraws(
        **recorded,
        response=np.average(response, axis=-1, weights=events_per_release).ravel() - recorded["offset"],
        reading=reading.ravel() - recorded["offset"],
    )


def new_avalanche(tree: xr.DataTree, recordings: Recordings, sensor: Sensor) -> NewAvalanche:
    """Gather what belongs to one sensor of a hierarchical calibration."""
    recorded = recorded_at(recordings, sensor)
    column = recordings.sensors.index(sensor)
    predictive = tree["new_avalanches"].to_dataset()
    front, reading, reached = (
        predictive[name].transpose("chain", "draw", "event", "sensor").values[..., column]
        for name in ("front", "reading", "reached")
    )
    reached = np.asarray(reached, dtype=bool)
    return NewAvalanche(
        **recorded,
        reached=float(reached.mean()),
        front=front[reached] - recorded["offset"],
        reading=reading[reached] - recorded["offset"],
    )


def place_text(sensor: Sensor) -> str:
    """Where a sensor is."""
    if sensor.is_runout:
        return "runout"
    if sensor.is_span:
        return f"mean speed over s = {sensor.s_from_m:.0f}-{sensor.s_to_m:.0f} m"
    return f"front speed at s = {sensor.s_from_m:.0f} m"


def sensor_title(sensor: Sensor) -> str:
    """Id and place of a sensor, once if they are the same."""
    place, name = place_text(sensor), figure_text(sensor.id, 24)
    return name if name == place else f"{name}: {place}"


def spread(positions: ArrayLike, gap: float) -> FloatArray:
    """Move positions apart as little as needed to keep a gap, in their order."""
    wanted = np.asarray(positions, dtype=float)
    order = np.argsort(wanted, kind="stable")
    target = wanted[order] - gap * np.arange(len(wanted))
    moved = np.empty_like(wanted)
    moved[order] = _isotonic(target) + gap * np.arange(len(wanted))
    return moved


def shaded_density(
    axes: Axes, grid: FloatArray, heights: FloatArray, draws: FloatArray, colour: str, name: str
) -> None:
    """Area under a density, in steps for all of it, and for its 90 and 50 % intervals."""
    for tail, amount, label in (
        (0.0, 0.15, name),
        (0.05, 0.38, f"{name}, 90 %"),
        (0.25, 0.68, f"{name}, 50 %"),
    ):
        start, end = np.quantile(draws, [tail, 1.0 - tail]) if tail else (grid[0], grid[-1])
        ends = np.clip([start, end], grid[0], grid[-1])
        inside = np.concatenate([ends[:1], grid[(grid > start) & (grid < end)], ends[1:]])
        area = np.interp(inside, grid, heights)
        axes.fill_between(inside, area, color=tint(colour, amount), linewidth=0, label=label)


def _isotonic(values: FloatArray) -> FloatArray:
    """Closest non-decreasing sequence: neighbours in the wrong order are pooled."""
    blocks: list[tuple[float, int]] = []
    for value in values:
        mean, count = float(value), 1
        while blocks and blocks[-1][0] > mean:
            before, n = blocks.pop()
            mean, count = (before * n + mean * count) / (n + count), n + count
        blocks.append((mean, count))
    return np.array([mean for mean, count in blocks for _ in range(count)], dtype=float)


def floats_of(values: Any) -> FloatArray:
    """Finite values only, flat."""
    flat = np.asarray(values, dtype=float).ravel()
    return flat[np.isfinite(flat)]
