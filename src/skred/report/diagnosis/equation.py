"""The equation of motion with its new term, and what its symbols mean, as rows of text."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any

from skred.report.diagnosis.words import INSTRUMENT, facts_of, stretch_in, title_of
from skred.report.shared import document as doc
from skred.report.shared.labels import name_text, population_role, printable, symbol_text
from skred.report.shared.numbers import decimals_for, is_number, rounded, whole

if TYPE_CHECKING:
    from markupsafe import Markup

_HEAD = "dU^2/(2 ds) ="
_SIMPLE = [
    ("U", "m s-1", "speed of the front"),
    ("s", "m", "length along the track, downhill"),
    ("phi", "rad", "slope of the track"),
    ("kappa", "m-1", "curvature of the track, positive where it is concave"),
    ("g", "m s-2", "gravity, 9.81 m/s²"),
]
_CONSTANTS = {
    "loss": ("l", "loss"),
    "J/gh": ("J/gh", "what every front that passes loses for good, as a share of the climb"),
}
"""Symbol and meaning of constants of shapes that their name alone does not explain."""
_WORD = re.compile(r"[A-Za-z]+(?:_\w+)?")


def formula(text: str) -> Markup:
    """An equation in plain text with its Greek letters, powers and indices; everything else escaped."""
    from markupsafe import Markup, escape

    shown = str(escape(symbol_text(re.sub(r"_", " _", text))))
    shown = re.sub(r"\s_(\w+)", r"<sub>\1</sub>", shown)
    shown = re.sub(r"\^(\w+)", r"<sup>\1</sup>", shown)
    return Markup(shown.replace("- -", "- "))  # noqa: S704 (escaped above)


def equations(document: doc.Document) -> dict[str, Any]:
    """The base law's equation, with each new term, and what is read instead for an instrument's fault."""
    terms, readings = [], []
    for mechanism in doc.listed(document, "mechanisms"):
        equation = printable(doc.get(mechanism, "equation") or "")
        if doc.get(facts_of(document, str(doc.get(mechanism, "id"))), "kind") == INSTRUMENT:
            readings.append(formula(equation.partition(": ")[2] or equation))
        else:
            terms.append(formula("- " + equation.removeprefix("-")))
    profile = doc.get(document, "profile", "equation")
    if profile:
        terms.append(formula("- " + printable(profile).removeprefix("-")))
    right, relation = _right(document)
    return {
        "head": formula(_HEAD),
        "base": formula(right),
        "relation": formula(relation) if relation else "",
        "terms": terms,
        "readings": readings,
    }


def _right(document: doc.Document) -> tuple[str, str]:
    """Right-hand side of the law's equation, and the relation of its parameters."""
    equation, relation = (
        printable(doc.get(document, "report", "law", key) or "") for key in ("equation", "relation")
    )
    ending = f", {relation}" if relation else ""
    return equation.removeprefix(_HEAD).strip().removesuffix(ending), relation


def symbol_rows(document: doc.Document) -> list[dict[str, Any]]:
    """Symbol, unit, meaning and reference of everything in the equation."""
    rows, text = [], printable(doc.get(document, "report", "law", "equation") or "")
    for facts in doc.listed(document, "report", "law", "mechanisms"):
        name, title = name_text(doc.get(facts, "parameter")), printable(doc.get(facts, "title"))
        rows.append(_of_facts(facts, title if title.startswith(name) else f"{name}: {title}"))
    added = doc.listed(document, "report", "added")
    for number, mechanism in enumerate(doc.listed(document, "mechanisms")):
        rows += _added_rows(document, mechanism, added[number] if number < len(added) else {})
        text += printable(doc.get(mechanism, "equation") or "")
    rows += _profile_rows(doc.get(document, "profile"))
    present = set(re.findall(r"[A-Za-z]+", text)) | {"s", "U"}
    return rows + [_row(*one) for one in _SIMPLE if one[0] in present]


def _row(symbol: str, unit: Any, meaning: str, reference: str = "", new: bool = False) -> dict[str, Any]:
    return {"symbol": formula(symbol), "unit": unit, "meaning": meaning, "reference": reference, "new": new}


def _of_facts(facts: doc.Document, meaning: str, new: bool = False) -> dict[str, Any]:
    reference, doi = (printable(doc.get(facts, key) or "") for key in ("reference", "doi"))
    source = f"{reference}, doi {doi}" if doi else reference
    return _row(printable(doc.get(facts, "symbol") or ""), doc.get(facts, "unit"), meaning, source, new)


def _added_rows(document: doc.Document, mechanism: doc.Document, added: doc.Document) -> list[dict[str, Any]]:
    """Rows of a mechanism that was added: its coefficient, its place, its constants."""
    name = printable(doc.get(mechanism, "id"))
    mean, sd = (doc.get(mechanism, "strength", key) for key in ("mean", "sd"))
    decimals, facts = decimals_for(sd), facts_of(document, name)
    about = f"{name_text(doc.get(mechanism, 'strength', 'parameter'))}: {title_of(document, name)}"
    meaning = f"{about}; here {rounded(mean, decimals)} ± {rounded(sd, decimals)}"
    sensor, covariate = (doc.get(mechanism, key) for key in ("sensor", "covariate"))
    if sensor and is_number(mean) and abs(mean) < 10.0:
        percent = 100.0 * (math.exp(mean) - 1.0)
        high = "high" if percent > 0 else "low"
        meaning += f": {printable(sensor)} reads {abs(percent):.0f} % too {high}"
    rows = [_of_facts(facts, meaning, new=True), *_between_rows(mechanism)]
    rows += _place_rows(stretch_in(doc.get(mechanism, "location")), str(doc.get(mechanism, "equation") or ""))
    rows += _constant_rows(doc.get(mechanism, "constants") or {}, doc.get(added, "shape", "opposed") is True)
    if covariate:
        what = "logarithm standardised" if doc.get(added, "by_logarithm") else "standardised"
        rows.append(_row("x", "1", f"{printable(covariate)}, {what}", new=True))
    return rows


