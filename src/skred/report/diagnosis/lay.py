"""The first paragraph of a diagnosis, for readers who know avalanches and no statistics."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skred.report.diagnosis.words import ends_in, law_id, short_title, stretch_in
from skred.report.shared import document as doc
from skred.report.shared.labels import printable
from skred.report.shared.numbers import decimals_for, is_number, rounded

_SURE, _LIKELY = 0.95, 0.75
_WAYS = {
    "sensor_bias": (", which reads high", ", which reads low"),
    "sensor_place": (", {:.0f} m further down than noted", ", {:.0f} m further up than noted"),
}
"""What a positive strength and a negative one say of a sensor."""


def lay_words(document: doc.Document) -> list[str]:
    """Sentences that say what was asked, what came out, and what to make of it.

    No log odds, no nats, no Pareto k: numbers are counts, places, speeds and distances.
    """
    return [_asked(document), *_answer(document), *_hangs_on(document), *_use(document)]


def _asked(document: doc.Document) -> str:
    n = doc.get(document, "report", "campaign", "n_events")
    recorded = f"the {n} avalanches" if is_number(n) else "the avalanches"
    return (
        f"A simple model ({law_id(document)}) was fitted to {recorded} recorded at"
        f" {printable(doc.get(document, 'campaign') or 'this path')}."
        " Question: do the recordings show a force, or an error of an instrument, that the model leaves out?"
    )


def _answer(document: doc.Document) -> list[str]:
    verdict = str(doc.get(document, "verdict"))
    where = _between(document)
    if verdict == "nothing_missing":
        return ["Answer: no. Something of a size that matters would mostly have been found here."]
    if verdict == "unexplained":
        return [
            f"{_answer_of(document)}: yes, something is missing{where},"
            " but no cause on the list accounts for it.",
            "The report shows how strongly it brakes or drives the avalanches, and where.",
        ]
    if verdict in ("missing_physics", "instrument"):
        return [_named(document, verdict, where), *_tied(document), *_still_missing(document)]
    return [
        "Answer: these recordings cannot tell. That does not mean that nothing is missing.",
        *_more(document),
    ]


def _answer_of(document: doc.Document) -> str:
    """That it is the answer; and of how few avalanches, where few carry it."""
    few = len(doc.listed(document, "influence", "carried_by"))
    n = doc.get(document, "report", "campaign", "n_events")
    carry = "carries" if few == 1 else "carry"
    return f"Answer, which only {few} of the {n} avalanches {carry}" if few and is_number(n) else "Answer"


def _named(document: doc.Document, verdict: str, where: str) -> str:
    name = short_title(document, doc.get(document, "mechanism") or "something") + _which(document)
    what = "something in the recordings is off" if verdict == "instrument" else "a force is missing"
    if doc.get(document, "report", "disputed"):
        what = "a force is missing, or the recordings are off"
    entries = doc.listed(document, "mechanisms")
    if len({doc.get(one, "group") for one in entries}) > 1:
        what = "a force is missing, and the recordings are off"
    probability = doc.get(document, "probability", str(doc.get(document, "mechanism")))
    sure = _how_sure(probability, doc.listed(document, "indistinguishable")) or "yes"
    more = "".join(_second(document, number, one) for number, one in enumerate(entries) if number > 0)
    return f"{_answer_of(document)}: {sure}, {what}: {name}{where}{more}."


def _which(document: doc.Document) -> str:
    """Which sensor is off, and which way; or the property that friction goes with."""
    about = doc.get(document, "sensor") or doc.get(document, "covariate")
    mean = doc.get(document, "strength", "mean")
    if not about:
        return ""
    way = _WAYS.get(str(doc.get(document, "mechanism"))) if is_number(mean) else None
    return f" ({printable(about)}{'' if way is None else way[mean < 0.0].format(abs(mean))})"


def _second(document: doc.Document, number: int, entry: doc.Document) -> str:
    """What was found given the first, how surely, and what recordings cannot tell from it."""
    names = [doc.get(entry, "id"), *doc.listed(entry, "tied_with")]
    about = doc.get(entry, "sensor") or doc.get(entry, "covariate")
    first, *tied = (short_title(document, one) for one in names)
    comparisons = doc.listed(document, "report", "comparisons")
    comparison = comparisons[number] if number < len(comparisons) else {}
    sure = _how_sure(doc.get(comparison, "probability", str(names[0])), tied)
    either = "".join(f" or {one}" for one in tied)
    how = f", {sure}," if sure else ""
    return f"; beside it{how} {first}{f' ({printable(about)})' if about else ''}{either}"


def _how_sure(probability: Any, tied: Sequence[Any]) -> str:
    """How probable a name is, in words; empty where others are about as probable."""
    if not is_number(probability) or probability < _LIKELY:
        return "" if tied else "most probably"
    return "almost surely" if probability >= _SURE else "very probably"


def _still_missing(document: doc.Document) -> list[str]:
    """That the law fails the check also with what was added, where it does."""
    left, limit = doc.get(document, "p_value_augmented"), doc.get(document, "report", "limits", "p_value")
    if not is_number(left) or not is_number(limit) or left > limit:
        return []
    return ["Even so the model does not fit: something more is missing, or the same in another form."]


def _tied(document: doc.Document) -> list[str]:
    tied = doc.listed(document, "indistinguishable")
    if not tied:
        return []
    it = "it" if len(doc.listed(document, "mechanisms")) < 2 else "the first"
    others = _either([short_title(document, one) for one in tied])
    return [f"These recordings cannot tell {it} from {others}."]


def _between(document: doc.Document) -> str:
    location = doc.get(document, "location")
    stretch = stretch_in(location)
    if stretch is None:
        return ""
    known = ", ".join(
        f"{what} at {first:.0f} to {last:.0f}"
        for what, (first, last) in zip(("begins", "ends"), ends_in(location), strict=False)
    )
    place = f" between {stretch[0]:.0f} and {stretch[1]:.0f} m along the track"
    return f"{place} ({known})" if known else place


def _hangs_on(document: doc.Document) -> list[str]:
    """What would be without the avalanches that carry the answer, where few do."""
    carried = list(map(printable, doc.listed(document, "influence", "carried_by")))
    if not carried:
        return []
    return [f"Take it with care: without {_either(carried, 'and')} {_otherwise(document)}."]


def _otherwise(document: doc.Document) -> str:
    """What would be said without them."""
    rival = doc.get(document, "influence", "rival")
    if doc.listed(rival, "carried_by") != doc.listed(document, "influence", "carried_by"):
        return "the odds would not suffice for it"
    left, errs_by = doc.get(rival, "without_them"), doc.get(document, "report", "limits", "influence_errs_by")
    sure = is_number(left) and is_number(errs_by) and left < -errs_by
    how = "more probable" if sure else "about as probable"
    return f"another answer would be {how}: {short_title(document, str(doc.get(rival, 'id')))}"


def _use(document: doc.Document) -> list[str]:
    """What the new term buys, and what it is."""
    if not doc.listed(document, "mechanisms") and not doc.get(document, "profile"):
        return []
    parts = list[str]()
    for key, words, unit, decimals in (("velocity", "speeds", "m/s", 1), ("runout", "runouts", "m", 0)):
        before, after = (doc.get(document, "held_out", f"rmse_{key}_{when}") for when in ("before", "after"))
        if is_number(before) and is_number(after):
            decimals = max(decimals, *(decimals_for(one) or 0 for one in (before, after)))
            ends = [rounded(one, decimals) for one in (before, after)]
            goes = "" if any(part.startswith("goes") for part in parts) else "goes "
            way = f"stays at {ends[0]}" if ends[0] == ends[1] else f"{goes}from {ends[0]} to {ends[1]}"
            parts.append(f"{way} {unit} for {words}")
    told = []
    if parts:
        told = [f"With it, the typical error for avalanches that were left out {' and '.join(parts)}."]
    gains = {doc.get(one, "gain") for one in doc.listed(document, "conditional", "sensors")} - {None}
    if gains and "better" not in gains:
        told.append("Predicted from the readings further up, no reading is clearly predicted better.")
    return [*told, "A name is the best of a list of simple causes. It is no proof of a cause."]


def _more(document: doc.Document) -> list[str]:
    where = doc.get(document, "detection_sensor", "s_from_m")
    return [f"One more speed sensor would help most at s = {where:.0f} m."] if is_number(where) else []


def _either(names: Sequence[Any], word: str = "or") -> str:
    return names[0] if len(names) == 1 else f"{', '.join(map(str, names[:-1]))} {word} {names[-1]}"
