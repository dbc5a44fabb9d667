"""The page of a prediction: one HTML file that needs nothing else, made from its documents."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from skred.report.prediction.figures import FIGURES as ALONG_TRACK
from skred.report.prediction.places import has_places, places_figure
from skred.report.prediction.without_added import base_chance, comparison_rows
from skred.report.prediction.words import once, percent, period, ranged
from skred.report.shared import document as doc
from skred.report.shared.drawing import Picture, draw
from skred.report.shared.html import page
from skred.report.shared.numbers import three_digits
from skred.report.shared.style import write_svg

if TYPE_CHECKING:
    import xarray as xr

FIGURES = {**ALONG_TRACK, "places": places_figure}
"""Makers of all figures by their names."""
_SECTIONS = {
    "places": "At the named places",
    "without": "With and without what was added",
    "years": "How often in a year",
    "track": "Along the track",
    "pressure": "Impact pressure",
    "uncertainty": "Where the uncertainty comes from",
    "trust": "What this rests on",
    "made": "How it was made",
}


def save_prediction_figures(document: doc.Document, tree: xr.DataTree, folder: Path) -> dict[str, Picture]:
    """Make all figures that there are data for, and write them as PNG and SVG."""
    names = [name for name in FIGURES if name != "places" or has_places(document)]
    for name in names:
        write_svg(FIGURES[name](document, tree), folder / f"{name}.svg")
    return draw({name: partial(FIGURES[name], document, tree) for name in names}, folder)


def render_prediction(document: doc.Document, figures: Mapping[str, Picture]) -> str:
    """Render the page of a prediction.

    Parameters
    ----------
    document : mapping
        The content of ``prediction.json``.
    figures : mapping of str to Picture
        Figures by name, see `save_prediction_figures`.

    Returns
    -------
    str
        A self-contained page, see `skred.report.shared.html.page`.
    """
    compared = comparison_rows(document)
    has = {
        "places": has_places(document),
        "without": bool(compared),
        "years": doc.get(document, "rate") is not None and (has_places(document) or bool(_once_in(document))),
        "pressure": has_places(document),
    }
    valid = doc.get(document, "valid") is True
    sections = {name: title for name, title in _SECTIONS.items() if has.get(name, valid or name == "made")}
    return page(
        "prediction.html.jinja",
        figures,
        d=document,
        valid=valid,
        sections=sections,
        number={name: k for k, name in enumerate(sections, 1)},
        lead=_lead(document) if valid else list(doc.listed(document, "statement")),
        caveats=[line for line in doc.listed(document, "statement") if is_caveat(line)],
        left_out=_left_out(document),
        added=_added_terms(document),
        once_in=_once_in(document),
        compared=compared,
        percent=percent,
        period=period,
        once=once,
        ranged=ranged,
    )


_CAVEATS = (
    "Priors ",
    "Probabilities ",
    "Recorded avalanches ",
    "Intervals ",
    "Impact pressure ",
    "The population ",
)


def is_caveat(line: Any) -> bool:
    """Whether a sentence of the statement is a condition of the prediction."""
    return str(line).startswith(_CAVEATS)


def _lead(document: doc.Document) -> list[str]:
    """The answer for someone who reads nothing else."""
    told = [str(line) for line in doc.listed(document, "warnings")]
    for k, place in enumerate(doc.listed(document, "at")):
        chance = percent(doc.get(place, "reached", "value"))
        low, high = (percent(doc.get(place, "reached", end)) for end in ("low", "high"))
        name = "The reference" if place["name"] == "reference" else str(place["name"])
        told.append(
            f"{name} (s = {place['s_m']:.0f} m): {chance} of avalanches like those recorded come here"
            f" (90 % interval {low} to {high}).{_fast(place)}{_period(place)}"
            f"{base_chance(document, k)}"
        )
    if not doc.listed(document, "at"):
        rows = doc.listed(document, "runout", "exceeded_by")
        said = "; ".join(
            f"{100 * row['share']:g} % run {'at least to' if row['at_least'] else 'beyond'}"
            f" s = {row['value']:.0f} m"
            for row in rows
        )
        told.append(f"Of avalanches like those recorded, {said}.")
    return told


def _fast(place: doc.Document) -> str:
    """How fast, and with which pressure, the usual one of those that come is."""
    rows = [doc.listed(place, name, "given_reached") for name in ("speed", "pressure")]
    if not all(rows):
        return " Too few come to say how fast."
    speed, pressure = rows[0][1]["value"], rows[1][1]["value"]
    return (
        f" One in ten of these is faster than {three_digits(speed)} m/s,"
        f" and one in ten presses with more than {three_digits(pressure)} kPa."
    )


def _period(place: doc.Document) -> str:
    band = doc.get(place, "reached", "return_period_years")
    return (
        "" if band is None else f" With the given frequency one comes every {period(band)} years on average."
    )


def _once_in(document: doc.Document) -> list[doc.Document]:
    """Runouts for return periods, if some were asked for."""
    return doc.listed(document, "runout", "once_in") if doc.get(document, "valid") is True else []


def _added_terms(document: doc.Document) -> list[str]:
    """What moved the fronts besides the law's own terms, each once, and where."""
    told = []
    for row in doc.listed(document, "added"):
        if row["used"] is True:
            place = row["place_m"]
            where = f" from s = {place[0]:.0f} to {place[1]:.0f} m" if place else ""
            if row.get("begins_m") is not None and doc.get(document, "track", "is_own"):
                where = f" from s = {row['begins_m']:.0f} m on"
            told.append(f"{row['title']}{where}")
    return list(dict.fromkeys(told))


def _left_out(document: doc.Document) -> list[doc.Document]:
    """What does not act here, each once: a force in no list has a row for each of its knots."""
    rows = [row for row in doc.listed(document, "added") if row["used"] is False]
    return list({str(row["title"]): row for row in rows}.values())
