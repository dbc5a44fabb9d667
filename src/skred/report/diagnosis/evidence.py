"""Figures of a diagnosis' evidence: the probabilities, and the evidence along a coefficient."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from skred.arrays import FloatArray
from skred.report.diagnosis.words import (
    AFTER,
    NOTHING,
    UNLISTED,
    bracketed,
    colour_of,
    facts_of,
    kinds,
    law_title,
    leading_name,
    shares_of,
    short_title,
)
from skred.report.shared import document as doc
from skred.report.shared.draws import chains_of, density
from skred.report.shared.labels import figure_text, name_text, printable, symbol_text, with_units
from skred.report.shared.marks import mark
from skred.report.shared.numbers import fixed, floats, is_number
from skred.report.shared.style import (
    GREY,
    INK,
    PALE,
    RECORDED,
    folded,
    grow,
    is_narrow,
    legend_below,
    new_figure,
    styled,
    tint,
)

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_DEPTH = 25.0
"""How far below its top a curve of evidence is shown [nats]."""
_MOST_LINES = 4
_LINES = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")


@styled
def probabilities_figure(document: doc.Document, comparison: doc.Document, number: int) -> Figure:
    """Probability of each candidate, with its prior probability."""
    shares = shares_of(comparison)
    names = list(reversed(shares))
    which = ", given the first finding" if number else ""
    title = f"What is missing{which}: probability of each candidate\n{figure_text(law_title(document), 80)}"
    figure = new_figure(1.25 + (0.34 if is_narrow() else 0.215) * max(len(names), 1), title)
    axes = figure.subplots()
    rows = np.arange(len(names))
    values = [shares[name] for name in names]
    axes.barh(rows, values, height=0.66, color=[colour_of(document, name) for name in names])
    prior = floats([doc.get(comparison, "prior", name) for name in names])
    for row, (value, tick) in enumerate(zip(values, prior, strict=True)):
        text = "less than 0.001" if value < 0.001 else "more than 0.999" if value > 0.999 else f"{value:.3f}"
        told = f"{short_title(document, names[row])}: {text}, before {fixed(float(tick), 3)}"
        mark(axes, value, row, [told])
        end = max(value, float(tick) if abs(tick - value) < 0.2 else 0.0) + 0.012
        axes.text(end, row, text, va="center", fontsize=7.5)
    axes.plot(prior, rows, linestyle="none", marker="|", markersize=9, color=INK, label="before: prior")
    for words, colour in kinds():
        axes.fill_between([], [], color=colour, linewidth=0, label=words)
    axes.set_yticks(rows, [folded(figure_text(short_title(document, name), 54), 27) for name in names])
    axes.tick_params(axis="y", length=0)
    axes.set_xlim(0.0, 1.16)
    axes.set_xticks(np.linspace(0.0, 1.0, 6))
    axes.set_ylim(-0.6, max(len(names), 1) - 0.4)
    axes.set_xlabel("probability [-]")
    legend_below(figure, [axes], columns=5)
    return figure


@styled
def strength_figure(document: doc.Document, tree: xr.DataTree, number: int) -> Figure:
    """Evidence along the coefficient of the leading candidate, its posterior, and the prior's part in it."""
    comparison = doc.listed(document, "report", "comparisons")[number]
    curves = tree[group_of("comparison", number)].to_dataset()
    name = leading_name(comparison)
    what = "added" if doc.get(comparison, "added") else "came closest, not added"
    title = f"{figure_text(short_title(document, name), 60)} ({what}): evidence along its coefficient"
    figure = new_figure(5.6, f"{title}\n{figure_text(_shape_text(comparison, name), 90)}")
    if is_narrow():
        grow(figure, 1.6)
        panels = figure.subplot_mosaic([["evidence"], ["density"], ["scale"]])
    else:
        panels = figure.subplot_mosaic([["evidence", "density"], ["scale", "scale"]])
    curve = curves.sel(candidate=name)
    _evidence(panels["evidence"], curve)
    _densities(panels["density"], curve, _added_draws(document, tree, comparison, number))
    facts = facts_of(document, name)
    symbol, unit = _symbol(doc.get(facts, "symbol") or ""), bracketed(doc.get(facts, "unit"))
    label = f"{figure_text(name_text(doc.get(facts, 'parameter') or 'coefficient'))} {symbol}{unit}"
    for key in ("evidence", "density"):
        panels[key].set_xlabel(label)
        panels[key].locator_params(axis="x", nbins=6)
        panels[key].ticklabel_format(axis="x", style="sci", scilimits=(-3, 4), useMathText=True)
    _scales(panels["scale"], document, comparison, curves, name)
    return figure


def group_of(name: str, number: int) -> str:
    """Name of a group, and of a figure, that belongs to the first, second, ... comparison."""
    return f"{name}_{number + 1}" if number else name


def _symbol(symbol: str) -> str:
    """A mechanism's symbol with its index lowered."""
    head, _, index = (figure_text(part) for part in symbol_text(symbol).partition("_"))
    return f"{head}$_{{\\mathrm{{{index}}}}}$" if index.isalnum() else figure_text(symbol_text(symbol))


