"""Probabilities with intervals from simulated avalanches, and the parts of the uncertainty."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from skred.arrays import FloatArray
from skred.inference.intervals import INTERVAL_PROBABILITY
from skred.prediction.fronts import SPEED_STEP_M_S, NewFronts
from skred.prediction.reading_errors import ReadingError

SPEEDS_M_S = (1.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 40.0, 50.0, 60.0, 80.0, 100.0)
"""Speeds whose probability of exceedance is given, as far as they occur."""
SHARES = (0.5, 0.1, 0.01)
"""Probabilities for which speeds and runouts are given that are exceeded with them."""
LEAST_PROBABILITY = 0.001
"""A speed occurs if it is exceeded somewhere with at least this probability."""
LEAST_ARRIVAL = 0.01
"""Least probability of arrival at which the speed is described."""
PARTS = ("parameter", "event", "residual")


def prediction_dataset(
    fronts: NewFronts,
    speed_error: ReadingError,
    runout_error: ReadingError,
    shortest_recorded_m: float | None = None,
) -> xr.Dataset:
    """Everything predicted, by place.

    Returns
    -------
    Dataset
        ``speed_probability`` (s, speed) and ``runout_probability`` (s): that an avalanche exceeds the
        speed, or the place; ``speed_quantile`` (s, share) and ``runout_quantile`` (share): what that share
        of avalanches exceeds; ``arrival_probability`` (s). Each of avalanches from all populations
        together, with ``_low`` and ``_high``, the equal-tailed interval over populations.
        ``mean_speed``, ``speed_sd_parameter``, ``speed_sd_event``, ``speed_sd_residual``,
        ``speed_sd_total`` (s) of the avalanches that come there, and ``runout_mean``,
        ``runout_sd_...`` of all; ``long_runout_...`` of those that run beyond the shortest recorded
        runout, if there is one on this track.
    """
    speeds = _occurring(fronts)
    columns = np.rint(speeds / SPEED_STEP_M_S).astype(int)
    n = fronts.n_avalanches
    speed_chance = fronts.exceeding[..., columns] / n
    runout_chance = _beyond(fronts)
    arrival = fronts.passing.sum(axis=0) / n
    pooled = fronts.exceeding.mean(axis=0, dtype=float)[None] / n
    data = xr.Dataset(
        coords={
            "s": ("s", fronts.places, {"units": "m", "long_name": "arc length along the track"}),
            "speed": ("speed", speeds, {"units": "m s-1"}),
            "share": ("share", list(SHARES), {"units": "1", "long_name": "share of avalanches that exceed"}),
        }
    )
    _add(data, "speed_probability", ("s", "speed"), speed_chance, speed_chance.mean(axis=0), "1")
    _add(data, "runout_probability", ("s",), runout_chance, runout_chance.mean(axis=0), "1")
    _add(data, "arrival_probability", ("s",), arrival, arrival.mean(axis=0), "1")
    by_share = np.stack([_exceeded(fronts.exceeding / np.float32(n), q) for q in SHARES], axis=-1)
    over_all = np.stack([_exceeded(pooled, q)[0] for q in SHARES], axis=-1)
    _add(data, "speed_quantile", ("s", "share"), by_share, over_all, "m s-1")
    levels = 1.0 - np.array(SHARES)
    _add(
        data,
        "runout_quantile",
        ("share",),
        np.quantile(fronts.runout, levels, axis=1).T,
        np.quantile(fronts.runout, levels),
        "m",
    )
    _add_speed_parts(data, fronts, speed_error)
    _add_runout_parts(data, "runout", fronts, runout_error)
    if shortest_recorded_m is not None and (fronts.runout > shortest_recorded_m).mean() >= LEAST_ARRIVAL:
        _add_runout_parts(data, "long_runout", fronts, runout_error, shortest_recorded_m)
    return data


def simulation_errors(fronts: NewFronts) -> dict[str, float]:
    """Error of the simulation from the limited number of avalanches, from their two halves.

    Returns
    -------
    dict
        ``largest_error_of_a_probability``: standard error of a mean over populations, the largest found;
        ``share_of_band_variance``: of the arrival probability's variance over populations, what is the
        simulation's, the largest where between 5 and 95 % arrive.
    """
    columns = np.rint(_occurring(fronts) / SPEED_STEP_M_S).astype(int)
    half = fronts.n_avalanches / 2
    chance = fronts.exceeding_by_half[..., columns] / (half * len(fronts.runout))
    arrival = fronts.passing / half
    variance = arrival.mean(axis=0).var(axis=0)
    common = _covariance(arrival[0], arrival[1], np.ones_like(arrival[0]))
    mean = arrival.mean(axis=(0, 1))
    looked_at = (mean > 0.05) & (mean < 0.95) & (variance > 0.0)
    shares = np.clip(1.0 - common[looked_at] / variance[looked_at], 0.0, 1.0)
    return {
        "largest_error_of_a_probability": float(np.abs(chance[0] - chance[1]).max() / 2.0),
        "share_of_band_variance": float(shares.max(initial=0.0)),
    }


def _add(
    data: xr.Dataset, name: str, dims: tuple[str, ...], draws: FloatArray, value: FloatArray, unit: str
) -> None:
    """A quantity with its band over populations."""
    tail = 0.5 * (1.0 - INTERVAL_PROBABILITY)
    low, high = np.quantile(draws, [tail, 1.0 - tail], axis=0)
    for suffix, values in (("", value), ("_low", low), ("_high", high)):
        data[f"{name}{suffix}"] = (dims, np.asarray(values, dtype=float), {"units": unit})


def _occurring(fronts: NewFronts) -> FloatArray:
    """Those of the speeds that occur; always the lowest."""
    n_populations, _, n_steps = fronts.exceeding.shape
    highest = fronts.exceeding.sum(axis=0, dtype=np.int64).max(axis=0) / (n_populations * fronts.n_avalanches)
    steps = [round(speed / SPEED_STEP_M_S) for speed in SPEEDS_M_S]
    occurs = [step < n_steps and highest[step] >= LEAST_PROBABILITY for step in steps[1:]]
    return np.array(
        [SPEEDS_M_S[0], *(speed for speed, does in zip(SPEEDS_M_S[1:], occurs, strict=True) if does)]
    )


def _beyond(fronts: NewFronts) -> FloatArray:
    """P(runout beyond each place) by population; at the track's end: that it is reached."""
    end = fronts.places[-1]
    ordered = np.sort(fronts.runout, axis=1)
    within = np.array([np.searchsorted(row, fronts.places, side="right") for row in ordered])
    within[:, -1] = [np.searchsorted(row, end, side="left") for row in ordered]
    return 1.0 - within / fronts.n_avalanches


