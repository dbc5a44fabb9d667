"""The page of one law's calibration: one HTML file that needs nothing else."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from skred.report.shared import document as doc
from skred.report.shared.html import page
from skred.report.shared.labels import name_text, printable, unit_text
from skred.report.shared.numbers import decimals_for, fixed, is_number, rounded, share, whole
from skred.report.shared.relative import relative_new_avalanche, relative_response

if TYPE_CHECKING:
    from skred.report.shared.drawing import Picture

_WORDS = {
    "marginals": "Posterior of each parameter against its prior density.",
    "joint": "Joint posterior of the parameters with marginal histograms.",
    "predictive": "Recorded readings, mean response and predictive distribution at each sensor.",
    "new_avalanche": "A new avalanche at each sensor, with its 50 and 90 % intervals, and what was recorded.",
    "population": "Friction across avalanches: where 50 and 90 % of new ones lie, and each recorded one.",
    "events": "Each recorded avalanche's own friction: median, 50 and 90 %; new avalanches behind.",
    "along_track": "Front speed along the track with recordings, and the terrain.",
    "trace": "Traces of all chains, and the ranks of their draws.",
}


def render_calibration(document: doc.Document, figures: Mapping[str, Picture]) -> str:
    """Render the page of a calibration.

    Parameters
    ----------
    document : mapping
        The content of ``summary.json``; anything may be null.
    figures : mapping of str to Picture
        By name, see `skred.report.calibration.figures.save_model_figures`; what is missing is left out.

    Returns
    -------
    str
        A self-contained page, see `skred.report.shared.html.page`.
    """
    hierarchical = doc.get(document, "likelihood") == "hierarchical"
    return page(
        "calibration.html.jinja",
        figures,
        d=document,
        lay=lay_words(document),
        words=_WORDS,
        hierarchical=hierarchical,
        fit=_fit_rows(document),
        responses=[relative_response({}, one) for one in doc.listed(document, "response")],
        new=[relative_new_avalanche({}, one) for one in doc.listed(document, "new_avalanche")],
        settings=doc.get(document, "settings") or {},
        versions=doc.get(document, "versions") or {},
    )


def lay_words(document: doc.Document) -> list[str]:
    """Sentences for readers who know avalanches and no statistics."""
    law, campaign = (printable(doc.get(document, key) or "?") for key in ("id", "campaign"))
    told = [
        f"A simple model ({law}) was fitted to the avalanches recorded at {campaign}: which friction makes it"
        " move as they did, and how surely is that known?"
    ]
    if doc.get(document, "gate", "passed") is not True:
        return [
            *told,
            "The computation did not come to an end that can be trusted. Do not use these numbers.",
        ]
    told += _known(document)
    if doc.get(document, "fits") is False:
        missed = [one["sensor"] for one in _fit_rows(document) if one["misfit"] == "yes"]
        told.append(f"The model does not describe what was recorded at {', '.join(missed)}.")
    elif doc.get(document, "fits") is True:
        told.append(
            "The check below compares the average of what each sensor recorded, and how much that varies,"
            " with the model, and found no disagreement. That says little, because the model was adjusted to"
            " the same recordings. Another model can still be better: compare it with others."
        )
    what = "single new avalanches" if doc.listed(document, "new_avalanche") else "the mean of many avalanches"
    return [*told, f"The predictions below are of {what}. All numbers hold for this path only."]


def _known(document: doc.Document) -> list[str]:
    """What the parameters are, and how surely; of a population its medians."""
    parts = []
    for one in doc.listed(document, "parameters"):
        values = [doc.get(one, key) for key in ("mean", "low", "high")]
        name = printable(doc.get(one, "name"))
        if not all(map(is_number, values)) or name.endswith(("_spread", "_correlation")):
            continue
        decimals = decimals_for(doc.get(one, "sd"))
        mean, low, high = (rounded(value, decimals) for value in values)
        unit = unit_text(doc.get(one, "unit"))
        parts.append(
            f"{name_text(name)} {mean}{'' if unit == '-' else f' {unit}'} (between {low} and {high})"
        )
    return [f"Answer: {'; '.join(parts)}."] if parts else []


def _fit_rows(document: doc.Document) -> list[dict[str, Any]]:
    """What was recorded at each sensor beside what such recordings would be, as text."""
    rows = []
    for one in doc.listed(document, "fit"):
        places = [decimals_for(doc.get(one, key)) for key in ("predicted_mean_se", "predicted_sd")]
        values = {
            key: rounded(doc.get(one, key), place)
            for key, place in zip(
                ("recorded_mean", "recorded_sd", "predicted_mean", "predicted_sd", "predicted_mean_se"),
                (places[0], places[1], places[0], places[1], places[0]),
                strict=True,
            )
        }
        inside = doc.get(one, "inside")
        rows.append(
            {
                "sensor": printable(doc.get(one, "sensor")),
                "unit": unit_text(doc.get(one, "unit")),
                "n": whole(doc.get(one, "n_recorded")),
                **values,
                "inside": share(inside) if is_number(inside) else fixed(None),
                "p_mean": share(doc.get(one, "p_mean")) if is_number(doc.get(one, "p_mean")) else fixed(None),
                "p_sd": share(doc.get(one, "p_sd")) if is_number(doc.get(one, "p_sd")) else fixed(None),
                "misfit": {True: "no", False: "yes"}.get(doc.get(one, "fits"), "n/a"),
            }
        )
    return rows
