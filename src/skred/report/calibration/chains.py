"""Figures of the parameters: chains, joint and marginal distributions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from skred.arrays import FloatArray
from skred.report.shared.draws import INTERVAL, chains_of, density, gate_text, interval
from skred.report.shared.labels import (
    figure_text,
    parameter_label,
    population_label,
    symbol_label,
    symbol_text,
)
from skred.report.shared.law import law_of
from skred.report.shared.numbers import decimals_for, rounded
from skred.report.shared.style import (
    GREY,
    INK,
    WIDTH,
    bare,
    grow,
    is_narrow,
    law_colours,
    new_figure,
    panels_in,
    shade_map,
    shades,
    styled,
)

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from skred.physics.law import Parameter
    from skred.report.shared.law import CalibratedLaw

_MAX_TRACE_POINTS = 1500
_RANK_BINS = 20
_MAX_JOINT = 5
_LINES = 0.64
"""Share of a panel's height that is drawn in; the legend has the rest."""


def _label(parameter: Parameter, law: CalibratedLaw, n_shown: int) -> str:
    """Label of an axis; where there are more than the law's own, they are those of a population."""
    of_population = n_shown > len(law.own)
    return population_label(parameter) if of_population else parameter_label(parameter)


@styled
def trace_figure(tree: xr.DataTree) -> Figure:
    """Trace and rank histogram of every chain, one row per parameter.

    Ranks are over all chains together: in chains that sample the same distribution they are spread
    evenly (Vehtari and others, 2021, doi 10.1214/20-BA1221).
    """
    law = law_of(tree)
    shown = law.parameters
    n = len(shown)
    title = "Chains: traces that overlap and ranks that are level have mixed"
    figure = new_figure(0.9 + 1.75 * n, f"{title}\n{figure_text(law.title, 80)}\n{gate_text(tree)}")
    if is_narrow():
        grow(figure, 1.6)
        panels = figure.subplots(2 * n, 1, squeeze=False).reshape(n, 2)
    else:
        panels = figure.subplots(n, 2, squeeze=False, gridspec_kw={"width_ratios": [1.7, 1]})
    for row, parameter in zip(panels, shown, strict=True):
        chains = chains_of(tree, parameter.name)
        colours = shades(law_colours([law.id])[law.id], len(chains))
        _trace(row[0], chains, colours, _label(parameter, law, n))
        _ranks(row[1], chains, colours)
    panels[-1, 0].set_xlabel("draw")
    panels[-1, 1].set_xlabel("rank among the draws of all chains")
    return figure


