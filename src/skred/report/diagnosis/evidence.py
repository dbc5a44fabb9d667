"""Figures of a diagnosis' evidence: the check, the probabilities, and the evidence along a strength."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from skred.diagnosis.evidence.prior_odds import NOTHING, UNLISTED
from skred.physics.mechanisms.stretches import is_opposed
from skred.report.diagnosis.words import (
    AFTER,
    MISMATCH,
    bracketed,
    colour_of,
    factor_at,
    kinds,
    leading,
    short_title,
)
from skred.report.shared.draws import chains_of, density
from skred.report.shared.labels import figure_text, name_text, symbol_text
from skred.report.shared.numbers import fixed
from skred.report.shared.style import GREY, INK, PALE, RECORDED, legend_below, new_figure, styled, tint

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from skred.diagnosis.augment.step import Step
    from skred.diagnosis.check.bootstrap_test import BootstrapTest
    from skred.diagnosis.compare.comparison import Comparison
    from skred.diagnosis.evidence.coefficient import Curve
    from skred.report.diagnosis.flat import Flat as Diagnosis

FloatArray = NDArray[np.float64]
_DEPTH = 25.0
"""How far below its top a curve of evidence is shown [nats]."""
_RELATIVE = np.geomspace(0.1, 10.0, 13)
_MOST_LINES = 4
_LINES = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")


@styled
def check_figure(found: Diagnosis) -> Figure:
    """The check's statistic of clean campaigns, and of the recordings; again for the augmented laws."""
    checks = [(found.law.id, found.check), *((_with(found, k), s.check) for k, s in enumerate(found.steps))]
    if found.profile is not None:
        checks.append((f"{found.law.id} + the force profile", found.profile.check))
    shown = [(name, check) for name, check in checks if check is not None]
    title = "Is anything wrong? The recordings against clean campaigns simulated from the law"
    figure = new_figure(3.3, title)
    panels = figure.subplots(1, len(shown), squeeze=False).ravel()
    for axes, (name, check) in zip(panels, shown, strict=True):
        _histogram(axes, check)
        axes.set_title(f"{figure_text(name, 44)}\np = {check.p_value:.2g}, {len(check.simulated)} simulated")
        axes.set_xlabel("log odds of anything against nothing")
    panels[0].set_ylabel("clean campaigns")
    legend_below(figure, panels, columns=2)
    return figure


def _with(found: Diagnosis, number: int) -> str:
    names = [step.candidate.mechanism.id for step in found.steps[: number + 1]]
    return " + ".join([found.law.id, *names])


def _histogram(axes: Axes, check: BootstrapTest) -> None:
    values = check.simulated[np.isfinite(check.simulated)]
    if len(values) == 0:
        values = np.array([0.0])
    low, high = float(values.min()), float(values.max())
    reach = [low, high, check.statistic]
    least = (max(reach) - min(reach)) / 60.0  # or else bars cannot be seen beside a distant line
    wanted = int(np.clip(2.0 * math.sqrt(len(values)), 8, 40))
    n = max(1, min(wanted, math.ceil((high - low) / max(least, 1e-12))))
    bins = low + max((high - low) / n, least, 1e-12) * np.arange(n + 1)
    bins[-1] += 1e-9
    axes.hist(
        values, bins=list(bins), color=tint(AFTER, 0.45), edgecolor="white", linewidth=0.4,
        label="clean campaigns",
    )  # fmt: skip
    axes.axvline(check.statistic, color=MISMATCH, linewidth=2.0, label="the recordings")
    margin = 0.06 * (max(reach) - min(reach)) or 1.0
    axes.set_xlim(min(reach) - margin, max(reach) + margin)


