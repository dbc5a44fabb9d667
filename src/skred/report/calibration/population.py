"""Figures of a population of avalanches: the strengths across events, and each event's own."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from skred.arrays import FloatArray
from skred.report.shared.draws import (
    INTERVAL,
    chains_of,
    density,
    interval,
    kernels,
    region_levels,
    shaded_density,
)
from skred.report.shared.labels import figure_text, parameter_label, population_role, symbol_text, unit_text
from skred.report.shared.law import law_of
from skred.report.shared.marks import mark
from skred.report.shared.numbers import decimals_for, rounded
from skred.report.shared.recordings import recordings_of
from skred.report.shared.style import (
    GREY,
    INK,
    RECORDED,
    bare,
    grow,
    is_narrow,
    law_colours,
    legend_below,
    new_figure,
    side_by_side,
    styled,
    tint,
)

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

    from skred.physics.law import Parameter
    from skred.report.shared.law import CalibratedLaw

_LOG_BEYOND = 6.0
"""Axes over a larger ratio than this are logarithmic."""
_MAX_NAMED_EVENTS = 60
_MAX_STRENGTHS, _MAX_CROSSES, _MOST_LINES = 4, 40, 16
_GRID, _OUTER, _SHOWN = 90, (0.0005, 0.9995), (0.005, 0.995)
_QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)


@styled
def population_figure(tree: xr.DataTree) -> Figure:
    """Strengths of new avalanches, those of the recorded ones over them, and what the population is.

    One panel for each pair of strengths; of a law with one strength its density.
    """
    law = law_of(tree)
    strengths = law.strengths[:_MAX_STRENGTHS]
    pairs = list(combinations(range(len(strengths)), 2)) or [(0, 0)]
    rows = len(pairs) // 2 + 1  # one panel is for words
    title = "Friction across avalanches: the population, and each recorded avalanche"
    height = 1.0 + (3.4 if rows == 1 else 2.7 * rows)
    figure = new_figure(height, f"{title}\n{figure_text(law.title, 80)}")
    layout: dict[str, Any] = {"width_ratios": [1.7, 1]} if len(pairs) == 1 else {}
    if is_narrow():
        grow(figure, 1.7)
        panels = figure.subplots(2 * rows, 1, squeeze=False).ravel()
    else:
        panels = figure.subplots(rows, 2, squeeze=False, gridspec_kw=layout).ravel()
    new = [_draws(tree, s.name, "new_avalanches").ravel() for s in strengths]
    own = [_draws(tree, s.name, "event_posterior") for s in strengths]
    colour = law_colours([law.id])[law.id]
    for axes, (i, j) in zip(panels, pairs, strict=False):
        if i == j:
            _one_strength(axes, new[i], own[i], strengths[i], colour)
        else:
            _pair(axes, (new[i], new[j]), (own[i], own[j]), (strengths[i], strengths[j]), colour)
    _statement(panels, len(pairs), population_lines(tree))
    legend_below(figure, panels[: len(pairs)], columns=3)
    return figure


def _draws(tree: xr.DataTree, name: str, group: str) -> FloatArray:
    """Draws of a strength, (n_draws, n_events)."""
    values = tree[group].to_dataset()[name].transpose("chain", "draw", "event").values
    return np.asarray(values, dtype=float).reshape(-1, values.shape[-1])


def population_lines(tree: xr.DataTree) -> list[str]:
    """Medians, spreads and correlations of the strengths across avalanches, with 90 % intervals."""
    law = law_of(tree)
    percent = f"{100 * INTERVAL:.0f} %"
    lines = [f"Across avalanches: mean and {percent} interval"]
    for strength in law.strengths:
        values = chains_of(tree, strength.name, "median_strength").ravel()
        lines += _named("median", strength.symbol, values, strength.unit)
    for parameter in law.parameters[len(law.own) :]:
        values = chains_of(tree, parameter.name).ravel()
        lines += _named(population_role(parameter.name), parameter.symbol, values, parameter.unit)
    return lines


def _named(role: str, symbol: str, values: FloatArray, unit: str) -> list[str]:
    decimals = decimals_for(float(values.std()))
    mean, low, high = (rounded(v, decimals) for v in (float(values.mean()), *interval(values)))
    shown_unit = "" if unit == "1" else f" {figure_text(unit_text(unit), 20)}"
    return ["", f"{role} {figure_text(symbol_text(symbol), 50)}", f"    {mean} ({low} to {high}){shown_unit}"]


def _statement(panels: Any, n_used: int, lines: list[str]) -> None:
    """The population in words, in the first free panel; those after it are taken away."""
    for axes in panels[n_used + 1 :]:
        axes.remove()
    if len(lines) > _MOST_LINES:  # a quantity on a line
        words = [" ".join(lines[k : k + 2]).replace("     ", "  ") for k in range(2, len(lines), 3)]
        lines = [lines[0], *(line.removeprefix("correlation ") for line in words)]
    axes = panels[n_used]
    axes.set_axis_off()
    text = axes.text(
        0.0, 1.0, "\n".join(lines), transform=axes.transAxes, va="top", fontsize=8, linespacing=1.5
    )
    text.set_in_layout(False)


def _one_strength(axes: Axes, new: FloatArray, own: FloatArray, strength: Parameter, colour: str) -> None:
    """Density of one strength, and the events' intervals in the order of their medians below it."""
    low, high = (float(value) for value in np.quantile(new, _OUTER))
    grid = np.linspace(min(low, float(own.min())), max(high, float(own.max())), 400)
    smooth = density(new, grid, lower=0.0)
    top = smooth.max()
    shaded_density(axes, grid, smooth, new, colour, "new avalanches")
    axes.plot(grid, smooth, color=colour, linewidth=1.2)
    quantiles = np.quantile(own, _QUANTILES, axis=0)
    quantiles = quantiles[:, np.argsort(quantiles[2])]
    heights = -top * (0.06 + 0.7 * np.arange(1, len(quantiles[0]) + 1) / len(quantiles[0]))
    _crosses(axes, quantiles, heights)
    axes.set_ylim(-0.82 * top, 1.05 * top)
    axes.axhline(0, color=GREY, linewidth=0.7)
    axes.set_xlabel(parameter_label(strength))
    bare(axes)


