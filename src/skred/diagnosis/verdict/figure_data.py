"""The curves, draws and predictions of a diagnosis that its figures show: ``diagnosis.nc``."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from scipy.special import logsumexp

from skred.arrays import FloatArray
from skred.diagnosis.augment.coefficient import augmented_of
from skred.diagnosis.compare.candidate import Candidate
from skred.diagnosis.compare.comparison import Comparison
from skred.diagnosis.compare.location import Location
from skred.diagnosis.evidence.coefficient import Curve
from skred.diagnosis.evidence.tolerance import COUNTS
from skred.diagnosis.outcome import Diagnosis, NotDiagnosed, Outcome
from skred.diagnosis.verdict.conditional import conditional_dataset
from skred.diagnosis.verdict.mechanisms import candidates_of
from skred.diagnosis.verdict.report_facts import checks_of, comparisons_of
from skred.diagnosis.words import TOLD_FROM
from skred.inference.recorded_data import recorded_groups
from skred.inference.results import FORMAT
from skred.physics.mechanisms.strength_prior import SCALES
from skred.physics.mechanisms.stretches import is_opposed

PRIOR_SCALES = np.geomspace(0.1, 10.0, 13)
"""Scales of a strength's prior, relative to the one used, at which the Bayes factor is given."""
_READING = {"units": "m s-1; m for the runout"}
_NATS = {"units": "nat"}
_OF_CANDIDATE = {"units": "see the variable unit"}


def figure_data(found: Outcome) -> xr.DataTree:
    """Everything that the figures of a diagnosis show.

    Groups
    ------
    observed_data, constant_data : see `skred.inference.recorded_data.recorded_groups`
    check : ``simulated`` (law, campaign) and ``statistic`` (law): of clean campaigns and of the recordings,
        by the base law and by each law with something added
    force : the missing retardation along the track: ``mean``, ``low``, ``high``, ``covered`` (s)
    comparison, comparison_2 : evidence along the strength of each candidate's most probable shape, and its
        log Bayes factor by the prior's scale (of those above 5 % of probability, and of the first)
    shapes, shapes_2 : log Bayes factor of each candidate at each place, sensor or covariate
    held_out : each avalanche as predicted from the others, ``before`` and ``after`` something was added
    conditional : each reading as predicted from those above it, ``before`` and ``after``; where something was
        added
    added : draws of the strengths that were added

    Of what was not diagnosed only the first two.
    """
    groups: dict[str, xr.Dataset] = dict(recorded_groups(found.problem))
    if not isinstance(found, NotDiagnosed):
        groups |= {"check": _checks(found), "force": _force(found.location), "held_out": _held_out(found)}
        for number, comparison in enumerate(comparisons_of(found)):
            ending = f"_{number + 1}" if number else ""
            groups[f"comparison{ending}"] = _curves(comparison)
            groups[f"shapes{ending}"] = _shapes(comparison)
        if found.conditional is not None:
            groups["conditional"] = conditional_dataset(found.conditional, found.problem)
        if found.steps:
            groups["added"] = _added(found)
    tree = xr.DataTree.from_dict(groups)
    tree.attrs = {
        "title": f"What {found.law.title} leaves out, {found.problem.campaign.name}",
        "format": FORMAT,
        "law": found.law.id,
        "changed_priors": json.dumps(dict(found.law.changed_priors)),
        "campaign": found.problem.campaign.name,
        "campaign_fingerprint": found.problem.campaign.fingerprint(),
    }
    return tree


def _checks(found: Diagnosis) -> xr.Dataset:
    checks = checks_of(found)
    return xr.Dataset(
        {
            "simulated": (("law", "campaign"), _padded([check.simulated for _, check in checks]), _NATS),
            "statistic": ("law", [check.statistic for _, check in checks], _NATS),
        },
        coords={"law": [" + ".join((found.law.id, *added)) for added, _ in checks]},
        attrs={"statistic": "log odds of anything against nothing; of clean campaigns by fronts"},
    )


def _force(location: Location) -> xr.Dataset:
    retardation = {"units": "m s-2"}
    return xr.Dataset(
        {
            "mean": ("s", location.mean, retardation),
            "low": ("s", location.low, retardation),
            "high": ("s", location.high, retardation),
            "covered": ("s", location.covered, {"units": "1", "long_name": "share of the avalanches"}),
        },
        coords={"s": ("s", location.s_m, {"units": "m"})},
        attrs={"band": "low to high holds the whole profile with probability 0.9"},
    )


def _held_out(found: Diagnosis) -> xr.Dataset:
    held = {"before": found.before}
    if found.after is not None:
        held["after"] = found.after
    of_reading, of_event = ("when", "event", "sensor"), ("when", "event")
    each = held.values()
    return xr.Dataset(
        {
            "mean": (of_reading, [one.predicted.mean for one in each], _READING),
            "low": (of_reading, [one.predicted.low for one in each], _READING),
            "high": (of_reading, [one.predicted.high for one in each], _READING),
            "log_score": (of_event, [one.pointwise for one in each], _NATS),
            "pareto_k": (of_event, [one.pareto_k for one in each], {"units": "1"}),
        },
        coords={"when": list(held), **found.problem.coords},
        attrs={"interval": "low to high holds 90 % of the readings predicted, errors included"},
    )