@styled
def probabilities_figure(found: Diagnosis, comparison: Comparison, number: int) -> Figure:
    """Probability of each candidate, with its prior probability."""
    shares = comparison.probability
    names = sorted(shares, key=lambda name: shares[name])
    which = ", given the first finding" if number else ""
    title = f"What is missing{which}: probability of each candidate\n{figure_text(found.law.title, 80)}"
    figure = new_figure(1.25 + 0.215 * len(names), title)
    axes = figure.subplots()
    rows = np.arange(len(names))
    values = np.array([shares[name] for name in names])
    axes.barh(rows, values, height=0.66, color=[colour_of(name) for name in names])
    prior = [comparison.odds.get(name, math.nan) for name in names]
    for row, (value, tick) in enumerate(zip(values, prior, strict=True)):
        text = "less than 0.001" if value < 0.001 else "more than 0.999" if value > 0.999 else f"{value:.3f}"
        end = max(value, tick if abs(tick - value) < 0.2 else 0.0) + 0.012
        axes.text(end, row, text, va="center", fontsize=7.5)
    axes.plot(prior, rows, linestyle="none", marker="|", markersize=9, color=INK, label="before: prior")
    for words, colour in kinds():
        axes.fill_between([], [], color=colour, linewidth=0, label=words)
    axes.set_yticks(rows, [figure_text(short_title(name), 54) for name in names])
    axes.tick_params(axis="y", length=0)
    axes.set_xlim(0.0, 1.16)
    axes.set_xticks(np.linspace(0.0, 1.0, 6))
    axes.set_ylim(-0.6, len(names) - 0.4)
    axes.set_xlabel("probability [-]")
    legend_below(figure, [axes], columns=5)
    return figure


@styled
def strength_figure(found: Diagnosis, comparison: Comparison, number: int) -> Figure:
    """Evidence along the strength of the leading candidate, its posterior, and the prior's part in it."""
    step = found.steps[number] if number < len(found.steps) else None
    candidate = step.candidate if step is not None else leading(comparison)
    curve, name = candidate.best, candidate.mechanism.id
    what = "let in" if step is not None else "came closest, not let in"
    title = f"{figure_text(short_title(name), 60)} ({what}): evidence along its strength"
    figure = new_figure(5.6, f"{title}\n{figure_text(_shape_text(curve), 90)}")
    panels = figure.subplot_mosaic([["evidence", "density"], ["scale", "scale"]])
    _evidence(panels["evidence"], curve)
    _densities(panels["density"], curve, found, step, number)
    strength = candidate.mechanism.strength
    label = f"{name_text(strength.name)} {_symbol(strength.symbol)}{bracketed(strength.unit)}"
    for key in ("evidence", "density"):
        panels[key].set_xlabel(label)
        panels[key].locator_params(axis="x", nbins=6)
        panels[key].ticklabel_format(axis="x", style="sci", scilimits=(-3, 4), useMathText=True)
    _scales(panels["scale"], comparison, name)
    return figure


def _symbol(symbol: str) -> str:
    """A mechanism's symbol with its index lowered."""
    head, _, index = symbol_text(symbol).partition("_")
    return f"{head}$_{{\\mathrm{{{index}}}}}$" if index else head


def _shape_text(curve: Curve) -> str:
    """Which shape the curve is of."""
    shape, parts = curve.shape, []
    if shape.s_from_m is not None and shape.s_to_m is not None:
        parts.append(f"s = {shape.s_from_m:.0f} to {shape.s_to_m:.0f} m")
    if is_opposed(shape):
        parts.append("with a relief equal to it at about the typical speed")
    else:
        parts += [f"{symbol_text(symbol)} = {value:g}" for symbol, value in shape.constants]
    parts += [f"sensor {shape.sensor}"] if shape.sensor else []
    parts += [f"covariate {shape.covariate}"] if shape.covariate else []
    return "its most probable shape: " + ", ".join(parts) if parts else "along the whole track"


def _log_prior(curve: Curve, strengths: FloatArray) -> FloatArray:
    added = curve.mechanism.added
    assert added is not None
    scale = added.scale_of(curve.shape)
    constant = -0.5 * math.log(2.0 * math.pi * scale**2) + (0.0 if added.either_sign else math.log(2.0))
    return np.asarray(-0.5 * (strengths / scale) ** 2 + constant)


