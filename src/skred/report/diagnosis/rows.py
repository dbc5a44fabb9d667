"""Rows of the report of a diagnosis: numbers as text, with the decimals that they deserve."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from skred.arrays import FloatArray
from skred.report.diagnosis.words import (
    facts_of,
    kind_of,
    shares_of,
    stretch_in,
    title_of,
    with_added,
)
from skred.report.shared import document as doc
from skred.report.shared.labels import name_text, printable, unit_text
from skred.report.shared.numbers import decimals_for, fixed, is_number, rounded, share, whole
from skred.report.shared.recordings import recordings_of

if TYPE_CHECKING:
    import xarray as xr

Rows = list[dict[str, Any]]
_HOPELESS = 1000.0
"""Relevant strengths above which a detection limit means nothing."""


def _constant_sd(of_sensor: float, of_rows: FloatArray) -> str:
    """Constant part of a sensor's errors: from the smallest to the largest, where rows state their own."""
    used = np.where(of_rows > 0.0, of_rows, of_sensor)
    ends = dict.fromkeys(
        rounded(end, None) for end in ((used.min(), used.max()) if len(used) else [of_sensor])
    )
    return " to ".join(ends)


def sensor_rows(tree: xr.DataTree) -> Rows:
    """Each sensor: where, what, how well, and how many readings."""
    recordings = recordings_of(tree)
    rows = []
    for column, sensor in enumerate(recordings.sensors):
        observed = recordings.observed[:, column]
        seen = recordings.values[observed, column]
        zero = (recordings.reference_s_m or 0.0) if sensor.is_runout else 0.0
        decimals = 0 if sensor.is_runout else 1
        place = "" if sensor.is_runout else whole(sensor.s_from_m)
        ends = [fixed(end - zero, decimals) for end in (seen.min(), seen.max())] if len(seen) else []
        rows.append(
            {
                "id": sensor.id,
                "quantity": name_text(sensor.quantity),
                "place": f"{place} to {whole(sensor.s_to_m)}" if sensor.is_span else place,
                "unit": "m" if sensor.is_runout else "m s-1",
                "relative": f"{100.0 * sensor.relative_sd:.0f} %",
                "absolute": _constant_sd(sensor.absolute_sd, recordings.stated_sd[observed, column]),
                "observed": int(observed.sum()),
                "not_reached": int(recordings.not_reached[:, column].sum()),
                "bounds": int(recordings.bounded[:, column].sum()),
                "missing": int(recordings.missing[:, column].sum()),
                "place_sd": "" if sensor.place_sd_m is None else rounded(sensor.place_sd_m, None),
                "range": " to ".join(ends) or "-",
            }
        )
    return rows


def detectability_rows(document: doc.Document) -> Rows:
    """What the recordings can tell of each mechanism."""
    rows = []
    for row in doc.listed(document, "identifiability"):
        name, relevant = str(doc.get(row, "id")), _number(doc.get(row, "relevant"))
        limit, best = (_number(doc.get(row, key), math.inf) for key in ("limit", "best_limit"))
        power, alike = _number(doc.get(row, "power"), 0.0), doc.listed(row, "alike")
        stretch, blind = doc.listed(row, "best_stretch_m"), not best <= _HOPELESS * relevant
        here = len(stretch) == 2 and all(map(is_number, stretch)) and not blind
        rows.append(
            {
                "id": name,
                "title": title_of(document, name),
                "kept": "-" if blind else _percent(doc.get(row, "kept")),
                "unit": doc.get(row, "unit"),
                "limit": _limit(limit, relevant),
                "best": _limit(best, relevant),
                "where": f"{stretch[0]:.0f} to {stretch[1]:.0f}" if here else "-",
                "relevant": _two_digits(relevant),
                "power": _percent(power),
                "blind": power < 0.5,
                "alike": ", ".join(name_text(one) for one in alike) or "-",
            }
        )
    return rows


