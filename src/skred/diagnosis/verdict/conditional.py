"""Readings predicted from those above them, before and after: the key ``conditional`` of `verdict.json`."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import xarray as xr

from skred.arrays import BoolArray, FloatArray
from skred.diagnosis.outcome import Diagnosis
from skred.diagnosis.predict.conditional import BeforeAfter, Conditional
from skred.diagnosis.predict.event_proposal import too_few
from skred.diagnosis.verdict.given_above import gain_of, given_above
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.inference.paired import sum_se


def conditional_document(found: Diagnosis) -> dict[str, Any] | None:
    """How well each reading is predicted from those above it, by sensor; None where nothing was added.

    Avalanches that carry the answer, and the others, are also told of by themselves.
    """
    if found.conditional is None:
        return None
    problem, pair = found.problem, found.conditional
    carried_by = [] if found.influence is None else list(found.influence.carried_by)
    carrying = np.isin(problem.campaign.event_ids, carried_by)
    velocity, each = problem.readings.is_velocity, np.eye(problem.campaign.n_sensors, dtype=bool)
    shown = _shown(pair)
    effective = np.minimum(pair.before.effective, pair.after.effective)[shown]
    document: dict[str, Any] = {
        "sensors": [
            {
                "sensor": sensor.id,
                "quantity": str(sensor.quantity),
                "unit": "m" if sensor.is_runout else "m s-1",
                **_sets(pair, problem, column, carrying),
            }
            for sensor, column in zip(problem.campaign.sensors, each, strict=True)
            if shown[:, column].any()
        ],
        "speeds": _sets(pair, problem, velocity, carrying) if shown[:, velocity].any() else None,
        "effective_draws_min": float(effective.min()) if effective.size else None,
        "n_few_draws": int(too_few(effective).sum()),
    }
    return document | {"statement": given_above(document, _moving(pair, problem, shown & velocity))}


def conditional_dataset(pair: BeforeAfter, problem: HierarchicalProblem) -> xr.Dataset:
    """The predictions, as the figures show them."""
    at, reading = ("when", "event", "sensor"), {"units": "m s-1; m for the runout"}
    nats, none = {"units": "nat"}, {"units": "1"}
    units = {"mean": reading, "low": reading, "high": reading, "log_score": nats, "crps": reading}
    units |= {"n_above": none, "effective": none}
    return xr.Dataset(
        {name: (at, [getattr(one, name) for one in pair], unit) for name, unit in units.items()},
        coords={"when": list(pair._fields), **problem.coords},
        attrs={
            "given": "the n_above readings of the same avalanche above each, and the other avalanches",
            "interval": "low to high holds 90 % of the readings predicted, errors included",
        },
    )


def _moving(pair: BeforeAfter, problem: HierarchicalProblem, chosen: BoolArray) -> tuple[int, int]:
    """How many of some speeds are above nil, and how many of these lie in their intervals.

    Of a front that has stopped nothing scatters: nil is read, and is in all intervals of fronts that stop.
    """
    chosen = chosen & (problem.values > 0.0)
    return int(chosen.sum()), int(pair.after.covered(problem.values)[chosen].sum())


def _shown(pair: BeforeAfter) -> BoolArray:
    """Readings that have another one above them."""
    shown: BoolArray = pair.before.n_above > 0
    return shown


def _sets(
    pair: BeforeAfter, problem: HierarchicalProblem, columns: BoolArray, carrying: BoolArray
) -> dict[str, Any]:
    """Scores over all avalanches, over those that carry the answer, and over the others."""
    sets = {"all": np.full(problem.campaign.n_events, True), "carrying": carrying, "others": ~carrying}
    scores = {
        name: _scores(pair, problem, _shown(pair) & columns & events[:, None])
        for name, events in sets.items()
    }
    return {"gain": gain_of(scores["all"]) if scores["all"] else None, **scores}


def _scores(pair: BeforeAfter, problem: HierarchicalProblem, chosen: BoolArray) -> dict[str, Any] | None:
    """Of some readings: errors, mean scores and their differences, with doubled standard errors."""
    n = int(chosen.sum())
    if not n:
        return None
    scores = [_of(one, problem, chosen) for one in pair]
    result: dict[str, Any] = {"n": n}
    for name in ("rmse", "log_score", "crps"):
        values = [mean for mean, _ in (score[name] for score in scores)]
        spreads = [spread for _, spread in (score[name] for score in scores)]
        for when, value, spread in zip(pair._fields, values, spreads, strict=True):
            result |= {f"{name}_{when}": value, f"{name}_{when}_2se": _doubled(spread)}
        result |= {
            f"{name}_diff": values[1] - values[0],
            f"{name}_diff_2se": _doubled(spreads[1] - spreads[0]),
        }
    for when, one in zip(pair._fields, pair, strict=True):
        result[f"coverage_90_{when}"] = float(one.covered(problem.values)[chosen].mean())
    return result


def _of(
    one: Conditional, problem: HierarchicalProblem, chosen: BoolArray
) -> dict[str, tuple[float, FloatArray]]:
    """Each score, and by how much each avalanche moves it.

    Readings of an avalanche go together: what they move a mean by is summed over them. A root mean square is
    moved by half of what its square is, over itself.
    """
    n = chosen.sum()

    def mean(values: FloatArray) -> tuple[float, FloatArray]:
        of_all = float(values[chosen].mean())
        off = np.where(chosen, values - of_all, 0.0).sum(axis=1) / n
        return of_all, off[chosen.any(axis=1)]

    square, moved = mean((one.mean - problem.values) ** 2)
    root = math.sqrt(square)
    return {
        "rmse": (root, moved / (2.0 * root) if root > 0.0 else 0.0 * moved),
        "log_score": mean(one.log_score),
        "crps": mean(one.crps),
    }


def _doubled(moved: FloatArray) -> float | None:
    """Twice the standard error of what avalanches move by so much; None of one avalanche."""
    return 2.0 * sum_se(moved) if len(moved) > 1 else None
