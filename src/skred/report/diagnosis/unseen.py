"""What the report says of avalanches that the diagnosis has not seen: locked ones, and outer folds."""

from __future__ import annotations

from typing import Any

from skred.report.diagnosis.rows import PREDICTION_ERRORS
from skred.report.diagnosis.words import UNLISTED
from skred.report.shared import document as doc
from skred.report.shared.labels import name_text, printable
from skred.report.shared.numbers import fixed, is_number


def locked(document: doc.Document) -> dict[str, Any] | None:
    """Events, rows of numbers before and after, and the change of the log score; None if none was locked."""
    found = doc.get(document, "locked")
    if not found:
        return None
    rows = []
    for key, words, decimals in PREDICTION_ERRORS:
        factor = 100.0 if key == "coverage_90" else 1.0
        values = [doc.get(found, f"{key}_{when}") for when in ("before", "after")]
        texts = [fixed(factor * value if is_number(value) else None, decimals) for value in values]
        if is_number(values[0]):
            rows.append({"words": words, "before": texts[0], "after": texts[1]})
    before, after = (doc.listed(found, f"log_score_{when}") for when in ("before", "after"))
    for number, event in enumerate(doc.listed(found, "events")):
        scores = [one[number] if number < len(one) else None for one in (before, after)]
        if scores[0] is not None:
            texts = [fixed(score, 1) for score in scores]
            words = f"log score of {printable(event)} [nats]"
            rows.append({"words": words, "before": texts[0], "after": texts[1]})
    return {
        "events": list(map(printable, doc.listed(found, "events"))),
        "rows": rows,
        "named": bool(after),
        "difference": difference_text(document, found),
    }


def outer_folds(document: doc.Document) -> dict[str, Any] | None:
    """A row for each fold, and the change of the log score over all; None if there were no folds."""
    found = doc.get(document, "outer_folds")
    if not found:
        return None
    rows = [
        {
            "events": ", ".join(map(printable, doc.listed(fold, "events"))),
            "names": " and ".join(map(_added, doc.listed(fold, "mechanisms"))) or "nothing",
            "difference": fixed(doc.get(fold, "elpd_diff"), 1, signed=True),
        }
        for fold in doc.listed(found, "folds")
    ]
    return {"k": doc.get(found, "k"), "rows": rows, "difference": difference_text(document, found)}


def _added(name: Any) -> str:
    return "a force profile" if name == UNLISTED else name_text(name)


def difference_text(document: doc.Document, found: doc.Document) -> str:
    """A difference of log scores with its doubled standard error, and whether it matters."""
    value, se = doc.get(found, "elpd_diff"), doc.get(found, "elpd_se")
    if not is_number(value):
        return fixed(None)
    doubled = f" (2 se {fixed(2.0 * se, 1)})" if is_number(se) else ""
    limit = doc.get(document, "report", "limits", "practical_difference")
    practical = ", no practical difference" if is_number(limit) and abs(value) < limit else ""
    return f"{fixed(value, 1, signed=True)} nats{doubled}{practical}"