def _number(value: Any, otherwise: float = math.nan) -> float:
    return float(value) if is_number(value) else otherwise


def _percent(value: Any) -> str:
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
    if abs(value) >= 100:
        return f"{value:.0f}"
    return f"{value:.2g}" if abs(value) >= 1e-4 else f"{value:.1e}"


def work_rows(document: doc.Document) -> Rows:
    """Missing specific work between sensors."""
    rows = []
    for row in doc.listed(document, "report", "force", "work"):
        mean, sd = _number(doc.get(row, "mean")), _number(doc.get(row, "sd"))
        decimals = min(decimals_for(sd) or 0, 1)
        rows.append(
            {
                "from": whole(doc.get(row, "s_from_m")),
                "to": whole(doc.get(row, "s_to_m")),
                "mean": rounded(mean, decimals),
                "sd": rounded(sd, decimals),
                "ratio": fixed(mean / sd if sd > 0 else None, 1),
                "stands_out": sd > 0 and abs(mean) > 2.0 * sd,
            }
        )
    return rows


def comparison_rows(document: doc.Document, comparison: doc.Document) -> Rows:
    """Every candidate, most probable first."""
    rows = []
    for name, probability in shares_of(comparison).items():
        candidate = doc.get(comparison, "candidates", name)
        mean, sd = (doc.get(candidate, "strength", key) for key in ("mean", "sd"))
        decimals = decimals_for(sd)
        error = doc.get(comparison, "log_bayes_factors_se", name)
        rows.append(
            {
                "id": name,
                "title": title_of(document, name),
                "kind": kind_of(document, name),
                "prior": share(doc.get(comparison, "prior", name)),
                "factor": fixed(doc.get(comparison, "log_bayes_factors", name), 1),
                "by_itself": _by_itself(candidate),
                "error": fixed(error, 2) if is_number(error) else "",
                "by_model": [
                    fixed(doc.get(errors, "log_bayes_factors", name), 1)
                    for errors in doc.listed(comparison, "error_models")
                ],
                "probability": share(probability),
                "strength": f"{rounded(mean, decimals)} ± {rounded(sd, decimals)}"
                if is_number(mean)
                else "-",
                "unit": doc.get(facts_of(document, name), "unit") if candidate else "",
                "where": _where(candidate),
            }
        )
    return rows


def _by_itself(candidate: doc.Document | None) -> str:
    """The log Bayes factor without a force beside the mechanism; empty where none was looked for."""
    if doc.get(candidate, "residue") is None:
        return ""
    return fixed(doc.get(candidate, "log_bayes_factor_by_itself"), 1)


def _where(candidate: doc.Document | None) -> str:
    stretch = stretch_in(doc.get(candidate, "location"))
    if stretch is not None:
        return f"{stretch[0]:.0f} to {stretch[1]:.0f}"
    shape = doc.get(candidate, "shape")
    if is_number(begins := doc.get(shape, "s_from_m")):
        return f"from {begins:.0f} on"
    return printable(doc.get(shape, "sensor") or doc.get(shape, "covariate") or "-")


def error_rows(comparison: doc.Document) -> Rows:
    """The error models that were compared."""
    models = doc.listed(comparison, "error_models")
    heights = [_number(doc.get(model, "log_evidence")) for model in models]
    most = np.nanmax(heights) if np.isfinite(heights).any() else math.nan
    return [
        {
            "id": printable(doc.get(model, "id")),
            "title": printable(doc.get(model, "title")),
            "prior": share(doc.get(model, "prior")),
            "evidence": fixed(height - most, 1),
        }
        for model, height in zip(models, heights, strict=True)
    ]


PREDICTION_ERRORS = (
    ("rmse_velocity", "error of speeds, root mean square [m/s]", 1),
    ("rmse_runout", "error of runouts, root mean square [m]", 0),
    ("coverage_90", "readings inside their 90 % intervals [%]", 0),
)
"""Keys of the verdict less before and after, words, decimals; coverage as a share."""


