"""Tables for the terminal; what comes from a file is text, never markup."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from skred.report.shared import document as doc
from skred.report.shared.labels import population_role, printable, shortened
from skred.report.shared.numbers import decimals_for, fixed, is_number, rounded, share, whole
from skred.report.shared.relative import relative_new_avalanche

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.table import Table
    from rich.text import Text


def comparison_table(comparison: doc.Document) -> Table:
    """The comparison, best law first; laws that did not converge below, without a rank.

    Parameters
    ----------
    comparison : mapping
        As `skred.report.comparison.page.render_comparison` takes it.
    """
    own = "with every avalanche its own friction" if doc.is_hierarchical(comparison) else ""
    name = shortened(doc.get(comparison, "campaign", "name"), 36 if own else 60)
    table = plain_table(
        plain_text(f"{name}: laws compared {own or 'by leave-one-event-out'}"),
        left=("law",),
        right=(
            "\nelpd" if own else "exact\nelpd",
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
        table.add_row(
            plain_text(shortened(doc.get(model, "id"))), plain_text("not converged", "red"), *["-"] * 8
        )
    lines = [_explanation(comparison), *_pooled_line(comparison), *map(_failure, failed)]
    table.caption = plain_text("\n".join(lines))
    table.caption_justify = "left"
    return table


def summary_table(model: doc.Document, *, probability: float = 0.9) -> RenderableType:
    """Parameters of one law; of a hierarchical calibration also a new avalanche at each sensor.

    Parameters
    ----------
    model : mapping
        Entry of ``models`` in the comparison document; ``title``, ``parameters``, ``gate`` and, where it
        has them, ``new_avalanche`` and ``error_model`` are read.
    probability : float
        Of the equal-tailed interval from ``low`` to ``high``.
    """
    from rich.console import Group

    of_population = bool(doc.listed(model, "new_avalanche"))
    table = plain_table(
        plain_text(shortened(doc.get(model, "title") or doc.get(model, "id") or "", 76)),
        left=("parameter", "symbol\n(paper)", "unit"),
        right=("mean", "sd", f"{100 * probability:.0f} % interval", "ESS\nbulk", "ESS\ntail", "r-hat"),
    )
    for parameter in doc.listed(model, "parameters"):
        table.add_row(*_parameter_row(parameter, of_population=of_population))
    of_what = "across avalanches: see below" if of_population else "of the mean response"
    table.caption = plain_text(f"Interval equal-tailed, {of_what}. {_gate(model)}")
    table.caption_justify = "left"
    if not of_population:
        return table
    kind = f"{100 * probability:.0f} % interval"
    table.caption = plain_text(
        "Every avalanche has its own friction: spread is the standard deviation of its logarithm across"
        f" avalanches. Intervals equal-tailed. {_gate(model)}"
    )
    return Group(table, plain_text(""), _new_avalanche_table(model, kind))


def _new_avalanche_table(model: doc.Document, kind: str) -> Table:
    table = plain_table(
        plain_text("A new avalanche, beside the recorded ones"),
        left=("sensor", "unit"),
        right=("gets\nthere", f"reading,\n{kind}", "mean", "recorded:\nthere", f"\n{kind}", "mean", "n"),
    )
    for entry in doc.listed(model, "new_avalanche"):
        row = relative_new_avalanche({}, entry)
        table.add_row(
            plain_text(shortened(row["sensor"], 24)),
            plain_text(shortened(row["unit"], 12)),
            *(row[k] for k in ("reached", "interval", "mean", "recorded_reached", "recorded_interval")),
            *(row[k] for k in ("recorded_mean", "n_recorded")),
        )
    errors = shortened(doc.get(model, "error_model", "title") or "n/a", 100)
    table.caption = plain_text(
        f"Readings of avalanches that get there; the runout is the length along the track. Errors: {errors}."
    )
    table.caption_justify = "left"
    return table


def plain_table(title: Text, left: tuple[str, ...], right: tuple[str, ...]) -> Table:
    """A table without rows: columns of words, then columns of numbers."""
    from rich import box
    from rich.table import Table

    # Tight, because eight numbers to two decimals must fit a terminal of 80 characters.
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, show_edge=False, padding=0)
    for name in left:
        table.add_column(name, overflow="fold")
    for name in right:
        table.add_column(name, justify="right", no_wrap=True)  # a number cut short is a wrong number
    return table


def plain_text(value: Any, style: str = "") -> Text:
    """A value as text that steers neither rich nor the terminal."""
    from rich.text import Text

    lines = [printable(line) for line in str(value).split("\n")]
    return Text("\n".join(lines), style=style)


def _ranked_row(model: doc.Document, *, best: bool) -> list[Any]:
    practical = doc.get(model, "difference", "practical")
    counts = "best" if best else {True: "yes", False: "no"}.get(practical, "n/a")
    return [
        plain_text(shortened(doc.get(model, "id"))),
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
    limit = whole(doc.get(comparison, "limits", "practical_difference"))
    how = (
        "by importance sampling, refitted where that cannot be trusted"
        if doc.is_hierarchical(comparison)
        else "exact: refitted without each event"
    )
    return (
        f"elpd in nats, larger is better; {how}. 2 se: doubled standard "
        f"error of the difference (the plain one is optimistic{few}). A difference counts if it is at least "
        f"{limit} and exceeds 2 se. Weight: stacking, a share."
    )


def _pooled_line(comparison: doc.Document) -> list[str]:
    """The differences of the pooled calibration beside it, in one line."""
    models = [m for m in doc.listed(comparison, "pooled", "models") if doc.passed(m)]
    values = [f"{shortened(doc.get(m, 'id'))} {fixed(doc.get(m, 'difference', 'elpd'))}" for m in models]
    return [f"Differences of the pooled calibration: {', '.join(values)}."] if values else []


def _failure(model: doc.Document) -> str:
    problems = [printable(problem) for problem in doc.listed(model, "gate", "problems")]
    return f"{shortened(doc.get(model, 'id'))} did not converge: {'; '.join(problems) or 'sample again'}"


def _parameter_row(parameter: doc.Document, *, of_population: bool) -> list[Any]:
    sd = doc.get(parameter, "sd")
    by_sd, by_both = decimals_for(sd), decimals_for(sd, doc.get(parameter, "mcse_mean"))
    paper = doc.get(parameter, "paper_symbol")
    symbol = f"{doc.get(parameter, 'symbol')}" + (f" ({paper})" if paper else "")
    low, high = (rounded(doc.get(parameter, key), by_sd) for key in ("low", "high"))
    name = shortened(doc.get(parameter, "name"))
    if of_population:  # the symbol says of what
        role = population_role(doc.get(parameter, "name"))
        name = f"median {name}" if role == "median" else role
    return [
        plain_text(name),
        plain_text(shortened(symbol)),
        plain_text(shortened(doc.get(parameter, "unit"), 20)),
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
    return "Converged." if doc.passed(model) else _failure(model)
