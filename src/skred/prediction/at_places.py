"""What is predicted at named places: arrival, speed, impact pressure, and how often a year."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from skred.arrays import FloatArray
from skred.inference.intervals import INTERVAL_PROBABILITY
from skred.prediction.fronts import NewFronts
from skred.prediction.probabilities import SHARES
from skred.prediction.wanted import Wanted, impact_pressure_kpa, longest_years

_LEAST_ARRIVALS = 16
"""Avalanches of a population that must come for a quantile of those that do."""
_LEAST_LARGEST_KPA = 1.0
_CURVE = 61
"""Thresholds of a curve of exceedance."""


class _Here(NamedTuple):
    """Avalanches at one place, (n_populations, n_avalanches): NaN where they do not come."""

    speed: FloatArray
    pressure: FloatArray


class Unrecorded(NamedTuple):
    """What the recordings do not know: density by avalanche, drag coefficient and rate by population."""

    density: FloatArray
    drag: FloatArray
    rate: FloatArray | None


def at_places(
    fronts: NewFronts, named: list[tuple[str, float]], wanted: Wanted, draws: Unrecorded
) -> tuple[list[dict[str, Any]], xr.Dataset | None]:
    """Rows as plain data, one a place, and curves of exceedance for figures.

    Parameters
    ----------
    fronts : NewFronts
        Which kept the places, in this order.
    named : list of (str, float)
        Names and arc lengths [m].
    wanted : Wanted
    draws : Unrecorded

    Returns
    -------
    rows : list of dict
        ``reached``; ``speed`` and ``pressure`` with ``exceeded_by`` (of all avalanches), ``given_reached``
        (of those that come) and ``above`` (thresholds). Bands are over populations.
    curves : Dataset or None
        ``speed_exceedance`` and ``pressure_exceedance`` (at, threshold) with bands; None without places.
    """
    if not named:
        return [], None
    rows, curves = [], []
    for k, (name, s_m) in enumerate(named):
        speed = fronts.kept[:, :, k]
        here = _Here(speed, impact_pressure_kpa(speed, draws.density, draws.drag[:, None]))
        rows.append({"name": name, "s_m": s_m, **_row(here, wanted, draws.rate)})
        curves.append(here)
    return rows, _curves([name for name, _ in named], curves)


def unrecorded(fronts: NewFronts, wanted: Wanted, seed: int) -> Unrecorded:
    """Draw what the recordings do not know, for every avalanche and every population."""
    rng = np.random.default_rng([seed, 17])
    n_populations, n_avalanches = fronts.runout.shape
    density = _within(wanted.density_kg_m3, _spread(rng, n_avalanches))
    drag = _within(wanted.drag_coefficient, _spread(rng, n_populations))
    uniform = _spread(rng, n_populations)
    return Unrecorded(density, drag, None if wanted.rate is None else wanted.rate.drawn(uniform))


def _spread(rng: np.random.Generator, n: int) -> FloatArray:
    """Uniform numbers, one in each n-th, in an order by chance."""
    return np.asarray((rng.permutation(n) + rng.random(n)) / n)


def _within(limits: tuple[float, float], uniform: FloatArray) -> FloatArray:
    low, high = limits
    return low + (high - low) * uniform


def _row(here: _Here, wanted: Wanted, rate: FloatArray | None) -> dict[str, Any]:
    reached = np.isfinite(here.speed).mean(axis=1)
    return {
        "reached": _chance(reached, rate, here.speed.shape[1]),
        "speed": _quantity(here.speed, wanted.speeds_m_s, "m/s", rate),
        "pressure": _quantity(here.pressure, wanted.pressures_kpa, "kPa", rate),
    }


def _quantity(
    values: FloatArray, thresholds: tuple[float, ...], unit: str, rate: FloatArray | None
) -> dict[str, Any]:
    """Quantiles of all avalanches (0 where one does not come) and of those that come, and thresholds."""
    everyone, coming, n = np.where(np.isfinite(values), values, 0.0), [], values.shape[1]
    levels = 1.0 - np.array(SHARES)
    enough = np.isfinite(values).sum(axis=1) >= _LEAST_ARRIVALS
    all_by = np.quantile(everyone, levels, axis=1)
    if enough.any():
        by = np.nanquantile(values[enough], levels, axis=1)
        pooled = np.nanquantile(values, levels)
        coming = [
            {"share": share, **_band(by[j], float(pooled[j]))}
            for j, share in enumerate(SHARES)
        ]  # fmt: skip
    pooled_all = np.quantile(everyone, levels)
    return {
        "unit": unit,
        "exceeded_by": [
            {"share": share, **_band(all_by[j], float(pooled_all[j]))} for j, share in enumerate(SHARES)
        ],
        "given_reached": coming,
        "above": [
            {"threshold": threshold, **_chance((everyone > threshold).mean(axis=1), rate, n)}
            for threshold in thresholds
        ],
    }


def _chance(probability: FloatArray, rate: FloatArray | None, n_avalanches: int) -> dict[str, Any]:
    """A probability for an avalanche; with a rate also for a year.

    Avalanches are a Poisson process: at least one a year exceeds with 1 - exp(-rate P), and the mean time
    between two that do is 1 / (rate P). A time longer than the simulation can tell is null, and its lower end
    then the longest that it can; all are null where no avalanche exceeds.
    """
    row: dict[str, Any] = _band(probability, float(probability.mean()))
    if rate is not None:
        per_year = rate * probability
        row["annual"] = _band(annual_exceedance(rate, probability), float("nan"))
        row["annual"]["value"] = float(annual_exceedance(rate, probability).mean())
        often = _band(per_year, float(per_year.mean()))
        row["return_period_years"] = _period(often, longest_years(float(rate.mean()), n_avalanches))
    return row


def _period(often: dict[str, float], longest: float) -> dict[str, float | None]:
    """Mean times between avalanches that come so often; the shortest goes with the highest frequency."""
    if often["value"] <= 0.0:
        return {"value": None, "low": None, "high": None}
    ends = "value", "high", "low"
    value, low, high = (1.0 / often[end] if often[end] * longest > 1.0 else None for end in ends)
    if value is None or low is None:
        return {"value": None, "low": low or longest, "high": None}
    return {"value": value, "low": low, "high": high}


def annual_exceedance(rate: Any, probability: Any) -> Any:
    """Probability of at least one in a year, 1 - exp(-rate P), of a Poisson process with `rate` a year."""
    return -np.expm1(-np.asarray(rate) * probability)


def _band(draws: FloatArray, value: float) -> dict[str, Any]:
    """A value and the equal-tailed interval over populations."""
    tail = 0.5 * (1.0 - INTERVAL_PROBABILITY)
    low, high = np.quantile(draws, [tail, 1.0 - tail])
    return {"value": value, "low": float(low), "high": float(high)}


def _curves(names: list[str], places: list[_Here]) -> xr.Dataset:
    """Probability to exceed each of many thresholds, by place."""
    data = xr.Dataset(coords={"at": names})
    for name, unit in (("speed", "m s-1"), ("pressure", "kPa")):
        every = [np.nan_to_num(getattr(here, name)) for here in places]
        largest = max(_LEAST_LARGEST_KPA, *(float(np.quantile(values, 0.9995)) for values in every))
        thresholds = np.linspace(0.0, largest, _CURVE)
        chance = np.array([_exceedance(values, thresholds) for values in every])
        tail = 0.5 * (1.0 - INTERVAL_PROBABILITY)
        low, high = np.quantile(chance, [tail, 1.0 - tail], axis=1)
        data = data.assign_coords({f"{name}_threshold": (f"{name}_threshold", thresholds, {"units": unit})})
        for suffix, part in (("", chance.mean(axis=1)), ("_low", low), ("_high", high)):
            data[f"{name}_exceedance{suffix}"] = (("at", f"{name}_threshold"), part, {"units": "1"})
    return data


def _exceedance(values: FloatArray, thresholds: FloatArray) -> FloatArray:
    """Share above each threshold by population, (n_populations, n_thresholds)."""
    ordered = np.sort(values, axis=1)
    above = [values.shape[1] - np.searchsorted(row, thresholds, side="right") for row in ordered]
    return np.array(above) / values.shape[1]