def _exceeded(chance: NDArray[Any], share: float) -> FloatArray:
    """Speed that a share of avalanches exceeds, from (..., n_steps) to (...); linear between steps."""
    above = (chance > share).sum(axis=-1)
    last = np.minimum(above, chance.shape[-1] - 1)
    upper = np.take_along_axis(chance, np.maximum(last - 1, 0)[..., None], axis=-1)[..., 0]
    lower = np.take_along_axis(chance, last[..., None], axis=-1)[..., 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        part = np.where(upper > lower, (upper - share) / (upper - lower), 0.0)
    return np.where(above == 0, 0.0, SPEED_STEP_M_S * (above - 1 + part))


def _covariance(first: FloatArray, second: FloatArray, weights: FloatArray) -> FloatArray:
    """Weighted covariance over the leading axis."""
    total = np.maximum(weights.sum(axis=0), 1e-300)
    a, b = (x - (weights * x).sum(axis=0) / total for x in (first, second))
    return np.asarray((weights * a * b).sum(axis=0) / total)


class _Sums(NamedTuple):
    """Number, sum and sum of squares of a quantity, (2, n_populations, ...), by half of the avalanches."""

    number: FloatArray
    total: FloatArray
    square: FloatArray

    def parts(self, error: ReadingError) -> tuple[FloatArray, list[FloatArray]]:
        """Mean, and the parts of the variance.

        A population counts by how many avalanches it has here. The covariance over populations of the
        means of two independent halves is the variance of the mean itself: the halves' own errors cancel.
        """
        everything = np.maximum(self.number.sum(axis=(0, 1)), 1.0)
        mean = self.total.sum(axis=(0, 1)) / everything
        square = self.square.sum(axis=(0, 1)) / everything
        variance = np.maximum(square - mean**2, 0.0)
        halves = self.total / np.maximum(self.number, 1.0)
        weights = np.where((self.number > 0).all(axis=0), self.number.sum(axis=0), 0.0)
        parameter = np.clip(_covariance(halves[0], halves[1], weights), 0.0, variance)
        return mean, [parameter, variance - parameter, error.variance(square)]


def _add_speed_parts(data: xr.Dataset, fronts: NewFronts, error: ReadingError) -> None:
    """Speed of the avalanches that come to a place; none where too few come."""
    mean, parts = _Sums(fronts.passing, fronts.total, fronts.square).parts(error)
    few = data["arrival_probability"].values < LEAST_ARRIVAL
    _add_parts(data, "speed", ("s",), [np.where(few, np.nan, part) for part in parts], "m s-1")
    data["mean_speed"] = (("s",), np.where(few, np.nan, mean), {"units": "m s-1"})


def _add_runout_parts(
    data: xr.Dataset, name: str, fronts: NewFronts, error: ReadingError, beyond_m: float = -np.inf
) -> None:
    """Runout of the avalanches that pass a place; those that leave the track count with its end."""
    n = fronts.n_avalanches // 2
    runout = np.stack([fronts.runout[:, :n], fronts.runout[:, n:]])
    chosen = np.asarray(runout > beyond_m, dtype=float)
    # About the middle, so that squares of distances of kilometres do not round the variance away.
    middle = float(np.median(runout))
    sums = [(chosen * (runout - middle) ** power).sum(axis=2) for power in (1, 2)]
    mean, parts = _Sums(chosen.sum(axis=2), *sums).parts(ReadingError(0.0, 0.0, ""))
    mean = mean + middle
    residual = error.variance(mean**2 + parts[0] + parts[1])
    _add_parts(data, name, (), [parts[0], parts[1], residual], "m")
    data[f"{name}_mean"] = ((), float(mean), {"units": "m"})


def _add_parts(
    data: xr.Dataset, what: str, dims: tuple[str, ...], variances: list[FloatArray], unit: str
) -> None:
    """Standard deviations of the parts and of their sum; without a stated error, of the known parts."""
    for part, variance in zip(PARTS, variances, strict=True):
        data[f"{what}_sd_{part}"] = (dims, np.sqrt(variance), {"units": unit})
    known = [v for v in variances if not np.isnan(v).all()] or variances
    data[f"{what}_sd_total"] = (dims, np.sqrt(np.sum(known, axis=0)), {"units": unit})
