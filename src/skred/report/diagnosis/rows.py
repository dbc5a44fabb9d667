"""Rows of the report of a diagnosis: numbers as text, with the decimals that they deserve."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from skred.campaign import Status
from skred.diagnosis.compare.comparison import ERROR_SHARES
from skred.diagnosis.evidence.prior_odds import NOTHING
from skred.diagnosis.predict.held_out import K_LIMIT, errors
from skred.inference.error_model import ERROR_MODELS
from skred.report.diagnosis.words import kind_of, profile_of, title_of
from skred.report.shared import document as doc
from skred.report.shared.labels import name_text, unit_text
from skred.report.shared.numbers import decimals_for, fixed, is_number, rounded, share, whole

if TYPE_CHECKING:
    from skred.diagnosis.compare.comparison import Comparison
    from skred.physics.mechanisms.spec import Mechanism
    from skred.report.diagnosis.flat import Flat as Diagnosis

Rows = list[dict[str, Any]]
_HOPELESS = 1000.0
"""Relevant strengths above which a detection limit means nothing."""


def sensor_rows(found: Diagnosis) -> Rows:
    """Each sensor: where, what, how well, and how many readings."""
    campaign = found.problem.campaign
    rows = []
    for column, sensor in enumerate(campaign.sensors):
        status, values = campaign.status[:, column], campaign.values[:, column]
        seen = values[status == Status.OBSERVED]
        zero = (campaign.reference_s_m or 0.0) if sensor.is_runout else 0.0
        decimals = 0 if sensor.is_runout else 1
        place = "" if sensor.is_runout else whole(sensor.s_from_m)
        rows.append(
            {
                "id": sensor.id,
                "quantity": sensor.quantity.replace("_", " "),
                "place": f"{place} to {whole(sensor.s_to_m)}" if sensor.is_span else place,
                "unit": "m" if sensor.is_runout else unit_text("m s-1"),
                "relative": f"{100.0 * sensor.relative_sd:.0f} %",
                "absolute": rounded(sensor.absolute_sd, None),
                "observed": len(seen),
                "not_reached": int(np.sum(status == Status.NOT_REACHED)),
                "missing": int(np.sum(status == Status.MISSING)),
                "range": f"{fixed(seen.min() - zero, decimals)} to {fixed(seen.max() - zero, decimals)}"
                if len(seen)
                else "-",
            }
        )
    return rows


def recorded_facts(found: Diagnosis) -> dict[str, Any]:
    """Counts and releases of the campaign."""
    campaign = found.problem.campaign
    releases = np.array([event.release_s_m for event in campaign.events])
    stated = [e.release_sd_m for e in campaign.events if e.release_sd_m]
    return {
        "events": campaign.n_events,
        "sensors": campaign.n_sensors,
        "observed": int(np.sum(campaign.status == Status.OBSERVED)),
        "not_reached": int(np.sum(campaign.status == Status.NOT_REACHED)),
        "missing": int(np.sum(campaign.status == Status.MISSING)),
        "release_low": whole(float(releases.min())),
        "release_high": whole(float(releases.max())),
        "release_sd": rounded(float(np.median(stated)), None) if stated else "",
        "n_release_sd": len(stated),
        "length": whole(campaign.track.length_m),
        "drop": whole(float(np.ptp(campaign.track.z_m))),
        "covariates": sorted({name for event in campaign.events for name in event.covariates}),
    }


def detectability_rows(found: Diagnosis) -> Rows:
    """What the recordings can tell of each mechanism."""
    rows = []
    for row in found.table.rows if found.table is not None else ():
        mechanism = row.mechanism
        relevant = mechanism.added.relevant if mechanism.added is not None else math.nan
        stretch = row.limit_m
        blind = not row.best_limit <= _HOPELESS * relevant
        rows.append(
            {
                "id": mechanism.id,
                "title": mechanism.title,
                "kept": "-" if blind else _percent(row.kept),
                "unit": unit_text(mechanism.strength.unit),
                "limit": _limit(row.limit, relevant),
                "best": _limit(row.best_limit, relevant),
                "where": "" if stretch is None or blind else f"{stretch[0]:.0f} to {stretch[1]:.0f}",
                "relevant": _two_digits(relevant),
                "seen": row.limit <= relevant,
                "power": _percent(row.power),
                "blind": row.power < 0.5,
                "alike": ", ".join(row.alike) or "-",
            }
        )
    return rows


def _percent(value: float) -> str:
    """A share in percent, never rounded to none or all."""
    if not is_number(value):
        return fixed(None)
    percent = 100.0 * value
    return "<1 %" if 0.0 < percent < 0.5 else ">99 %" if 99.5 <= percent < 100.0 else f"{percent:.0f} %"


def _limit(value: float, relevant: float) -> str:
    """A detection limit; a dash where no strength that could ever be is found."""
    return _two_digits(value) if value <= _HOPELESS * relevant else "-"


def _two_digits(value: float) -> str:
    if not is_number(value):
        return fixed(None)
    return (
        f"{value:.2g}"
        if 1e-4 <= abs(value) < 100
        else f"{value:.0f}"
        if abs(value) >= 100
        else f"{value:.1e}"
    )


def work_rows(found: Diagnosis) -> Rows:
    """Missing specific work between sensors."""
    profile = profile_of(found)
    rows = []
    for first, last, mean, sd in profile.work.tolist() if profile is not None else ():
        decimals = min(decimals_for(sd) or 0, 1)
        rows.append(
            {
                "from": whole(first),
                "to": whole(last),
                "mean": rounded(mean, decimals),
                "sd": rounded(sd, decimals),
                "ratio": fixed(mean / sd if sd > 0 else None, 1),
                "stands_out": sd > 0 and abs(mean) > 2.0 * sd,
            }
        )
    return rows


def comparison_rows(comparison: Comparison, added: Mapping[str, tuple[float, float]]) -> Rows:
    """Every candidate, most probable first; of what was added its strength as it was calibrated."""
    shares, factors = comparison.probability, comparison.log_factors
    rows = []
    for name in sorted(shares, key=lambda name: -shares[name]):
        candidates = [under_errors.candidates.get(name) for under_errors in comparison.under_each]
        lead = comparison.leading(name).candidates.get(name) if name in factors else None
        stretch = lead.stretch() if lead is not None else None
        shape = lead.best.shape if lead is not None else None
        mean, sd = added.get(name, lead.strength()) if lead is not None else (None, None)
        decimals = decimals_for(sd)
        rows.append(
            {
                "id": name,
                "title": title_of(name),
                "kind": kind_of(name),
                "prior": share(comparison.odds.get(name)),
                "factor": fixed(factors.get(name), 1),
                "by_model": [
                    fixed(under_errors.log_factors.get(name), 1) for under_errors in comparison.under_each
                ],
                "probability": share(shares[name]),
                "strength": "-" if lead is None else f"{rounded(mean, decimals)} ± {rounded(sd, decimals)}",
                "unit": "" if lead is None else unit_text(lead.mechanism.strength.unit),
                "where": _where(stretch, shape),
                "raced": any(candidates) or name == NOTHING,
            }
        )
    return rows


def _where(stretch: tuple[float, float] | None, shape: Any) -> str:
    if stretch is not None:
        return f"{stretch[0]:.0f} to {stretch[1]:.0f}"
    if shape is not None and (shape.sensor or shape.covariate):
        return str(shape.sensor or shape.covariate)
    return "-"


def error_rows(comparison: Comparison) -> Rows:
    """The error models that were raced."""
    most = max(comparison.base_evidence.values())
    return [
        {
            "id": under_errors.error_model,
            "title": ERROR_MODELS[under_errors.error_model].title,
            "prior": share(ERROR_SHARES[under_errors.error_model]),
            "evidence": fixed(comparison.base_evidence[under_errors.error_model] - most, 1),
        }
        for under_errors in comparison.under_each
    ]


PREDICTION_ERRORS = (
    ("rmse_velocity", "error of speeds, root mean square [m/s]", 1),
    ("rmse_runout", "error of runouts, root mean square [m]", 0),
    ("coverage_90", "readings inside their 90 % intervals [%]", 0),
)
"""Keys of the verdict less before and after, words, decimals; coverage as a share."""


def held_out_rows(found: Diagnosis) -> Rows:
    """Errors and coverage before and after."""
    before, after = (
        errors(one, found.problem) if one is not None else {} for one in (found.before, found.after)
    )
    rows = []
    for key, words, decimals in PREDICTION_ERRORS:
        factor = 100.0 if key == "coverage_90" else 1.0
        values = [one.get(key) for one in (before, after)]
        texts = [fixed(None if value is None else factor * value, decimals) for value in values]
        if values[0] is not None or values[1] is not None:
            rows.append({"words": words, "before": texts[0], "after": texts[1]})
    elpd = [fixed(one.elpd if one is not None else None, 1) for one in (found.before, found.after)]
    return [
        *rows,
        {"words": "log score of avalanches left out, elpd [nats]", "before": elpd[0], "after": elpd[1]},
    ]


def trust_rows(found: Diagnosis) -> Rows:
    """Gate, importance sampling and refits of the base law and of each augmented one."""
    calibrations = [(found.law.id, found.calibration)]
    names = found.law.id
    for step in found.steps:
        names += f" + {step.candidate.mechanism.id}"
        calibrations.append((names, step.calibration))
    held = {0: found.before, len(found.steps): found.after or found.before}
    rows = []
    for number, (name, calibration) in enumerate(calibrations):
        if calibration is None:
            continue
        gate, left = calibration.gate, held.get(number)
        rows.append(
            {
                "name": name,
                "passed": gate.passed,
                "r_hat": fixed(gate.r_hat_max, 4),
                "ess_bulk": whole(gate.ess_bulk_min),
                "ess_tail": whole(gate.ess_tail_min),
                "divergences": whole(gate.divergences),
                "problems": "; ".join(gate.problems),
                "k": fixed(float(left.pareto_k.max())) if left is not None else "-",
                "n_bad": str(int(np.sum(~(left.pareto_k <= K_LIMIT)))) if left is not None else "-",
                "refitted": ", ".join(left.refitted) or "none" if left is not None else "-",
                "not_converged": ", ".join(left.not_converged) if left is not None else "",
            }
        )
    return rows


def prior_rows(found: Diagnosis) -> Rows:
    """Priors of the base law's strengths, and of every candidate's."""
    rows = []
    for mechanism in found.law.mechanisms:
        strength = mechanism.strength
        kind = "median across avalanches, half-normal"
        rows.append(_prior(mechanism, kind, strength.prior_scale, strength.prior_reason, "base law"))
    raced: list[Mechanism] = []
    if found.comparison is not None:
        raced = [candidate.mechanism for candidate in found.comparison.under_each[0].candidates.values()]
    for mechanism in raced:
        added = mechanism.added
        if added is not None:
            kind = "normal" if added.either_sign else "half-normal"
            rows.append(_prior(mechanism, kind, added.scale, added.reason, "candidate"))
    return rows


def _prior(mechanism: Mechanism, kind: str, scale: float, reason: str, role: str) -> dict[str, str]:
    strength = mechanism.strength
    return {
        "id": mechanism.id,
        "role": role,
        "parameter": name_text(strength.name),
        "kind": kind,
        "scale": f"{scale:g}",
        "unit": unit_text(strength.unit),
        "reason": reason,
    }


def settings_rows(document: doc.Document) -> list[tuple[str, Any]]:
    """Settings and times."""
    settings = doc.get(document, "settings") or {}
    return [(name_text(key), value) for key, value in settings.items()]