def _crosses(axes: Axes, x: FloatArray, y: FloatArray) -> None:
    """Recorded avalanches: median, 50 and 90 % intervals of each; `x` (5, n), `y` (n,) or (5, n)."""
    middle = y if y.ndim == 1 else y[2]
    if y.ndim == 1 or len(middle) <= _MAX_CROSSES:
        _bars(axes, x, y)
    axes.plot(
        x[2],
        middle,
        linestyle="none",
        marker="o",
        markersize=3.2,
        color=RECORDED,
        label="a recorded avalanche",
    )


def _bars(axes: Axes, x: FloatArray, y: FloatArray) -> None:
    middle = y if y.ndim == 1 else y[2]
    axes.hlines(middle, x[0], x[4], color=GREY, linewidth=0.5, label="its 90 % interval")
    axes.hlines(middle, x[1], x[3], color=INK, linewidth=1.1, label="its 50 % interval")
    if y.ndim == 2:
        axes.vlines(x[2], y[0], y[4], color=GREY, linewidth=0.5)
        axes.vlines(x[2], y[1], y[3], color=INK, linewidth=1.1)


def _pair(
    axes: Axes,
    new: tuple[FloatArray, FloatArray],
    own: tuple[FloatArray, FloatArray],
    strengths: tuple[Parameter, Parameter],
    colour: str,
) -> None:
    """Regions that hold 50 and 90 % of new avalanches, and the recorded ones."""
    x, y = (_edges(values) for values in new)
    mass = _smooth_mass(np.log(new[0]), np.log(new[1]), np.log(x), np.log(y))
    levels = region_levels(mass, (0.9, 0.5))
    outer, inner = tint(colour, 0.22), tint(colour, 0.5)
    if levels[0] < levels[1] < mass.max():
        axes.contourf(x, y, mass.T, [*levels, mass.max()], colors=[outer, inner])
        axes.contour(x, y, mass.T, levels, colors=[colour], linewidths=0.8)
    for shade, share in ((outer, 90), (inner, 50)):
        axes.fill_between([], [], color=shade, linewidth=0, label=f"new avalanches, {share} %")
    first, second = (np.quantile(values, _QUANTILES, axis=0) for values in own)
    _crosses(axes, first, second)
    for axis, strength, values, quantiles in (
        (axes.xaxis, strengths[0], new[0], first),
        (axes.yaxis, strengths[1], new[1], second),
    ):
        low, high = np.quantile(values, _SHOWN)
        set_limits(axes, axis, float(min(low, quantiles.min())), float(max(high, quantiles.max())))
        axis.set_label_text(parameter_label(strength))


def _edges(values: FloatArray) -> FloatArray:
    """Grid over the draws, even in the logarithm."""
    low, high = np.log(np.quantile(values, _OUTER))
    margin = 0.05 * (high - low) or 0.01
    return np.asarray(np.exp(np.linspace(low - margin, high + margin, _GRID)))


def _smooth_mass(x: FloatArray, y: FloatArray, grid_x: FloatArray, grid_y: FloatArray) -> FloatArray:
    """Gaussian kernel density of pairs on a grid, adding up to one."""
    fine = [np.linspace(grid[0], grid[-1], 2 * _GRID + 1) for grid in (grid_x, grid_y)]
    counts, _, _ = np.histogram2d(x, y, bins=fine)
    sides = []
    for grid, edges, values in zip((grid_x, grid_y), fine, (x, y), strict=True):
        width = max(float(np.std(values)) * len(values) ** (-1 / 6), float(edges[1] - edges[0]))
        sides.append(kernels(grid, (edges[1:] + edges[:-1]) / 2, width))
    mass = sides[0] @ counts @ sides[1].T
    return np.asarray(mass / mass.sum())


