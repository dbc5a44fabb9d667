"""The comparison report: one HTML file that needs nothing else, neither network nor script."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from skred.report.comparison.lay import lay_words
from skred.report.comparison.pit import pit_rows
from skred.report.comparison.ranking import event_rows, order_rows, rival_rows
from skred.report.shared import document as doc
from skred.report.shared.html import page
from skred.report.shared.numbers import decimals_for, fixed, is_number, rounded
from skred.report.shared.relative import relative_new_avalanche, relative_response

if TYPE_CHECKING:
    from skred.report.shared.drawing import Picture

_TITLES = {
    "comparison_elpd": "Differences of elpd to the best law, with their standard errors, single and doubled.",
    "pointwise": "Elpd of each event under each law, less that under the best law.",
    "pareto_k": "Pareto k of each event: above the limit, importance sampling cannot be trusted.",
    "predictions": "Mean response of each law at each sensor against the mean of the recordings.",
    "evidence": "Log evidence of each law; every seed is a point.",
    "ranking": "Difference of elpd to the best law: without each avalanche, and without more and more of"
    " those that favour the best law most; above 0 the order has turned.",
    "loo_pit": "Share of readings that lie below a place in their prediction, less what is expected: a line"
    " within the band says nothing against the predictions. A hump: readings are lower than predicted; a"
    " trough: higher. First below and then above 0: predictions are not sure enough; the other way round: too"
    " sure.",
    "trace": "Traces of all chains, and the ranks of their draws.",
    "joint": "Joint posterior of the parameters with marginal histograms.",
    "marginals": "Posterior of each parameter against its prior density.",
    "predictive": "Recorded readings, mean response and predictive distribution at each sensor.",
    "along_track": "Front speed along the track with recordings, and the terrain.",
}
_HIERARCHICAL_TITLES = {
    "predictions": "A new avalanche under each law at each sensor against the recorded ones.",
    "likelihoods": "Differences of elpd to the best law: every avalanche its own friction, and pooled.",
    "joint": "Joint posterior of the medians, spreads and correlations across avalanches.",
    "new_avalanche": "A new avalanche at each sensor, with its 50 and 90 % intervals, and what was recorded.",
    "population": "Friction across avalanches: where 50 and 90 % of new ones lie, and each recorded one.",
    "events": "Each recorded avalanche's own friction: median, 50 and 90 %; new avalanches behind.",
    "along_track": "Front speed of new avalanches; apart from it, how well their median is known.",
}
_OF_A_LAW = ("marginals", "joint", "predictive", "along_track", "trace")
_NORMAL_90, _MOST_SPREAD = 1.645, 20.0
_OF_A_POPULATION = ("new_avalanche", "population", "events")
_SECTIONS = {
    "recorded": "What was recorded",
    "preferred": "Which law the recordings prefer, and by how much",
    "change": "What would change the ranking",
    "foretold": "Are the predictions as sure as they should be?",
    "trust": "Can the chains be trusted?",
    "population": "Every avalanche its own friction",
    "likelihoods": "Pooled and hierarchical side by side",
    "errors": "Error models, compared",
    "laws": "Each law",
    "predicted": "Predicted against recorded",
    "alpha-beta": "The alpha-beta baseline",
    "made": "How the numbers were made",
}


def render_comparison(comparison: doc.Document, figures: Mapping[str, Picture]) -> str:
    """Render the report of a comparison.

    Parameters
    ----------
    comparison : mapping
        The document that is also written as ``compare.json``; null where there is no number. Runouts in
        ``response`` and ``new_avalanche`` are arc lengths, shown relative to the campaign's reference where
        it has one. Where ``alpha_beta`` is null, ``alpha_beta_reason`` says why.
    figures : mapping of str to Picture
        ``comparison_elpd``, ``pointwise``, ``pareto_k``, ``predictions``, ``evidence``,
        ``likelihoods``, and those of one law as ``<law id>/trace`` and so on, see
        `skred.report.calibration.figures.save_model_figures`. What is missing is left out.

    Returns
    -------
    str
        A self-contained page, see `skred.report.shared.html.page`.
    """
    hierarchical = doc.is_hierarchical(comparison)
    sections = _sections(comparison)
    return page(
        "compare.html.jinja",
        figures,
        c=comparison,
        models=doc.models(comparison),
        ranked=doc.ranked(comparison),
        failed=doc.failed(comparison),
        sensors=_sensors(comparison),
        hierarchical=hierarchical,
        sections=sections,
        number={name: place for place, name in enumerate(sections, start=1)},
        side_by_side=doc.side_by_side(comparison),
        titles={**_TITLES, **_HIERARCHICAL_TITLES} if hierarchical else _TITLES,
        of_a_law=_OF_A_LAW,
        of_a_population=_OF_A_POPULATION,
        limits=doc.get(comparison, "limits") or {},
        k_limit=doc.pareto_k_limit(comparison),
        counts=_counts,
        lay=lay_words(comparison),
        rivals=rival_rows(comparison),
        orders=order_rows(comparison),
        events=event_rows(comparison),
        pits=pit_rows(comparison),
        within_factor=_within_factor,
        relative=relative_response,
        relative_new=relative_new_avalanche,
    )


def _sections(comparison: doc.Document) -> dict[str, str]:
    """Titles of the report's sections by their anchors, in their order."""
    hierarchical = doc.is_hierarchical(comparison)
    has = {
        "population": hierarchical,
        "likelihoods": hierarchical and doc.get(comparison, "pooled") is not None,
        "change": bool(rival_rows(comparison)),
        "foretold": bool(pit_rows(comparison)),
        "errors": hierarchical and bool(doc.listed(comparison, "error_models")),
    }
    return {name: title for name, title in _SECTIONS.items() if has.get(name, True)}


def _sensors(comparison: doc.Document) -> list[Any]:
    """Sensors of all laws' responses or new avalanches, in their order."""
    key = "new_avalanche" if doc.is_hierarchical(comparison) else "response"
    names = (doc.get(entry, "sensor") for m in doc.models(comparison) for entry in doc.listed(m, key))
    return list(dict.fromkeys(names))


def _within_factor(parameter: doc.Document) -> str:
    """Factor of the median that 90 % of avalanches lie within, from a spread of logarithms."""
    mean, sd = doc.get(parameter, "mean"), doc.get(parameter, "sd")
    if not (is_number(mean) and is_number(sd)) or mean > _MOST_SPREAD:
        return fixed(None)
    factor = math.exp(_NORMAL_90 * mean)
    return rounded(factor, decimals_for(_NORMAL_90 * sd * factor))


def _counts(difference: Any) -> str:
    """Whether a difference matters in practice, in words."""
    return {True: "yes", False: "no"}.get(difference, "n/a")
