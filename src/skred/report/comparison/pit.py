"""Are predictions as sure as they should be? Places of readings in their predictions, by sensor and law."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from skred.report.comparison.parts import styles
from skred.report.shared.document import Document, get, listed, ranked
from skred.report.shared.draws import MAX_SENSORS, left_out
from skred.report.shared.labels import figure_text, printable
from skred.report.shared.marks import mark
from skred.report.shared.numbers import fixed, floats, share
from skred.report.shared.style import GREY, PALE, grid_for, legend_below, new_figure, panels_in, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]
_LEAST = 5
"""Readings below which nothing can be seen."""
_MIDDLE = (0.05, 0.95)
INSIDE = 0.9
"""Probability that the whole line stays in the band, where predictions are right."""


def _sensors(comparison: Document) -> list[str]:
    """Sensors of which some law has enough places."""
    names = (
        str(get(one, "sensor"))
        for law in ranked(comparison)
        for one in listed(law, "loo", "pit")
        if len(places_of(one)) >= _LEAST
    )
    return list(dict.fromkeys(names))


def places_of(one: Document) -> FloatArray:
    """Places between 0 and 1, those of a front that may not come in the middle of what reads 0."""
    below, up_to = (floats(listed(one, name)) for name in ("below", "up_to"))
    if len(below) != len(up_to) or len(below) != len(listed(one, "events")):
        return np.empty(0)
    middle = 0.5 * (below + up_to)
    return middle if np.isfinite(middle).all() else np.empty(0)


def _limit(n: int) -> float:
    """Half height of the band (Kolmogorov and Smirnov), for places that do not depend on each other."""
    from scipy.stats import kstwo

    return float(kstwo.ppf(INSIDE, n))


def _departure(places: FloatArray) -> float:
    """Largest distance of the share of places below a value from that value."""
    ordered, n = np.sort(places), len(places)
    above, below = np.arange(1, n + 1) / n - ordered, ordered - np.arange(n) / n
    return float(max(above.max(), below.max()))


@styled
def pit_figure(comparison: Document) -> Figure | None:
    """For each sensor and law: the share of readings below each place, less that place."""
    sensors = _sensors(comparison)
    if not sensors:
        return None
    shown = sensors[:MAX_SENSORS]
    rows, columns = grid_for(len(shown))
    title = f"Are predictions as sure as they should be?{left_out(len(sensors))}"
    figure = new_figure(1.2 + 1.9 * rows, title)
    panels = panels_in(figure, len(shown), columns, sharey=True)
    for number, (axes, sensor) in enumerate(zip(panels, shown, strict=True)):
        _panel(axes, comparison, sensor)
        if number % columns == 0:
            axes.set_ylabel("share below,\nless what is expected")
    legend_below(figure, panels, columns=5)
    return figure


def _panel(axes: Axes, comparison: Document, sensor: str) -> None:
    colours, _ = styles(comparison)
    banded = False
    for law in ranked(comparison):
        for one in listed(law, "loo", "pit"):
            places = places_of(one)
            if str(get(one, "sensor")) != sensor or len(places) < _LEAST:
                continue
            if not banded:
                limit = _limit(len(places))
                axes.axhspan(
                    -limit,
                    limit,
                    color=PALE,
                    linewidth=0,
                    label=f"holds the line with probability {INSIDE:g}",
                )
                banded = True
            name, colour = str(get(law, "id")), colours[str(get(law, "id"))]
            order = np.argsort(places, kind="stable")
            steps = np.arange(len(places) + 1) / len(places)
            x = np.repeat(np.concatenate([[0.0], places[order], [1.0]]), 2)[1:-1]
            axes.plot(x, np.repeat(steps, 2) - x, color=colour, linewidth=1.2, label=figure_text(name, 24))
            events = [str(listed(one, "events")[k]) for k in order]
            told = [
                f"{event}, {sensor}, {name}: {100 * p:.0f} % of the prediction lies below the reading"
                for event, p in zip(events, places[order].tolist(), strict=True)
            ]
            mark(axes, places[order], steps[1:] - places[order], told, events)
    axes.axhline(0.0, color=GREY, linewidth=0.8)
    axes.set_xlim(0.0, 1.0)
    axes.set_title(figure_text(sensor, 30))
    axes.set_xlabel("place of the reading in its prediction [-]")


def pit_rows(comparison: Document) -> list[dict[str, Any]]:
    """For each sensor and law: how many readings, where they lie, and how far from even, as text."""
    rows = []
    for sensor in _sensors(comparison):
        for law in ranked(comparison):
            for one in listed(law, "loo", "pit"):
                places = places_of(one)
                if str(get(one, "sensor")) != sensor or len(places) < _LEAST:
                    continue
                departure, limit = _departure(places), _limit(len(places))
                inside = float(np.mean((places > _MIDDLE[0]) & (places < _MIDDLE[1])))
                rows.append(
                    {
                        "sensor": printable(sensor),
                        "law": printable(get(law, "id")),
                        "n": len(places),
                        "mean": fixed(float(places.mean())),
                        "inside": share(inside),
                        "departure": fixed(departure),
                        "limit": fixed(limit),
                        "told": _told(places, departure > limit),
                    }
                )
    return rows


def _told(places: FloatArray, departs: bool) -> str:
    """What the places say, in words."""
    if not departs:
        return "nothing against it"
    if abs(float(places.mean()) - 0.5) > 2.0 / np.sqrt(12.0 * len(places)):
        return (
            "readings are lower than predicted"
            if places.mean() < 0.5
            else "readings are higher than predicted"
        )
    return (
        "predictions are too sure" if float(places.var()) > 1.0 / 12.0 else "predictions are not sure enough"
    )