def _between_rows(mechanism: doc.Document) -> list[dict[str, Any]]:
    """What says how avalanches differ in a coefficient, where they do."""
    words = {
        "spread": ("omega", "standard deviation of its logarithm between avalanches: it is their median"),
        "share": ("pi", "share of the avalanches that it is present in"),
    }
    rows = []
    for key, (symbol, meaning) in words.items():
        mean, sd = (doc.get(mechanism, "strength", key, part) for part in ("mean", "sd"))
        if is_number(mean):
            rows.append(_row(symbol, "1", f"{meaning}, here {rounded(mean, 2)} ± {rounded(sd, 2)}", new=True))
    return rows


def _place_rows(stretch: tuple[float, float] | None, equation: str) -> list[dict[str, Any]]:
    """Where something acts, by the symbols that its equation has for that."""
    if stretch is None:
        return []
    first, last = stretch
    there = set(_WORD.findall(equation))
    middle, half = 0.5 * (first + last), 0.5 * (last - first)
    known = [
        ("s_1", "s_1, s_2", f"where the stretch begins and ends, here {first:.0f} and {last:.0f}"),
        ("s_o", "s_o", f"the middle of the place where it acts, here {middle:.0f}"),
        ("w", "w", f"half of the length on which it acts, here {half:.0f}"),
    ]
    rows = [_row(shown, "m", words, new=True) for symbol, shown, words in known if symbol in there]
    return rows or [_row("s", "m", f"acts between {first:.0f} and {last:.0f}", new=True)]


def _constant_rows(constants: doc.Document, opposed: bool) -> list[dict[str, Any]]:
    """Constants of a shape; the speeds at which a relief equals it as one."""
    known = {str(name): value for name, value in constants.items() if is_number(value)}
    if opposed and len(known) == 2:
        first, last = known.values()
        what = f"speed at which a driving force equals it, here {first:g} at s_1 to {last:g} at s_2"
        return [_row("U_0", "m s-1", what, new=True)]
    rows = []
    for named, value in known.items():
        symbol, _, unit = printable(named).partition(" [")
        short, meaning = _CONSTANTS.get(symbol, (symbol, symbol))
        rows.append(_row(short, unit.rstrip("]") or "1", f"{meaning}, here {value:g}", new=True))
    return rows


def _profile_rows(profile: doc.Document | None) -> list[dict[str, Any]]:
    """The force profile's symbols."""
    places = [place for place in doc.listed(profile, "s_m") if is_number(place)]
    if not places:
        return []
    what = f"the force profile: linear between {len(places)} places from {whole(places[0])} to"
    rows = [_row("f(s)", doc.get(profile, "unit"), f"{what} {whole(places[-1])} m", new=True)]
    if "U_0" in str(doc.get(profile, "equation")):
        rows.append(_row("U_0", "m s-1", "typical speed of the base law's fronts there", new=True))
    return rows


def parameter_rows(document: doc.Document) -> list[dict[str, Any]]:
    """All parameters, by the base law and by the augmented one."""
    return [
        {
            "name": _role(parameter),
            "symbol": formula(printable(doc.get(parameter, "symbol") or "")),
            "unit": doc.get(parameter, "unit"),
            "before": _interval_text(doc.get(parameter, "before")),
            "after": _interval_text(doc.get(parameter, "after")),
        }
        for parameter in doc.listed(document, "report", "parameters")
    ]


def held_places(document: doc.Document) -> list[str]:
    """Where the calibration holds each added strength, which over all places is another number."""
    sentences = []
    named = doc.listed(document, "mechanisms")
    for one, entry in zip(doc.listed(document, "report", "added"), named, strict=False):
        where, strength = _held_at(doc.get(one, "shape")), doc.get(entry, "strength")
        mean, sd = (doc.get(strength, key) for key in ("mean", "sd"))
        if where and is_number(mean) and is_number(sd):
            decimals = decimals_for(sd)
            sentences.append(
                f"{name_text(doc.get(one, 'parameter')).capitalize()} is calibrated at its most probable"
                f" place, {where}. Over all places, and with an uncertain form of the term, it is"
                f" {rounded(mean, decimals)} ± {rounded(sd, decimals)}."
            )
    return sentences


def _held_at(shape: doc.Document | None) -> str:
    """Where a shape acts, if it is not along the whole track."""
    stretch, begins = stretch_in(shape), doc.get(shape, "s_from_m")
    if stretch is not None:
        return f"s = {whole(stretch[0])} to {whole(stretch[1])} m"
    return f"from s = {whole(begins)} m on" if is_number(begins) else ""


def _role(parameter: doc.Document) -> str:
    name = doc.get(parameter, "name")
    if doc.get(parameter, "added"):
        return f"{name_text(name)}, added"
    role = population_role(name)
    return f"median {name_text(name)}" if role == "median" else role


def _interval_text(found: doc.Document | None) -> str:
    if not found:
        return ""
    decimals = decimals_for(doc.get(found, "sd"))
    mean, low, high = (rounded(doc.get(found, key), decimals) for key in ("mean", "low", "high"))
    return f"{mean} ({low} to {high})"