def _trace(axes: Axes, chains: FloatArray, colours: list[str], label: str) -> None:
    step = max(1, chains.shape[1] // _MAX_TRACE_POINTS)
    draw = np.arange(0, chains.shape[1], step)
    for chain, colour in zip(chains, colours, strict=True):
        axes.plot(draw, chain[::step], color=colour, linewidth=0.4, rasterized=True)
    axes.set_xlim(0, chains.shape[1])
    axes.set_ylabel(label if "\n" in label else label.replace(" (", "\n(").replace(" [", "\n[", 1))


def _ranks(axes: Axes, chains: FloatArray, colours: list[str]) -> None:
    ranks = np.argsort(np.argsort(chains.ravel(), kind="stable"), kind="stable").reshape(chains.shape)
    bins = min(_RANK_BINS, max(2, chains.shape[1] // 10))
    for number, (row, colour) in enumerate(zip(ranks, colours, strict=True), start=1):
        counts, edges = np.histogram(row, bins=bins, range=(0, chains.size))
        level = counts * bins / chains.shape[1]
        axes.stairs(level, edges, baseline=None, color=colour, label=f"chain {number}")
    axes.axhline(1.0, color=INK, linewidth=0.8, linestyle="--")
    axes.set_ylim(0, max(2.0, axes.get_ylim()[1]))
    axes.set_xlim(0, chains.size)
    axes.set_ylabel("relative frequency")
    if len(chains) <= 4:
        axes.legend(loc="lower center", ncols=len(chains), fontsize=6.5, handlelength=0.8, columnspacing=0.8)


@styled
def joint_figure(tree: xr.DataTree) -> Figure:
    """Two-dimensional histogram of each pair of parameters, with their marginal histograms."""
    law = law_of(tree)
    every = law.parameters
    shown = every[:_MAX_JOINT]
    draws = [chains_of(tree, parameter.name).ravel() for parameter in shown]
    n = len(shown)
    bins = 3 if n > 3 or is_narrow() else 5
    short = n > 3 or is_narrow()
    labels = [symbol_label(p) if short else _label(p, law, len(every)) for p in shown]
    figure = new_figure(min(WIDTH, 1.2 + 2.2 * n), _joint_title(law, every, draws))
    panels = figure.subplots(n, n, sharex="col", squeeze=False)
    colour = law_colours([law.id])[law.id]
    for i in range(n):
        for j in range(n):
            axes = panels[i, j]
            if j > i:
                axes.remove()
            elif i == j:
                axes.hist(draws[i], bins=50, color=colour, alpha=0.8)
                axes.locator_params(axis="x", nbins=bins)
                bare(axes)
            else:
                _pair(axes, draws[j], draws[i], colour)
                axes.locator_params(nbins=bins)
                if j == 0:
                    axes.set_ylabel(labels[i])
            if j <= i == n - 1:
                axes.set_xlabel(labels[j])
                if short:  # narrow panels
                    axes.tick_params(axis="x", labelrotation=40, labelsize=7)
                    axes.xaxis.label.set_fontsize(7.5)
    return figure


def _joint_title(law: CalibratedLaw, parameters: tuple[Parameter, ...], draws: list[FloatArray]) -> str:
    of_population = len(parameters) > len(law.own)
    what = " of the medians, spreads and correlations across avalanches" if of_population else ""
    title = f"Joint posterior{what}\n{figure_text(law.title, 80)}"
    if len(draws) == 2 and all(np.ptp(values) > 0 for values in draws):
        first, second = (figure_text(symbol_text(p.symbol)) for p in parameters)
        correlation = float(np.corrcoef(draws[0], draws[1])[0, 1])
        title += f"\ncorrelation of {first} and {second}: {correlation:+.2f}; + is the mean"
    elif len(parameters) > len(draws):
        title += f"\nthe first {len(draws)} of {len(parameters)} parameters"
    return title


def _pair(axes: Axes, x: FloatArray, y: FloatArray, colour: str) -> None:
    axes.hist2d(x, y, bins=50, cmap=shade_map(colour), cmin=1, rasterized=True)
    axes.plot(x.mean(), y.mean(), marker="+", color=INK, markersize=11)


@styled
def marginals_figure(tree: xr.DataTree) -> Figure:
    """Posterior of each parameter against its prior density, with mean and 90 % interval."""
    law = law_of(tree)
    shown = law.parameters
    n = len(shown)
    columns = 1 if is_narrow() else min(n, 2)
    rows = -(-n // columns)
    title = f"What the recordings say of each parameter, against the prior\n{figure_text(law.title, 80)}"
    figure = new_figure(0.9 + 2.4 * rows, title)
    for axes, parameter in zip(panels_in(figure, n, columns), shown, strict=True):
        prior = chains_of(tree, parameter.name, "prior").ravel()
        _marginal(axes, chains_of(tree, parameter.name).ravel(), prior, law_colours([law.id])[law.id])
        axes.set_xlabel(_label(parameter, law, n).replace("\n", " "))
    return figure


def _marginal(axes: Axes, draws: FloatArray, prior: FloatArray, colour: str) -> None:
    low, high = interval(draws)
    mean, sd = float(draws.mean()), float(draws.std())
    decimals = decimals_for(sd)
    prior_low, prior_high = (rounded(limit, decimals_for(float(prior.std()))) for limit in interval(prior))
    percent = f"{100 * INTERVAL:.0f} %"
    axes.hist(draws, bins=50, density=True, color=colour, alpha=0.35, label="posterior")
    margin = 0.15 * float(np.ptp(draws)) or abs(mean) or 1.0
    grid = np.linspace(draws.min() - margin, draws.max() + margin, 300)
    prior_label = f"prior, {percent} in {prior_low} to {prior_high}"
    # Strengths are not negative: their priors end at 0, where they may be largest.
    lower = 0.0 if prior.min() >= 0 else None
    inside = grid if lower is None else grid[grid >= lower]
    if lower is None and np.abs(prior).max() <= 1:  # a correlation
        inside = grid[np.abs(grid) <= 1]
    axes.plot(inside, density(prior, inside, lower=lower), color=GREY, linewidth=1.2, label=prior_label)
    interval_label = (
        f"{percent} interval (equal-tailed) {rounded(low, decimals)} to {rounded(high, decimals)}"
    )
    axes.axvline(mean, ymax=_LINES, color=INK, linewidth=1.2, label=f"mean {rounded(mean, decimals)}")
    axes.axvline(low, ymax=_LINES, color=INK, linewidth=0.9, linestyle="--", label=interval_label)
    axes.axvline(high, ymax=_LINES, color=INK, linewidth=0.9, linestyle="--")
    axes.set_xlim(grid[0], grid[-1])
    axes.set_ylim(0, axes.get_ylim()[1] / _LINES)
    axes.locator_params(axis="x", nbins=6)
    axes.legend(loc="upper left", fontsize=7.5)
    bare(axes)
