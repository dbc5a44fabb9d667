"""Retardation between LC and CD, avalanche by avalanche: recorded, under M2, and with the unlisted force.

The data's README tells of six avalanches that retard there by two to three m/s² more than the others.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from skred.diagnosis.discrepancy.profile import combined, most_probable
from skred.diagnosis.evidence.extension import extended
from skred.diagnosis.evidence.prior_odds import UNLISTED
from skred.diagnosis.evidence.refit import Fit
from skred.inference.pooled.problem import pooled_problem
from skred.report.shared.style import GREY, RECORDED, legend_below, new_figure, styled
from studies.reproduction.facts import RecordedRetardation, mean_retardation, recorded_retardation

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from skred.diagnosis.outcome import Diagnosis
    from skred.physics.mechanisms.spec import Direction

FloatArray = NDArray[np.float64]
FIRST, LAST = "LC", "CD"
_MOST_OF_IT = 50.0
"""Percent of the gap between the groups from which on it is said to be accounted for."""


def retardations(found: Diagnosis) -> list[dict[str, Any]]:
    """Of each avalanche with both speeds: recorded, and of its most probable front by either law [m/s²].

    Those on the far side of the widest gap between recorded ones are the group that retards more.
    """
    campaign, under_errors = found.problem.campaign, found.comparison.leading(UNLISTED)
    recorded = recorded_retardation(pooled_problem(campaign), FIRST, LAST)
    more, _, _ = recorded.groups()
    base, profile = under_errors.base, most_probable(under_errors.profiles)
    force = combined(base.setting, profile.kind, profile.knots_m, profile.mean)
    ids = campaign.event_ids
    modelled = {
        "base": _retardations(found, base.fit, (), recorded),
        "with_force": _retardations(found, profile.fit, (force,), recorded),
    }
    speeds = found.problem.values[:, campaign.sensor_ids.index(FIRST)]
    return [
        {
            "event": event,
            "retards_more": event in more,
            "front_speed_m_s": float(speeds[ids.index(event)]),
            "recorded": -float(value),
            **{name: float(values[ids.index(event)]) for name, values in modelled.items()},
        }
        for event, value in zip(recorded.events, recorded.values, strict=True)
    ]


def _retardations(
    found: Diagnosis, fit: Fit, directions: Sequence[Direction], between: RecordedRetardation
) -> FloatArray:
    """Of the events' most probable fronts on the way between the sensors [m/s²]."""
    law = extended(found.problem, found.law, tuple(directions))
    sensor = found.problem.campaign.sensors[found.problem.campaign.sensor_ids.index(FIRST)]
    ends = np.array([sensor.s_from_m, sensor.s_from_m + between.length_m], dtype=float)
    squares = law.speeds(fit.points, np.ones(len(directions))) ** 2
    edge = np.asarray(found.problem.terrain.edge_s_m)
    speeds = np.sqrt([np.interp(ends, edge, row) for row in squares])
    return -mean_retardation(speeds[:, 0], speeds[:, 1], between.length_m, between.drop_m)


@styled
def groups_figure(rows: Sequence[dict[str, Any]]) -> Figure:
    """Modelled against recorded, without the force and with it."""
    figure = new_figure(3.6, f"Mean retardation between {FIRST} and {LAST}, avalanche by avalanche")
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    for axes, (key, title) in zip(panels, (("base", "M2"), ("with_force", "M2 and the force")), strict=True):
        axes.axline((5.0, 5.0), slope=1.0, color=GREY, lw=0.8)
        for six, marker, label in ((False, "o", "the others"), (True, "D", "the six")):
            own = [row for row in rows if row["retards_more"] == six]
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
    shown = ("recorded", "base", "with_force")
    apart = " | ".join(f"{gap[key]:.1f}" for key in shown)
    return f"""### The two groups

The data's README tells of six avalanches that decelerate more between LC and CD. The table has their mean
retardation there: from the recorded speeds, and from each avalanche's most probable front under M2, without
and with the force that is not in the list. Where no speed was left at CD, the recorded value is a lower
bound.

| | avalanches | speed at LC [m/s] | recorded [m/s²] | M2 | M2 and the force |
| --- | --- | --- | --- | --- | --- |
{table}| difference | | | {apart} |

Correlation of modelled with recorded retardation:

| avalanches | M2 | M2 and the force |
| --- | --- | --- |
| all {len(rows)} | {alike[0]:.2f} | {alike[1]:.2f} |
| the others alone | {among[0]:.2f} | {among[1]:.2f} |

With the force the difference is {kept:.0f} % of the recorded one. {_told(kept)}

![Modelled and recorded retardation between LC and CD](figures/ryggfonn-groups.png)
"""


def _told(kept: float) -> str:
    """What follows from how much of the gap between the groups is kept, in percent."""
    if kept >= _MOST_OF_IT:
        return "So the force accounts for most of the difference."
    return (
        "The force depends on a front's speed, and it does not\n"
        "explain the difference. What sets the six apart is left open."
    )


def _line(name: str, own: Sequence[dict[str, Any]]) -> str:
    speed = _mean(own, "front_speed_m_s")
    means = " | ".join(f"{_mean(own, key):.1f}" for key in ("recorded", "base", "with_force"))
    return f"| {name} | {len(own)} | {speed:.0f} | {means} |\n"


def _parts(rows: Sequence[dict[str, Any]]) -> list[tuple[str, list[dict[str, Any]]]]:
    return [
        ("the six", [row for row in rows if row["retards_more"]]),
        ("the others", [row for row in rows if not row["retards_more"]]),
    ]


def _mean(rows: Sequence[dict[str, Any]], key: str) -> float:
    return float(np.mean([row[key] for row in rows]))


def _correlation(rows: Sequence[dict[str, Any]], key: str) -> float:
    return float(np.corrcoef([row["recorded"] for row in rows], [row[key] for row in rows])[0, 1])
