"""Tables of a scorecard: cells as text, with their intervals and numbers of trials."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from skred.report.shared.document import Document, get, listed
from skred.report.shared.labels import name_text, unit_text
from skred.report.shared.numbers import fixed, share, whole

KINDS = ("sparse", "dense", "all")
Path = tuple[str | int, ...]


@dataclass(frozen=True)
class Table:
    """A table of text.

    Attributes
    ----------
    caption : str
    head : tuple of str
    rows : tuple of tuples of str
    marks : tuple of str
        One for each row, a class of the page's style; none where it is empty.
    of_trials : bool
        Whether each row is a trial, whose id stands first.
    """

    caption: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    marks: tuple[str, ...] = ()
    of_trials: bool = False


def at(document: Any, path: Path) -> Any:
    """Value at a path of keys and places; None where there is none."""
    for key in path:
        if isinstance(document, Mapping):
            document = document.get(key)
        elif isinstance(document, Sequence) and isinstance(key, int) and key < len(document):
            document = document[key]
        else:
            return None
    return document


def share_text(record: Any) -> str:
    """A share, its interval and its counts."""
    if not get(record, "n"):
        return "no trial"
    interval = f"({share(record['low'])} to {share(record['high'])})"
    return f"{share(record['share'])} {interval}, {record['hits']}/{record['n']}"


def value_text(record: Any, decimals: int = 2) -> str:
    """A value, its interval and its number of trials."""
    if not get(record, "n"):
        return "no trial"
    text = fixed(record["value"], decimals)
    if record["low"] is not None:
        text += f" ({fixed(record['low'], decimals)} to {fixed(record['high'], decimals)})"
    return f"{text}, n = {record['n']}"


def by_kind(
    caption: str, scores: Mapping[str, Any], rows: Sequence[tuple[str, Path]], decimals: int = 2
) -> Table:
    """A table with a column for each kind of trial; a row is its words and the path of its score."""
    cells = []
    for words, path in rows:
        found = [at(scores[kind], path) for kind in KINDS]
        cells.append((words, *(_any_text(one, decimals) for one in found)))
    return Table(caption, ("", *KINDS), tuple(cells))


def _any_text(record: Any, decimals: int) -> str:
    if isinstance(record, Mapping):
        return share_text(record) if "share" in record else value_text(record, decimals)
    return fixed(record, decimals) if record is not None else "-"


def bar_table(document: Document) -> Table:
    """Every acceptance criterion, what was measured, and whether it is met."""
    rows, marks = [], []
    for bar in listed(document, "bars"):
        sure = ", beyond doubt" if bar["beyond_doubt"] else ""
        rows.append(
            (
                bar["goal"],
                bar["what"] + (f" ({bar['note']})" if bar["note"] else ""),
                _bar_text(bar),
                _number(bar, bar["measured"]),
                _interval(bar),
                str(bar["n"]),
                share(bar["ceiling"]) if bar["ceiling"] is not None else "",
                bar["status"] + sure,
            )
        )
        marks.append({"met": "met", "not met": "bad"}.get(bar["status"], "quiet"))
    head = ("goal", "what", "criterion", "measured", "95 % interval", "n", "ceiling", "result")
    return Table("All criteria.", head, tuple(rows), tuple(marks))


def _bar_text(bar: Document) -> str:
    least, most = bar["at_least"], bar["at_most"]
    if least is not None and most is not None:
        return f"{least:g} to {most:g}"
    if least == 0.0:
        return "above 0"
    unit = "" if bar["unit"] == "1" else f" {unit_text(bar['unit'])}"
    return f"at least {least:g}{unit}" if least is not None else f"at most {most:g}{unit}"


def _number(bar: Document, value: Any) -> str:
    if bar["unit"] in ("m", "s"):
        return whole(value) if value is None or abs(value) >= 10 else fixed(value, 1)
    digits = 3 if bar["at_most"] is not None and bar["at_most"] < 0.2 else 2
    return fixed(value, digits)


def _interval(bar: Document) -> str:
    if bar["low"] is None or bar["high"] is None:
        return ""
    return f"{_number(bar, bar['low'])} to {_number(bar, bar['high'])}"


def count_table(document: Document) -> Table:
    """How many trials of what."""
    counts = get(document, "counts")
    names = sorted({name for one in counts.values() for name in one})
    rows = [(name_text(name), *(str(counts[kind].get(name, 0)) for kind in KINDS)) for name in names]
    rows.append(("all", *(str(sum(counts[kind].values())) for kind in KINDS)))
    return Table("Number of trials by what is hidden.", ("hidden", *KINDS), tuple(rows))


def snr_table(scores: Mapping[str, Any], part: str, caption: str, key: str = "") -> Table:
    """A score by bins of signal-to-noise."""
    bins = at(scores["all"], (part, "by_snr")) or []
    rows: list[tuple[str, Path]] = [
        (f"{row['snr_from']:g} to {row['snr_to']:g}", (part, "by_snr", k, *([key] if key else [])))
        for k, row in enumerate(bins)
    ]
    table = by_kind(caption, scores, rows)
    return Table(table.caption, ("signal-to-noise", *KINDS), table.rows)


def trial_table(document: Document) -> Table:
    """One line for each trial."""
    head = ("trial", "kind", "base law", "hidden", "snr", "verdict", "names", "p(nothing)", "place error [m]",
            "wall [s]", "result")  # fmt: skip
    rows, marks = [], []
    for line in listed(document, "trials"):
        hidden = ", ".join(line["true_ids"]) or str(line["nasty"] or line["hidden"])
        rows.append(
            (
                line["trial"],
                line["kind"],
                str(line["base_model"]),
                name_text(hidden),
                fixed(line["snr"], 1),
                name_text(line["verdict"]),
                name_text(", ".join(line["names"])) or "-",
                share(line["probability_nothing"]),
                whole(line["place_error_m"]) if line["place_error_m"] is not None else "-",
                whole(line["wall_seconds"]),
                line["right"],
            )
        )
        wrong = line["right"] in ("failed", "false alarm", "wrong name")
        marks.append("bad" if wrong else "" if line["right"] != "not found" else "quiet")
    return Table("All trials.", head, tuple(rows), tuple(marks), of_trials=True)
