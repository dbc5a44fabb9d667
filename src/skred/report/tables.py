"""Tables for the terminal; what comes from a file is text, never markup."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from skred.report import document as doc
from skred.report.labels import printable, shortened
from skred.report.numbers import decimals_for, fixed, is_number, rounded, share, whole

if TYPE_CHECKING:
    from rich.table import Table
    from rich.text import Text


def comparison_table(comparison: doc.Document) -> Table:
    """The comparison, best law first; laws that failed the gate below, without a rank.

    Parameters
    ----------
    comparison : mapping
        As `skred.report.html.render_comparison` takes it.
    """
    table = _table(
        _text(
            f"{shortened(doc.get(comparison, 'campaign', 'name'), 60)}: laws compared by leave-one-event-out"
        ),
        left=("law",),
        right=(
            "exact\nelpd",
            "differ-\nence",
            "2 se",
            "counts",
            "LOO",
            "max\nk",
            "WAIC",
            "log evi-\ndence",
            "weight",
        ),
    )
    ranked = doc.ranked(comparison)
    for place, model in enumerate(ranked):
        table.add_row(*_ranked_row(model, best=place == 0))
    failed = doc.failed(comparison)
    for model in failed:
        table.add_row(_text(shortened(doc.get(model, "id"))), _text("gate failed", "red"), *["-"] * 8)
    table.caption = _text("\n".join([_explanation(comparison), *map(_failure, failed)]))
    table.caption_justify = "left"
    return table


def summary_table(model: doc.Document, *, probability: float = 0.9) -> Table:
    """Parameters of one law.

    Parameters
    ----------
    model : mapping
        Entry of ``models`` in the comparison document; ``title``, ``parameters`` and ``gate`` are read.
    probability : float
        Of the equal-tailed interval from ``low`` to ``high``.
    """
    table = _table(
        _text(shortened(doc.get(model, "title") or doc.get(model, "id") or "", 76)),
        left=("parameter", "symbol\n(paper)", "unit"),
        right=("mean", "sd", f"{100 * probability:.0f} % interval", "ESS\nbulk", "ESS\ntail", "r-hat"),
    )
    for parameter in doc.listed(model, "parameters"):
        table.add_row(*_parameter_row(parameter))
    note = f"Interval equal-tailed, of the mean response. {_gate(model)}"
    table.caption = _text(note)
    table.caption_justify = "left"
    return table


def _table(title: Text, left: tuple[str, ...], right: tuple[str, ...]) -> Table:
    from rich import box
    from rich.table import Table

    # Tight, because eight numbers to two decimals must fit a terminal of 80 characters.
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, show_edge=False, padding=0)
    for name in left:
        table.add_column(name, overflow="fold")
    for name in right:
        table.add_column(name, justify="right", no_wrap=True)  # a number cut short is a wrong number
    return table


def _text(value: Any, style: str = "") -> Text:
    from rich.text import Text

    lines = [printable(line) for line in str(value).split("\n")]
    return Text("\n".join(lines), style=style)


def _ranked_row(model: doc.Document, *, best: bool) -> list[Any]:
    practical = doc.get(model, "difference", "practical")
    counts = "best" if best else {True: "yes", False: "no"}.get(practical, "n/a")
    return [
        _text(shortened(doc.get(model, "id"))),
        fixed(doc.get(model, "exact", "elpd")),
        fixed(doc.get(model, "difference", "elpd")),
        fixed(doc.get(model, "difference", "se_doubled")),
        counts,
        fixed(doc.get(model, "loo", "elpd")),
        fixed(doc.get(model, "loo", "pareto_k_max")),
        fixed(doc.get(model, "waic", "elpd")),
        fixed(doc.get(model, "evidence", "mean")),
        share(doc.get(model, "weight")),
    ]


def _explanation(comparison: doc.Document) -> str:
    n_events = doc.get(comparison, "campaign", "n_events")
    few = f" with {whole(n_events)} events" if is_number(n_events) and n_events < 100 else ""
    limit = f"{doc.PRACTICAL_DIFFERENCE:.0f}"
    return (
        "elpd in nats, larger is better; exact: refitted without each event. 2 se: doubled standard "
        f"error of the difference (the plain one is optimistic{few}). A difference counts if it is at least "
        f"{limit} and exceeds 2 se. Weight: stacking, a share."
    )


def _failure(model: doc.Document) -> str:
    problems = [printable(problem) for problem in doc.listed(model, "gate", "problems")]
    return f"{shortened(doc.get(model, 'id'))} failed the gate: {'; '.join(problems) or 'sample again'}"


def _parameter_row(parameter: doc.Document) -> list[Any]:
    sd = doc.get(parameter, "sd")
    by_sd, by_both = decimals_for(sd), decimals_for(sd, doc.get(parameter, "mcse_mean"))
    paper = doc.get(parameter, "paper_symbol")
    symbol = f"{doc.get(parameter, 'symbol')}" + (f" ({paper})" if paper else "")
    low, high = (rounded(doc.get(parameter, key), by_sd) for key in ("low", "high"))
    return [
        _text(shortened(doc.get(parameter, "name"))),
        _text(shortened(symbol)),
        _text(shortened(doc.get(parameter, "unit"), 20)),
        rounded(doc.get(parameter, "mean"), by_both),
        rounded(sd, by_sd),
        f"{low} to {high}",
        whole(doc.get(parameter, "ess_bulk")),
        whole(doc.get(parameter, "ess_tail")),
        fixed(doc.get(parameter, "r_hat"), 3),
    ]


def _gate(model: doc.Document) -> str:
    if doc.get(model, "gate") is None:
        return ""
    return "Gate passed." if doc.passed(model) else _failure(model)