def _shape_text(comparison: doc.Document, name: str) -> str:
    """Which shape the curve is of."""
    shape, parts = doc.get(comparison, "candidates", name, "shape"), []
    first, last = (doc.get(shape, key) for key in ("s_from_m", "s_to_m"))
    if is_number(first) and is_number(last):
        parts.append(f"s = {first:.0f} to {last:.0f} m")
    elif is_number(first):
        parts.append(f"from s = {first:.0f} m on")
    if doc.get(shape, "opposed"):
        parts.append("with a driving force equal to it at about the typical speed")
    else:
        constants = doc.get(shape, "constants") or {}
        parts += [
            f"{symbol_text(with_units(symbol))} = {value:g}"
            for symbol, value in constants.items()
            if is_number(value)
        ]
    parts += [
        f"{key} {printable(doc.get(shape, key))}" for key in ("sensor", "covariate") if doc.get(shape, key)
    ]
    return "its most probable shape: " + ", ".join(parts) if parts else "along the whole track"


def _values(curve: xr.Dataset, *names: str) -> list[FloatArray]:
    """Variables of one curve, without the padding after its end."""
    columns = [np.asarray(curve[name].values, dtype=float) for name in names]
    there = np.isfinite(columns[0])
    return [column[there] for column in columns]


def _evidence(axes: Axes, curve: xr.Dataset) -> None:
    strengths, line = _values(curve, "fine_strength", "fine_log_evidence")
    computed, heights = _values(curve, "strength", "log_evidence")
    top = max(float(line.max()), float(heights.max()), 0.0)
    bottom = max(min(float(line.min()), -1.0), top - _DEPTH)
    axes.plot(strengths, line, color=AFTER, linewidth=1.4)
    axes.plot(computed, heights, linestyle="none", marker="o", markersize=4, color=RECORDED)
    axes.axhline(0.0, color=GREY, linewidth=0.8)
    axes.set_ylim(bottom - 0.04 * (top - bottom), top + 0.1 * (top - bottom))
    if bottom > 0.0:
        axes.set_title(f"coefficient 0 lies at 0, {top:.0f} nats below the top", fontsize=7, color=GREY)
    near = strengths[line >= bottom]
    low, high = min(0.0, float(near.min())), max(0.0, float(near.max()))
    axes.set_xlim(low - 0.03 * (high - low), high + 0.03 * (high - low))
    axes.set_ylabel("log evidence\nagainst coefficient 0 [nats]")
    axes.grid(axis="y")


def _added_draws(
    document: doc.Document, tree: xr.DataTree, comparison: doc.Document, number: int
) -> FloatArray | None:
    """Draws of the coefficient that was added from a comparison; None where none was."""
    if doc.get(comparison, "added") is None or "added" not in tree.children:
        return None
    added = doc.listed(document, "report", "added")
    return chains_of(tree, str(doc.get(added[number], "parameter")), "added").ravel()


def _densities(axes: Axes, curve: xr.Dataset, values: FloatArray | None) -> None:
    strengths, log_evidence, log_prior = _values(
        curve, "fine_strength", "fine_log_evidence", "fine_log_prior"
    )
    log_density = log_evidence + log_prior
    posterior = np.exp(log_density - log_density.max())
    posterior /= np.trapezoid(posterior, strengths)
    if values is not None:
        reach = max(float(np.ptp(values)), 1e-12)
        grid = np.linspace(values.min() - 0.1 * reach, values.max() + 0.1 * reach, 300)
        label = "calibrated with all else"
        axes.fill_between(grid, density(values, grid), color=tint(AFTER, 0.35), linewidth=0, label=label)
    label = "from the comparison, if it is there"
    axes.plot(strengths, posterior, color=AFTER, linewidth=1.4, label=label)
    axes.plot(strengths, np.exp(log_prior), color=INK, linestyle="--", linewidth=1.0, label="prior")
    axes.set_ylim(bottom=0.0)
    axes.set_yticks([])
    axes.set_ylabel("probability density")
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=1, borderaxespad=0.1, fontsize=7)


def _scales(
    axes: Axes, document: doc.Document, comparison: doc.Document, curves: xr.Dataset, name: str
) -> None:
    """Log Bayes factor against the prior's scale, of the leading candidates."""
    shares, there = shares_of(comparison), set(map(str, curves["candidate"].values))
    others = [n for n in shares if n not in (name, NOTHING, UNLISTED) and shares[n] > 0.01 and n in there]
    scales = np.asarray(curves["prior_scale"].values, dtype=float)
    for other, colour in zip([name, *others][:_MOST_LINES], _LINES, strict=False):
        facts = facts_of(document, other)
        values = curves["log_bayes_factor"].sel(candidate=other).values
        if not np.isfinite(values).any():
            continue
        unit = bracketed(doc.get(facts, "unit")).strip().strip("[]")
        scale = doc.get(facts, "prior", "scale")
        used = f" (scale {scale:g}{' ' + unit if unit else ''})" if is_number(scale) else ""
        axes.plot(
            scales, values, color=colour, linewidth=2.0 if other == name else 1.1, marker="o",
            markersize=3, label=folded(f"{figure_text(short_title(document, other), 44)}{used}", 44),
        )  # fmt: skip
    axes.axvline(1.0, color=GREY, linestyle="--", linewidth=0.9)
    axes.axhline(0.0, color=GREY, linewidth=0.8)
    axes.set_xscale("log")
    ticks = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)
    axes.set_xticks(ticks, [fixed(t, 1) if t < 1 else f"{t:.0f}" for t in ticks])
    axes.minorticks_off()
    axes.set_xlabel("scales of the coefficient's prior, relative to those used (dashed) [-]")
    axes.set_ylabel("log Bayes factor\nagainst nothing [nats]")
    axes.grid(axis="y", color=PALE)
    columns = 1 if is_narrow() else 2
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns, borderaxespad=0.1, fontsize=7)