def set_limits(axes: Axes, axis: Axis, low: float, high: float, *, linear: bool = False) -> None:
    """Limits of an axis: logarithmic, with legible ticks, where strengths span much."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

    vertical = axis is axes.yaxis
    if not linear and low > 0 and high / low > _LOG_BEYOND:
        (axes.set_yscale if vertical else axes.set_xscale)("log")
        subs = (1.0, 2.0, 5.0) if high / low < 40 else (1.0, 3.0) if high / low < 1e4 else (1.0,)
        axis.set_major_locator(LogLocator(base=10.0, subs=subs, numticks=20))
        axis.set_minor_locator(NullLocator())
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())
        low, high = low / 1.08, high * 1.08
    else:
        margin = 0.03 * (high - low) or 0.1 * abs(high) or 1.0
        low, high = low - margin, high + margin
    (axes.set_ylim if vertical else axes.set_xlim)(low, high)


@styled
def events_figure(tree: xr.DataTree) -> Figure:
    """Each recorded avalanche's own strengths, with the population behind; releases where they vary."""
    law = law_of(tree)
    events = recordings_of(tree).event_ids
    columns = _event_columns(tree, law)
    n = len(events)
    title = f"Each recorded avalanche's own friction\n{figure_text(law.title, 80)}"
    figure = new_figure(1.5 + 0.165 * min(n, _MAX_NAMED_EVENTS), title)
    panels = side_by_side(figure, len(columns), sharey=True)
    colour = law_colours([law.id])[law.id]
    for axes, (label, own, new) in zip(panels, columns, strict=True):
        _forest(axes, own, new, colour, events)
        axes.set_xlabel(label)
    step = -(-n // _MAX_NAMED_EVENTS)
    places = range(0, n, step)
    size = 7.5 if n <= 40 else 6.0
    panels[0].set_yticks(places, [figure_text(events[k], 16) for k in places], fontsize=size)
    panels[0].set_ylim(n - 0.4, -0.6)
    panels[0].set_ylabel("avalanche" if step == 1 else f"avalanche (one in {step} is named)")
    legend_below(figure, panels, columns=3)
    return figure


def _event_columns(tree: xr.DataTree, law: CalibratedLaw) -> list[tuple[str, FloatArray, FloatArray | None]]:
    """Label, the events' own draws and the population's of each strength; releases without a population."""
    columns: list[tuple[str, FloatArray, FloatArray | None]] = []
    for strength in law.strengths[:_MAX_STRENGTHS]:
        own, new = (
            _draws(tree, strength.name, f"{which}") for which in ("event_posterior", "new_avalanches")
        )
        columns.append((parameter_label(strength), own, new))
    release = _draws(tree, "release", "event_posterior")
    if np.ptp(release, axis=0).max() > 0:
        columns.append(("release s [m]", release, None))
    return columns


def _forest(axes: Axes, own: FloatArray, new: FloatArray | None, colour: str, events: Sequence[str]) -> None:
    quantiles = np.quantile(own, _QUANTILES, axis=0)
    low, high = float(quantiles.min()), float(quantiles.max())
    if new is not None:
        band = np.quantile(new, _QUANTILES)
        low, high = min(low, float(band[0])), max(high, float(band[4]))
        for low_end, high_end, amount, share in ((0, 4, 0.2, 90), (1, 3, 0.42, 50)):
            shade, label = tint(colour, amount), f"new avalanches, {share} %"
            axes.axvspan(band[low_end], band[high_end], color=shade, linewidth=0, label=label)
        axes.axvline(band[2], color=colour, linewidth=1.2, label="new avalanches, median")
    rows = np.arange(own.shape[1])
    axes.hlines(
        rows, quantiles[0], quantiles[4], color=INK, linewidth=0.8, label="a recorded avalanche, 90 %"
    )
    axes.hlines(
        rows, quantiles[1], quantiles[3], color=INK, linewidth=2.4, label="a recorded avalanche, 50 %"
    )
    axes.plot(
        quantiles[2], rows, linestyle="none", marker="o", markersize=3.4, color=RECORDED,
        markerfacecolor="white", label="its median",
    )  # fmt: skip
    told = [
        f"{event}: {median:.4g} (90 %: {least:.4g} to {most:.4g})"
        for event, least, median, most in zip(events, quantiles[0], quantiles[2], quantiles[4], strict=True)
    ]
    mark(axes, quantiles[2], rows, told, events)
    set_limits(axes, axes.xaxis, low, high, linear=new is None)
    axes.tick_params(axis="y", length=0)
