"""The verdict as a table for the terminal; what comes from a file is text, never markup."""

from __future__ import annotations

from typing import TYPE_CHECKING

from skred.report.diagnosis.unseen import difference_text
from skred.report.shared import document as doc
from skred.report.shared.html import two_digits
from skred.report.shared.labels import name_text, printable, shortened, unit_text
from skred.report.shared.numbers import decimals_for, is_number, rounded, share, whole
from skred.report.shared.tables import plain_table, plain_text

if TYPE_CHECKING:
    from rich.table import Table

_MOST_PROBABLE = 6


def diagnosis_table(document: doc.Document) -> Table:
    """The verdict of a diagnosis, one line for each thing that it says.

    Parameters
    ----------
    document : mapping
        As written to ``verdict.json``; anything may be null.
    """
    name = shortened(doc.get(document, "campaign"), 40)
    law = shortened(doc.get(document, "base_model"), 20)
    table = plain_table(plain_text(f"{name}: what {law} leaves out"), left=("", ""), right=())
    table.show_header = False
    table.columns[0].no_wrap = True
    table.padding = (0, 2, 0, 0)
    for words, value in _rows(document):
        table.add_row(plain_text(words, "bold"), plain_text(value))
    table.caption = plain_text(printable(doc.get(document, "statement") or ""))
    table.caption_justify = "left"
    return table


def _rows(document: doc.Document) -> list[tuple[str, str]]:
    rows = [("verdict", name_text(doc.get(document, "verdict") or "n/a"))]
    if doc.get(document, "mechanism"):
        rows.append(("mechanism", shortened(doc.get(document, "mechanism"))))
    ties = [shortened(name) for name in doc.listed(document, "indistinguishable")]
    rows += [("tied with", ", ".join(ties))] if ties else []
    for more in doc.listed(document, "mechanisms")[1:]:
        rows.append(("second", shortened(doc.get(more, "id"))))
    rows += [(key, shortened(doc.get(document, key))) for key in ("sensor", "covariate") if document.get(key)]
    rows += [("strength", _strength(document))] if doc.get(document, "strength") else []
    rows += [("location", _location(document))] if doc.get(document, "location") else []
    rows += [("probability", line) for line in [_probabilities(document)] if line]
    rows.append(("elpd difference", _difference(document)))
    for key, words in (("locked", "locked avalanches"), ("outer_folds", "outer folds")):
        if document.get(key):
            rows.append((words, difference_text(document, doc.get(document, key))))
    p_value = two_digits(doc.get(document, "evidence", "p_value"))
    rows.append(("p-value", f"at most {p_value}" if doc.get(document, "alarm_by") == "evidence" else p_value))
    return rows


def _strength(document: doc.Document) -> str:
    mean, sd = (doc.get(document, "strength", key) for key in ("mean", "sd"))
    decimals = decimals_for(sd)
    unit = doc.get(document, "strength", "unit")
    shown = "" if unit in ("1", None) else f" {shortened(unit_text(unit), 20)}"
    name = name_text(shortened(doc.get(document, "strength", "parameter")))
    return f"{name} {rounded(mean, decimals)} ± {rounded(sd, decimals)}{shown}"


def _location(document: doc.Document) -> str:
    ends = (whole(doc.get(document, "location", key)) for key in ("s_from_m", "s_to_m"))
    return f"s = {' to '.join(ends)} m"


def _probabilities(document: doc.Document) -> str:
    shares = doc.get(document, "probability") or {}
    known = {name: value for name, value in shares.items() if is_number(value)}
    top = sorted(known, key=lambda name: -known[name])[:_MOST_PROBABLE]
    return ", ".join(f"{shortened(name)} {share(known[name])}" for name in top)


def _difference(document: doc.Document) -> str:
    if not is_number(doc.get(document, "evidence", "elpd_diff")):
        return "n/a (nothing was added)"
    return difference_text(document, doc.get(document, "evidence"))