def _curves(comparison: Comparison) -> xr.Dataset:
    """Evidence along the strength of each candidate's most probable shape."""
    found = candidates_of(comparison)
    names, candidates = list(found), list(found.values())
    best = [candidate.best for candidate in candidates]
    fine = [_fine(curve) for curve in best]
    at, on = ("candidate", "strength_point"), ("candidate", "fine_point")
    scaled = np.full((len(names), len(PRIOR_SCALES)), np.nan)
    for row in _looked_at(comparison, names):
        scaled[row] = [_factor_at(candidates[row], float(scale)) for scale in PRIOR_SCALES]
    return xr.Dataset(
        {
            "unit": ("candidate", [candidate.mechanism.strength.unit for candidate in candidates]),
            "strength": (at, _padded([curve.strengths for curve in best]), _OF_CANDIDATE),
            "log_evidence": (at, _padded([curve.log_evidence for curve in best]), _NATS),
            "fine_strength": (on, _padded([part[0] for part in fine]), _OF_CANDIDATE),
            "fine_log_evidence": (on, _padded([part[1] for part in fine]), _NATS),
            "fine_log_prior": (on, _padded([part[2] for part in fine])),
            "log_bayes_factor": (("candidate", "prior_scale"), scaled, _NATS),
        },
        coords={"candidate": names, "prior_scale": ("prior_scale", PRIOR_SCALES, {"units": "1"})},
        attrs={"log_evidence": "relative to strength 0, everything else refitted"},
    )


def _looked_at(comparison: Comparison, names: Sequence[str]) -> list[int]:
    """Rows of the candidates whose Bayes factor is given by the prior's scale: those that figures show."""
    shares = [comparison.probability[name] for name in names]
    least = min(TOLD_FROM, max(shares, default=0.0))
    return [row for row, share in enumerate(shares) if share >= least]


def _fine(curve: Curve) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Strengths on a fine grid, log evidence and log prior density there."""
    strengths, log_density = curve.fine()
    log_prior = curve.log_prior(strengths)
    return strengths, log_density - log_prior, log_prior


def _factor_at(candidate: Candidate, relative: float) -> float:
    """Log Bayes factor of a candidate with its prior scales multiplied; re-computed at its own alone.

    NaN where so little of a narrow prior is near the evidence that none of it is known.
    """
    scales = [relative * one for one in SCALES]
    if candidate.best.log_factor_of(scales=scales) < candidate.best.floor + COUNTS:
        return math.nan
    factors = [one.log_factor_of(scales=scales) for one in candidate.curves]
    moved = float(logsumexp(candidate.log_weights + np.array(factors)) - logsumexp(candidate.log_factors))
    return candidate.log_bayes_factor + moved


def _shapes(comparison: Comparison) -> xr.Dataset:
    """Every shape of every candidate: where it acts, and its log Bayes factor for all strengths together."""
    rows: list[tuple[Any, ...]] = []
    for name, candidate in candidates_of(comparison).items():
        best = candidate.best
        for curve, factor in zip(candidate.curves, candidate.log_factors, strict=True):
            shape = curve.shape
            ends = [math.nan if end is None else end for end in (shape.s_from_m, shape.s_to_m)]
            what = shape.sensor or "", shape.covariate or "", is_opposed(shape), curve is best
            rows.append((name, *ends, *what, float(factor - curve.log_bayes_factor), curve.log_bayes_factor))
    columns: dict[str, tuple[type, dict[str, str]]] = {
        "mechanism": (str, {}),
        "s_from": (float, {"units": "m"}),
        "s_to": (float, {"units": "m"}),
        "sensor": (str, {}),
        "covariate": (str, {}),
        "opposed": (bool, {}),
        "best": (bool, {}),
        "log_weight": (float, _NATS),
        "log_bayes_factor": (float, _NATS),
    }
    return xr.Dataset(
        {
            name: ("shape", np.array([row[k] for row in rows], dtype=kind), units)
            for k, (name, (kind, units)) in enumerate(columns.items())
        }
    )


def _added(found: Diagnosis) -> xr.Dataset:
    """Draws of the added strengths, by the law that has all of them."""
    calibration = found.steps[-1].calibration
    posterior = calibration.tree["posterior"].to_dataset()
    units = {one.name: one.mechanism.strength.unit for one in augmented_of(calibration).added}
    draws = posterior[list(units)].copy()
    for name, unit in units.items():
        draws[name].attrs = {"units": unit}
    return draws


def _padded(rows: Sequence[FloatArray]) -> FloatArray:
    """Rows of unequal length as one array, NaN where they end."""
    table = np.full((len(rows), max((len(row) for row in rows), default=0)), np.nan)
    for number, row in enumerate(rows):
        table[number, : len(row)] = row
    return table
