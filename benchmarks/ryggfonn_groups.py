"""Retardation between LC and CD, avalanche by avalanche: recorded, under M2, and with the unlisted force.

The data's README tells of six avalanches that retard there by two to three m/s² more than the others.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from skred.diagnosis.curves import Fit
from skred.diagnosis.extension import extended
from skred.diagnosis.odds import UNLISTED
from skred.diagnosis.unlisted import combined, most_probable
from skred.physics.columns import GRAVITY
from skred.report.style import GREY, RECORDED, legend_below, new_figure, styled

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from skred.diagnosis.diagnose import Diagnosis
    from skred.inference.hierarchical import HierarchicalProblem
    from skred.physics.mechanisms.spec import Direction

FloatArray = NDArray[np.float64]
FIRST, LAST = "LC", "CD"
SIX = ("19750225", "19970417", "20000217", "20040228", "20050416", "20070322")
"""Those that retard more, as the data's README has them."""
_MOST_OF_IT = 50.0


def retardations(found: Diagnosis) -> list[dict[str, Any]]:
    """Of each avalanche with both speeds: recorded, and of its most probable front by either law."""
    assert found.race is not None
    problem, heat = found.problem, found.race.leading(UNLISTED)
    base, profile = heat.base, most_probable(heat.profiles)
    force = combined(base.setting, profile.kind, profile.knots_m, profile.mean)
    first, last = (problem.campaign.sensor_ids.index(name) for name in (FIRST, LAST))
    recorded = problem.values[:, [first, last]]
    modelled = {
        "base": _speeds(found, base.fit, ()),
        "with_force": _speeds(found, profile.fit, (force,)),
    }
    both = np.flatnonzero(problem.observed[:, first] & problem.observed[:, last])
    return [
        {
            "event": problem.campaign.events[k].id,
            "front_speed_m_s": float(recorded[k, 0]),
            "recorded": _retardation(problem, recorded[k]),
            **{name: _retardation(problem, speeds[k]) for name, speeds in modelled.items()},
        }
        for k in both
    ]


def _places(problem: HierarchicalProblem) -> list[float]:
    """Of the two sensors [m]; of a span its middle."""
    places = dict(zip(problem.campaign.sensor_ids, problem.sensor_places, strict=True))
    return [0.5 * sum(places[name] or (np.nan, np.nan)) for name in (FIRST, LAST)]


def _speeds(found: Diagnosis, fit: Fit, directions: Sequence[Direction]) -> FloatArray:
    """Of the most probable fronts at the two sensors [m/s], (n_events, 2)."""
    law = extended(found.problem, found.law, tuple(directions))
    speeds = law.speeds(fit.points, np.ones(len(directions)))
    edge, places = np.asarray(found.problem.terrain.edge_s_m), _places(found.problem)
    return np.sqrt([np.interp(places, edge, row) for row in speeds**2])


def _retardation(problem: HierarchicalProblem, speeds: FloatArray) -> float:
    """Mean over the way between two speeds [m s-2]: what gravity gives, less what is gained."""
    edge, (start, end) = np.asarray(problem.terrain.edge_s_m), _places(problem)
    inside = np.clip(edge, start, end)
    fallen = float(np.diff(inside) @ problem.terrain.sin_slope)
    return float((GRAVITY * fallen - 0.5 * (speeds[1] ** 2 - speeds[0] ** 2)) / (end - start))


@styled
def groups_figure(rows: Sequence[dict[str, Any]]) -> Figure:
    """Modelled against recorded, without the force and with it."""
    figure = new_figure(3.6, f"Mean retardation between {FIRST} and {LAST}, avalanche by avalanche")
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    for axes, (key, title) in zip(panels, (("base", "M2"), ("with_force", "M2 and the force")), strict=True):
        axes.axline((5.0, 5.0), slope=1.0, color=GREY, lw=0.8)
        for six, marker, label in ((False, "o", "the others"), (True, "D", "the six")):
            own = [row for row in rows if (row["event"] in SIX) == six]
            axes.plot(
                [row["recorded"] for row in own],
                [row[key] for row in own],
                marker,
                color=RECORDED,
                mfc=RECORDED if six else "white",
                ms=4.5,
                label=label,
            )
        axes.set_title(title)
        axes.set_xlabel("recorded [m s$^{-2}$]")
    panels[0].set_ylabel("most probable front [m s$^{-2}$]")
    legend_below(figure, panels, columns=2)
    return figure


def words(rows: Sequence[dict[str, Any]]) -> str:
    """The section of the page."""
    if not rows:
        return ""
    table = "".join(_line(name, own) for name, own in _parts(rows))
    six, others = (own for _, own in _parts(rows))
    gap = {key: _mean(six, key) - _mean(others, key) for key in ("recorded", "base", "with_force")}
    kept = 100.0 * gap["with_force"] / gap["recorded"]
    alike, among = ([_correlation(own, key) for key in ("base", "with_force")] for own in (rows, others))
    return f"""### The two groups

The data's README tells of six avalanches that retard more between LC and CD. Mean retardation there, by the
recorded speeds and by each avalanche's most probable front under M2, without and with the unlisted force:

| | avalanches | speed at LC [m/s] | recorded [m/s²] | M2 | M2 and the force |
| --- | --- | --- | --- | --- | --- |
{table}
The six retard by {gap["recorded"]:.1f} m/s² more as recorded, by {gap["base"]:.1f} under M2 with friction and
drag of their own, and by {gap["with_force"]:.1f} with the force, {kept:.0f} % of what was recorded.
Correlation with what was recorded, without and with it: {alike[0]:.2f} and {alike[1]:.2f} over all
{len(rows)}, {among[0]:.2f} and {among[1]:.2f} among the others alone.
(Where no speed was left at CD, what is recorded is the least that it can have been.)
{_told(kept)}

![Modelled and recorded retardation between LC and CD](figures/ryggfonn-groups.png)
"""


def _told(kept: float) -> str:
    """What follows from how much of the gap between the groups is kept, in percent."""
    if kept >= _MOST_OF_IT:
        return "So the force accounts for most of what sets the six apart."
    return (
        "So the tool does not find these groups: what it lets in goes with a front's speed, and leaves\n"
        "the gap as it was. What sets the six apart is left open."
    )


def _line(name: str, own: Sequence[dict[str, Any]]) -> str:
    speed = _mean(own, "front_speed_m_s")
    means = " | ".join(f"{_mean(own, key):.1f}" for key in ("recorded", "base", "with_force"))
    return f"| {name} | {len(own)} | {speed:.0f} | {means} |\n"


def _parts(rows: Sequence[dict[str, Any]]) -> list[tuple[str, list[dict[str, Any]]]]:
    return [
        ("the six", [row for row in rows if row["event"] in SIX]),
        ("the others", [row for row in rows if row["event"] not in SIX]),
    ]


def _mean(rows: Sequence[dict[str, Any]], key: str) -> float:
    return float(np.mean([row[key] for row in rows]))


def _correlation(rows: Sequence[dict[str, Any]], key: str) -> float:
    return float(np.corrcoef([row["recorded"] for row in rows], [row[key] for row in rows])[0, 1])
