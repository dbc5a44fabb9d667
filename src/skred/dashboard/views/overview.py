"""What is shown, whether it converged, and what could not be shown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from markupsafe import Markup

from skred.dashboard.each import Failures
from skred.dashboard.reading import Given
from skred.dashboard.view import Asked
from skred.report.explore.panel import Panel
from skred.report.explore.run import Run, shown
from skred.report.shared import document as doc
from skred.report.shared.numbers import is_number

_CLASSES = ("n", "text", "text wide-only", "n", "n", "n", "text")


def overview_panels(run: None, given: Given, asked: Asked) -> list[Panel]:
    """The runs, their verdicts, and troubles."""
    panels = []
    if given.troubles:
        told = Markup("").join(
            Markup("<li><strong>{}</strong><br>{}</li>").format(one.source, one.message)
            for one in given.troubles
        )
        html = Markup('<div class="box" role="alert"><p>Not shown:</p><ul>{}</ul></div>').format(told)
        panels.append(Panel("What cannot be shown", html=str(html), wide=True))
    for one in given.runs:
        statement = doc.get(one.document, "statement")
        if one.kind == "diagnosis" and statement:
            verdict = shown(str(doc.get(one.document, "verdict")).replace("_", " "), 40)
            html = Markup("<p class='lead'><strong>Verdict: {}.</strong> {}</p>").format(verdict, statement)
            panels.append(Panel(one.title, html=str(html), wide=True))
    failures = Failures()
    rows = [row for _, row in failures.of_each(given.runs, _row)]
    if rows:
        panels.append(Panel("Runs", html=_table(rows), wide=True))
    return panels + failures.panels()


def _table(rows: Sequence[tuple[Any, ...]]) -> str:
    heads = ("", "run", "what it is", "events", "parameters", "draws", "converged")
    head = Markup("").join(
        Markup('<th class="{}">{}</th>').format(_CLASSES[k], one) for k, one in enumerate(heads)
    )
    body = Markup("").join(
        Markup("<tr>{}</tr>").format(
            Markup("").join(
                Markup('<td class="{}">{}</td>').format(_CLASSES[k], cell) for k, cell in enumerate(row)
            )
        )
        for row in rows
    )
    table = Markup('<div class="scroll"><table><thead><tr>{}</tr></thead><tbody>{}</tbody></table></div>')
    return str(table.format(head, body))


def _row(run: Run) -> tuple[Any, ...]:
    draws = "-"
    if run.has("posterior"):
        sizes = run.group("posterior").sizes
        draws = f"{sizes.get('chain', 1)} × {sizes.get('draw', 0)}"
    what = {"calibration": run.tree.attrs.get("title", "calibration"), "arviz": "netCDF with ArviZ's groups"}
    said = what.get(run.kind) or run.tree.attrs.get("title", run.kind)
    return (
        run.number, run.title, shown(said, 90), len(run.event_ids) or "-", len(run.names) or "-", draws,
        _converged(run),
    )  # fmt: skip


def _converged(run: Run) -> str:
    """Whether the chains can be trusted, and the numbers that say so; of a diagnosis, all of its chains."""
    if run.kind == "diagnosis":
        passed = doc.get(run.document, "converged")
        r_hat, ess = (doc.get(run.document, "diagnostics", key) for key in ("r_hat_max", "ess_min"))
    else:
        passed = run.gate.get("passed")
        r_hat, ess = run.gate.get("r_hat_max"), run.gate.get("ess_bulk_min")
    if not isinstance(passed, bool):
        return "not said"
    numbers = f" (r-hat {r_hat:.3f}, ess {ess:.0f})" if is_number(r_hat) and is_number(ess) else ""
    return ("yes" if passed else "NO") + numbers