def _evidence(axes: Axes, curve: Curve) -> None:
    strengths, log_density = curve.fine()
    line = log_density - _log_prior(curve, strengths)
    top = max(float(line.max()), float(curve.log_evidence.max()), 0.0)
    bottom = max(min(float(line.min()), -1.0), top - _DEPTH)
    axes.plot(strengths, line, color=AFTER, linewidth=1.4)
    axes.plot(curve.strengths, curve.log_evidence, linestyle="none", marker="o", markersize=4, color=RECORDED)
    axes.axhline(0.0, color=GREY, linewidth=0.8)
    axes.set_ylim(bottom - 0.04 * (top - bottom), top + 0.1 * (top - bottom))
    if bottom > 0.0:
        axes.set_title(f"strength 0 lies at 0, {top:.0f} nats below the top", fontsize=7, color=GREY)
    near = strengths[line >= bottom]
    low, high = min(0.0, float(near.min())), max(0.0, float(near.max()))
    axes.set_xlim(low - 0.03 * (high - low), high + 0.03 * (high - low))
    axes.set_ylabel("log evidence\nagainst strength 0 [nats]")
    axes.grid(axis="y")


def _densities(axes: Axes, curve: Curve, found: Diagnosis, step: Step | None, number: int) -> None:
    strengths, log_density = curve.fine()
    posterior = np.exp(log_density - log_density.max())
    posterior /= np.trapezoid(posterior, strengths)
    if step is not None:
        problem = found.steps[-1].calibration.problem
        name = problem.added[number].name  # type: ignore[attr-defined]
        values = chains_of(found.steps[-1].calibration.tree, name).ravel()
        reach = max(float(np.ptp(values)), 1e-12)
        grid = np.linspace(values.min() - 0.1 * reach, values.max() + 0.1 * reach, 300)
        axes.fill_between(
            grid,
            density(values, grid),
            color=tint(AFTER, 0.35),
            linewidth=0,
            label="calibrated with all else",
        )
    axes.plot(strengths, posterior, color=AFTER, linewidth=1.4, label="from the comparison, if it is there")
    axes.plot(
        strengths,
        np.exp(_log_prior(curve, strengths)),
        color=INK,
        linestyle="--",
        linewidth=1.0,
        label="prior",
    )
    axes.set_ylim(bottom=0.0)
    axes.set_yticks([])
    axes.set_ylabel("probability density")
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=1, borderaxespad=0.1, fontsize=7)


def _scales(axes: Axes, comparison: Comparison, name: str) -> None:
    """Log Bayes factor against the prior's scale, of the leading candidates."""
    shares = comparison.probability
    listed = sorted((n for n in shares if n not in (NOTHING, UNLISTED)), key=lambda n: -shares[n])
    names = [name, *(n for n in listed if n != name and shares[n] > 0.01)][:_MOST_LINES]
    for other, colour in zip(names, _LINES, strict=False):
        candidate = leading(comparison, other)
        added = candidate.mechanism.added
        assert added is not None
        values = [factor_at(candidate, relative) for relative in _RELATIVE]
        unit = bracketed(candidate.mechanism.strength.unit).strip().strip("[]")
        label = f"{figure_text(short_title(other), 44)} (scale {added.scale:g}{' ' + unit if unit else ''})"
        axes.plot(
            _RELATIVE, values, color=colour, linewidth=2.0 if other == name else 1.1, marker="o",
            markersize=3, label=label,
        )  # fmt: skip
    axes.axvline(1.0, color=GREY, linestyle="--", linewidth=0.9)
    axes.axhline(0.0, color=GREY, linewidth=0.8)
    axes.set_xscale("log")
    ticks = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)
    axes.set_xticks(ticks, [fixed(t, 1) if t < 1 else f"{t:.0f}" for t in ticks])
    axes.minorticks_off()
    axes.set_xlabel("scale of the strength's prior, relative to the one used (dashed) [-]")
    axes.set_ylabel("log Bayes factor\nagainst nothing [nats]")
    axes.grid(axis="y", color=PALE)
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderaxespad=0.1, fontsize=7)
