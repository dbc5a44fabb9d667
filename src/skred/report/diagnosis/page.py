"""The page of a diagnosis: what its template is given."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from skred.report.diagnosis import rows, unseen
from skred.report.diagnosis.conditional import conditional_rows
from skred.report.diagnosis.equation import equations, held_places, parameter_rows, symbol_rows
from skred.report.diagnosis.events import MOST_OPEN, event_rows, reading_rows
from skred.report.diagnosis.evidence import group_of
from skred.report.diagnosis.lay import lay_words
from skred.report.diagnosis.words import comparisons, ends_in, in_words, law_id, stretch_in, verdict_words
from skred.report.shared import document as doc
from skred.report.shared import html
from skred.report.shared.labels import name_text, unit_text
from skred.report.shared.numbers import fixed, is_number
from skred.report.shared.recordings import recordings_of

if TYPE_CHECKING:
    import xarray as xr

    from skred.report.shared.drawing import Picture

_NO_FORCE = 1e-6
"""Retardation that is none [m s-2]."""
_SECTIONS = {
    "recorded": "What was recorded",
    "can-tell": "What these recordings can tell",
    "wrong": "Is anything wrong?",
    "where": "Where?",
    "what": "What?",
    "equation": "The equation with its new term",
    "before-after": "Before and after",
    "unseen": "Avalanches set aside",
    "trust": "How far to trust it",
}


def page(document: doc.Document, tree: xr.DataTree, figures: Mapping[str, Picture]) -> str:
    """Render the report of a diagnosis, see `skred.report.diagnosis.report.render_diagnosis`."""
    locked, folds = unseen.locked(document), unseen.outer_folds(document)
    sections = _sections(document, has_unseen=locked is not None or folds is not None)
    report = doc.get(document, "report") or {}
    checks = doc.listed(report, "checks")
    compared = [_comparison(document, number, one) for number, one in enumerate(comparisons(document))]
    return html.page(
        "diagnosis.html.jinja",
        figures,
        d=document,
        r=report,
        campaign=doc.get(report, "campaign") or {},
        limits=doc.get(report, "limits") or {},
        law=law_id(document),
        sections=sections,
        number={name: place for place, name in enumerate(sections, start=1)},
        verdict=verdict_words(document),
        sensors=rows.sensor_rows(tree),
        detectability=rows.detectability_rows(document),
        work=rows.work_rows(document),
        stretch=stretch_in(doc.get(document, "location")),
        ends=ends_in(doc.get(document, "location")),
        first_sensor=_first_sensor(tree),
        comparisons=compared,
        equations=equations(document),
        symbols=symbol_rows(document),
        parameters=parameter_rows(document),
        held_places=held_places(document),
        held=rows.held_out_rows(document),
        given=conditional_rows(document),
        difference=_difference(document),
        locked=locked,
        folds=folds,
        trust=rows.trust_rows(document),
        priors=rows.prior_rows(document),
        settings=rows.settings_rows(document),
        force_prior=_force_prior(doc.get(report, "profile_prior")),
        lay=lay_words(document),
        events=event_rows(document, tree),
        own=_way(document),
        readings=reading_rows(tree),
        most_open=MOST_OPEN,
        checks=checks,
        none_as_odd=_none_as_odd(checks),
        dropped=in_words(doc.listed(report, "not_added")),
        flat=not _number(doc.get(report, "force", "largest"), 1.0) > _NO_FORCE,
    )


def _number(value: Any, otherwise: float) -> float:
    return float(value) if is_number(value) else otherwise


def _none_as_odd(checks: list[Any]) -> bool:
    """Whether no clean campaign of the last law has odds like those of the recordings."""
    p_value, n = (doc.get(checks[-1] if checks else {}, key) for key in ("p_value", "n_simulated"))
    return is_number(p_value) and is_number(n) and p_value * (n + 1) < 1.5


def _first_sensor(tree: xr.DataTree) -> float | None:
    """Where the uppermost sensor begins [m]; None where only runouts were recorded."""
    places = [one.s_from_m for one in recordings_of(tree).sensors if not one.is_runout]
    return min(places, default=None)


def _way(document: doc.Document) -> str:
    """How avalanches differ in what was added, where their table says what each has."""
    way = str(doc.get(document, "strength", "between_events") or "")
    return way if doc.listed(document, "strength", "events") else ""


def _sections(document: doc.Document, *, has_unseen: bool) -> dict[str, str]:
    """Titles of the sections by their anchors, in their order."""
    sections = dict(_SECTIONS)
    if not doc.listed(document, "mechanisms") and not doc.get(document, "profile"):
        sections["equation"] = "The equation"
        sections["before-after"] = "How well avalanches left out are predicted"
    if not has_unseen:
        del sections["unseen"]
    return sections


def _comparison(document: doc.Document, number: int, comparison: doc.Document) -> dict[str, Any]:
    """A comparison, with the names of its figures."""
    return {
        "figures": {name: group_of(name, number) for name in ("probabilities", "strength", "places")},
        "rows": rows.comparison_rows(document, comparison),
        "errors": rows.error_rows(comparison),
        "added": name_text(doc.get(comparison, "added") or ""),
        "ties": in_words(doc.listed(comparison, "tied_with")),
        "same": in_words(doc.listed(comparison, "same_term")),
    }


def _difference(document: doc.Document) -> dict[str, Any] | None:
    """The difference of the log scores, its doubled standard error, and whether it counts."""
    value, se = (doc.get(document, "evidence", key) for key in ("elpd_diff", "elpd_se"))
    if not is_number(value):
        return None
    least = _number(doc.get(document, "report", "limits", "practical_difference"), 0.0)
    score = doc.get(document, "report", "log_score")
    return {
        "value": fixed(value, 1, signed=True),
        "doubled": fixed(2.0 * se if is_number(se) else None, 1),
        "practical": abs(value) >= least,
        "clear": is_number(se) and abs(value) > 2.0 * se,
        "better": doc.get(score, "n_better"),
        "of": doc.get(score, "n_events"),
    }


def _force_prior(prior: doc.Document | None) -> dict[str, str] | None:
    """What a force that is not in the list is thought to be like beforehand, in words."""
    if not prior:
        return None
    scales = [
        f"{_plain(doc.get(kind, 'sd'))} {unit_text(doc.get(kind, 'unit'))}"
        + (", nil at the typical speed" if doc.get(kind, "nil_at_typical_speed") else "")
        for kind in doc.listed(prior, "kinds")
    ]
    times, lengths = (doc.listed(prior, key) for key in ("sd_times", "correlation_lengths_m"))
    return {
        "times": ", ".join(f"{part:.2g}" for part in times if is_number(part)),
        "scales": "; ".join(scales),
        "lengths": ", ".join(f"{length:.0f}" for length in lengths if is_number(length)),
        "window": fixed(doc.get(prior, "window_m"), 0),
    }


def _plain(value: Any) -> str:
    return f"{value:g}" if is_number(value) else fixed(None)