def held_out_rows(document: doc.Document) -> Rows:
    """Errors and coverage before and after."""
    rows = []
    for key, words, decimals in PREDICTION_ERRORS:
        factor = 100.0 if key == "coverage_90" else 1.0
        values = [doc.get(document, "held_out", f"{key}_{when}") for when in ("before", "after")]
        texts = [fixed(factor * value if is_number(value) else None, decimals) for value in values]
        if any(map(is_number, values)):
            rows.append({"words": words, "before": texts[0], "after": texts[1]})
    before, after = (fixed(doc.get(document, "report", "log_score", when), 1) for when in ("before", "after"))
    words = "log score of avalanches left out, elpd [nats]"
    return [*rows, {"words": words, "before": before, "after": after}]


def trust_rows(document: doc.Document) -> Rows:
    """Convergence, importance sampling and refits of the base law and of each augmented one."""
    rows = []
    for entry in doc.listed(document, "report", "calibrations"):
        gate, left = doc.get(entry, "gate"), doc.get(entry, "left_out")
        ess = (doc.get(gate, f"ess_{which}_min") for which in ("bulk", "tail"))
        bulk, tail = (whole(value) for value in ess)
        rows.append(
            {
                "name": _calibrated(document, entry),
                "passed": doc.get(gate, "passed") is True,
                "r_hat": fixed(doc.get(gate, "r_hat_max"), 4),
                "ess_bulk": bulk,
                "ess_tail": tail,
                "divergences": whole(doc.get(gate, "divergences")),
                "problems": "; ".join(map(printable, doc.listed(gate, "problems"))),
                "k": fixed(doc.get(left, "pareto_k_max")) if left else "-",
                "n_bad": whole(doc.get(left, "n_unreliable")) if left else "-",
                "refitted": (_names(left, "refitted") or "none") if left else "-",
                "not_converged": _names(left, "not_converged"),
            }
        )
    return rows


def _calibrated(document: doc.Document, entry: doc.Document) -> str:
    """What was calibrated; the base law a second time under the errors of what was added."""
    errors = doc.get(entry, "errors")
    name = with_added(document, doc.listed(entry, "added"))
    return f"{name}, {printable(errors)}" if errors else name


def _names(entry: doc.Document | None, key: str) -> str:
    return ", ".join(map(printable, doc.listed(entry, key)))


def prior_rows(document: doc.Document) -> Rows:
    """Priors of the base law's strengths, and of every candidate's."""
    base = doc.listed(document, "report", "law", "mechanisms")
    compared = {name for one in doc.listed(document, "report", "comparisons")[:1] for name in shares_of(one)}
    facts = doc.get(document, "report", "mechanisms") or {}
    candidates = [one for name, one in facts.items() if name in compared and doc.get(one, "prior")]
    return [_prior(one, "base law") for one in base] + [_prior(one, "candidate") for one in candidates]


def _prior(facts: doc.Document, role: str) -> dict[str, str]:
    scale = doc.get(facts, "prior", "scale")
    return {
        "id": name_text(doc.get(facts, "id")),
        "role": role,
        "parameter": name_text(doc.get(facts, "parameter")),
        "kind": printable(doc.get(facts, "prior", "kind")),
        "scale": f"{scale:g}" if is_number(scale) else fixed(None),
        "unit": unit_text(doc.get(facts, "unit")),
        "reason": printable(doc.get(facts, "prior", "reason")),
    }


def settings_rows(document: doc.Document) -> list[tuple[str, Any]]:
    """Settings and times."""
    settings, seconds = (doc.get(document, key) or {} for key in ("settings", "seconds"))
    times = [(f"time: {name_text(stage)}", f"{fixed(value, 1)} s") for stage, value in seconds.items()]
    return [(name_text(key), value) for key, value in settings.items()] + times
