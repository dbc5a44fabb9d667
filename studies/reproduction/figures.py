"""Two figures: the joint posterior of M2, and what every alternative does to each strength."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from skred.report.shared.style import GREY, INK, new_figure, styled, write_png
from studies.reproduction.cases import Outcome
from studies.reproduction.facts import BELOW_BOWL_S_M
from studies.reproduction.quadrature import GridPosterior
from studies.reproduction.study import PAPER, RUNOUT, Study

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PAPER_COLOUR, OURS, OTHER = "#D55E00", "#0072B2", "#555555"
_CONTOURS = (
    ("diagonal", "Sigma without correlation", "#009E73", "--"),
    ("spans", "span means", "#CC79A7", "-."),
    ("dropped", "complete events only", "#E69F00", ":"),
)
_PANELS = (
    ("coulomb", 0, "M1: a0 [-]", 1.0),
    ("pcm", 0, "M2: a0 [-]", 1.0),
    ("pcm", 1, "M2: a2 [1e-3 1/m]", 1e3),
    ("constant", 0, "M3: a3 [m/s²]", 1.0),
)
_OFF_SCALE = ("stated",)
"""Shown in the tables only: it would squeeze all others together."""


def save_reproduction_figures(study: Study, folder: Path) -> list[Path]:
    """Write ``reproduction-joint.png`` and ``reproduction-alternatives.png``."""
    folder.mkdir(parents=True, exist_ok=True)
    return [
        write_png(joint_figure(study), folder / "reproduction-joint.png"),
        write_png(forest_figure(study), folder / "reproduction-alternatives.png"),
    ]


def highest_density_levels(posterior: GridPosterior, shares: tuple[float, ...]) -> list[float]:
    """Cell weights above which lie these shares of the probability, in increasing order of weight."""
    ordered = np.sort(posterior.weights.ravel())[::-1]
    cumulative = np.cumsum(ordered)
    return sorted(float(ordered[min(int(np.searchsorted(cumulative, s)), len(ordered) - 1)]) for s in shares)


@styled
def joint_figure(study: Study) -> Figure:
    """Joint posterior of (a0, a2) with the paper's point and some alternatives."""
    figure = new_figure(4.6, "M2 on Ryggfonn: joint posterior of dry friction and turbulent drag", 7.0)
    axes = figure.add_subplot()
    posterior = study.baseline("pcm").posterior
    levels = highest_density_levels(posterior, (0.99, 0.9, 0.5))
    x, y = posterior.axes
    axes.contourf(
        x, 1e3 * y, posterior.weights.T, [*levels, posterior.weights.max()], colors=_blues(), zorder=1
    )
    handles: list[Any] = [_patch(colour, text) for colour, text in zip(_blues(), _SHARES, strict=True)]
    for key, text, colour, style in _CONTOURS:
        other = study.outcomes[key, "pcm"].posterior
        level = highest_density_levels(other, (0.9,))
        u, v = other.axes
        axes.contour(
            u, 1e3 * v, other.weights.T, level, colors=[colour], linestyles=[style], linewidths=1.3, zorder=2
        )
        handles.append(_line(colour, style, f"90 %: {text}"))
    a0, a2 = PAPER["pcm"]
    (point,) = axes.plot(
        a0, 1e3 * a2, "P", color=PAPER_COLOUR, markersize=9, linestyle="none", label="the paper: 0.2, 3e-3"
    )
    fit = next(f for f in study.fits if f.law_id == "pcm" and f.what == "LC, CD, b")
    (fitted,) = axes.plot(
        fit.strengths[0],
        1e3 * fit.strengths[1],
        "D",
        color=INK,
        markersize=6,
        linestyle="none",
        label="least squares of the plain mean speeds",
    )
    axes.set(xlabel="a0 = mu [-]", ylabel="a2 = D [1e-3 1/m]", xlim=(0.1, 0.56), ylim=(0.0, 5.2))
    _mark_the_bowl(study, axes)
    handles += [point, fitted]
    axes.legend(handles=handles, loc="upper right", fontsize=7.5)
    return figure


_SHARES = ("baseline, 99 %", "baseline, 90 %", "baseline, 50 %")


def _blues() -> list[str]:
    return ["#d6e6f2", "#8fbbdc", OURS]


def _patch(colour: str, text: str) -> Any:
    from matplotlib.patches import Patch

    return Patch(color=colour, label=text)


def _line(colour: str, style: Any, text: str) -> Any:
    from matplotlib.lines import Line2D

    return Line2D([], [], color=colour, linestyle=style, label=text)


def _mark_the_bowl(study: Study, axes: Axes) -> None:
    """Grey out where a front from s = 0 stops in the bowl."""
    a0, a2 = np.linspace(0.1, 0.56, 231), np.linspace(0.0, 5.2e-3, 131)
    nodes = np.stack(np.meshgrid(a0, a2, indexing="ij"), axis=-1).reshape(-1, 2)
    mechanisms = study.base.mechanisms("pcm")
    runout = study.base.problem.simulate(mechanisms, nodes)[:, 0, RUNOUT].reshape(len(a0), len(a2))
    stopped = (runout < BELOW_BOWL_S_M).astype(float)
    axes.contourf(a0, 1e3 * a2, stopped.T, [0.5, 1.5], colors=["#ececec"], zorder=0)
    axes.text(0.47, 2.2, "stops in\nthe bowl", color=GREY, fontsize=8)


@styled
def forest_figure(study: Study) -> Figure:
    """Posterior mean and 90 % interval of every strength under every alternative."""
    shown = [case for case in study.cases if case.key not in _OFF_SCALE]
    figure = new_figure(
        0.24 * len(shown) + 1.3, "What moves the strengths: posterior mean, 90 % interval", 10.5
    )
    panels = figure.subplots(1, len(_PANELS), sharey=True)
    rows = np.arange(len(shown))[::-1]
    for axes, (law_id, number, label, factor) in zip(panels, _PANELS, strict=True):
        for row, case in zip(rows, shown, strict=True):
            _whisker(axes, row, study.outcomes[case.key, law_id], number, factor, case is study.base)
        low, high = study.baseline(law_id).posterior.quantiles(number, (0.05, 0.95))
        axes.axvspan(factor * low, factor * high, color=OURS, alpha=0.12, linewidth=0)
        axes.axvline(factor * PAPER[law_id][number], color=PAPER_COLOUR, linewidth=1.2)
        axes.set_xlabel(label)
        if (law_id, number) == ("pcm", 1):
            axes.set_xlim(0.0, 5.0)  # runout alone leaves a2 open, far beyond the frame
        if law_id == "coulomb":
            axes.set_xlim(left=0.462)  # the paper's line would lie on the frame
        axes.grid(axis="x")
    panels[0].set_yticks(rows, [case.title for case in shown])
    panels[0].set_ylim(-0.7, len(shown) - 0.3)
    handles = [_line(PAPER_COLOUR, "-", "the paper"), _patch("#cfe0ec", "baseline, 90 %")]
    figure.legend(handles=handles, loc="outside lower right", ncols=2)
    return figure


def _whisker(axes: Axes, row: int, o: Outcome, number: int, factor: float, base: bool) -> None:
    low, high = o.posterior.quantiles(number, (0.05, 0.95))
    colour = OURS if base else OTHER
    axes.plot([factor * low, factor * high], [row, row], color=colour, linewidth=1.6)
    axes.plot(factor * o.posterior.mean[number], row, "o", color=colour, markersize=4)
