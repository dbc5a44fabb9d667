"""Words and colours of a diagnosis that its figures, tables and page share, read off its document."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skred.report.shared import document as doc
from skred.report.shared.labels import name_text, printable, unit_text
from skred.report.shared.numbers import is_number
from skred.report.shared.style import GREY

BEFORE, AFTER, MISMATCH = GREY, "#0072B2", "#D55E00"
"""Predictions by the base law and by the augmented one; the place where something is missing."""
PHYSICS, INSTRUMENT, UNLISTED, NOTHING = "physics", "instrument", "unlisted", "nothing"
"""Kinds of candidates; the last two are ids as well."""
_COLOURS = {PHYSICS: "#0072B2", INSTRUMENT: "#CC79A7", UNLISTED: "#E69F00", NOTHING: GREY}
_KINDS = {
    PHYSICS: "listed physics", INSTRUMENT: "instrument", UNLISTED: "not in the list", NOTHING: "nothing",
}  # fmt: skip
_VERDICTS = {
    "missing_physics": "Physics is missing",
    "nothing_missing": "Nothing is missing",
    "instrument": "The recordings are off",
    "unexplained": "Something is missing that is not in the list",
    "cannot_tell": "These recordings cannot tell",
}


def verdict_words(document: doc.Document) -> str:
    """The verdict in a few words."""
    if doc.get(document, "report", "disputed"):
        return "Physics is missing, or the recordings are off"
    verdict = doc.get(document, "verdict")
    return _VERDICTS.get(str(verdict), name_text(verdict or "n/a"))


def facts_of(document: doc.Document, name: str) -> doc.Document:
    """What the document says of a mechanism, or of the two ids that are none; empty where nothing."""
    return doc.get(document, "report", "mechanisms", name) or {}


def title_of(document: doc.Document, name: Any) -> str:
    """An id in plain words; the id itself where the document has none."""
    return printable(doc.get(facts_of(document, str(name)), "title") or name)


def short_title(document: doc.Document, name: Any) -> str:
    """The same without the examples after its colon."""
    return title_of(document, name).partition(":")[0]


def in_words(names: Sequence[Any]) -> list[str]:
    """Ids as they are in tables; the force in no list in words."""
    return ["a force not in the list" if name == UNLISTED else name_text(name) for name in names]


def kind_of(document: doc.Document, name: str) -> str:
    """What an id blames, in words."""
    return _KINDS[_kind(document, name)]


def colour_of(document: doc.Document, name: str) -> str:
    """One colour for each kind of candidate."""
    return _COLOURS[_kind(document, name)]


def kinds() -> list[tuple[str, str]]:
    """Words and colour of each kind."""
    return [(_KINDS[kind], colour) for kind, colour in _COLOURS.items()]


def _kind(document: doc.Document, name: str) -> str:
    kind = str(doc.get(facts_of(document, name), "kind") or name)
    return kind if kind in _KINDS else PHYSICS


def bracketed(unit: Any) -> str:
    """A unit in brackets for an axis; nothing where there is none."""
    return "" if unit in ("1", None) else f" [{unit_text(unit)}]"


def comparisons(document: doc.Document) -> list[doc.Document]:
    """The model comparisons, the first one without anything added."""
    return doc.listed(document, "report", "comparisons")


def shares_of(comparison: doc.Document) -> dict[str, float]:
    """Probability of each candidate that has one, most probable first."""
    shares = doc.get(comparison, "probability") or {}
    known = {str(name): float(share) for name, share in shares.items() if is_number(share)}
    return dict(sorted(known.items(), key=lambda item: -item[1]))


def leading_name(comparison: doc.Document) -> str:
    """What was added from a comparison, or else its most probable mechanism; empty where there is none."""
    added = doc.get(comparison, "added")
    if added is not None:
        return str(added)
    return next((name for name in shares_of(comparison) if name not in (NOTHING, UNLISTED)), "")


def stretch_in(entry: doc.Document | None) -> tuple[float, float] | None:
    """Ends of a ``location`` [m]; None where it has none."""
    ends = [doc.get(entry, key) for key in ("s_from_m", "s_to_m")]
    return (float(ends[0]), float(ends[1])) if all(map(is_number, ends)) else None


def ends_in(entry: doc.Document | None) -> list[Any]:
    """Intervals of both ends of a ``location`` [m]; empty where it has none."""
    ends = [doc.listed(entry, f"s_{end}_interval_m") for end in ("from", "to")]
    return ends if all(len(one) == 2 and all(map(is_number, one)) for one in ends) else []


def blamed_sensors(document: doc.Document) -> set[str]:
    """Sensors that the verdict blames."""
    return {
        str(doc.get(one, "sensor")) for one in doc.listed(document, "mechanisms") if doc.get(one, "sensor")
    }


def law_id(document: doc.Document) -> str:
    """Id of the base law."""
    return printable(doc.get(document, "base_model") or "the law")


def law_title(document: doc.Document) -> str:
    """Title of the base law."""
    return printable(doc.get(document, "report", "law", "title") or law_id(document))


def with_added(document: doc.Document, added: Sequence[Any]) -> str:
    """The base law and what was added to it, as a sum."""
    names = ["the force profile" if name == UNLISTED else printable(name) for name in added]
    return " + ".join([law_id(document), *names])
