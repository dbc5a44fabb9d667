"""Are predictions as sure as they should be? Places of readings in their predictions, by sensor and law."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from skred.arrays import FloatArray
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

_LEAST = 5
"""Readings below which nothing can be seen."""
_MIDDLE = (0.05, 0.95)
INSIDE = 0.9
"""Probability that the whole line stays in the band, where predictions are right."""


@dataclass(frozen=True, eq=False)
class Places:
    """Places of one sensor's readings in their predictions.

    Attributes
    ----------
    events : list of str
    below, up_to : (n,) arrays
        Probability of a reading that is smaller, and of one that is not larger. Between them the place of a
        front that may not come, which reads 0, is spread evenly (Czado, Gneiting and Held, 2009).
    """

    events: list[str]
    below: FloatArray
    up_to: FloatArray

    @property
    def middle(self) -> FloatArray:
        """One place for each reading."""
        return 0.5 * (self.below + self.up_to)

    @property
    def spread(self) -> FloatArray:
        """One place for each reading, those of fronts that may not come evenly over their ranges."""
        wide = self.up_to > self.below
        part = np.full(len(self.below), 0.5)
        n = int(np.count_nonzero(wide))
        part[wide] = (np.arange(n) + 0.5) / max(n, 1)
        return np.asarray(self.below + part * (self.up_to - self.below))

    def line(self) -> tuple[FloatArray, FloatArray]:
        """Corners of the share of readings below a place, less that place."""
        at = np.unique(np.concatenate([[0.0, 1.0], self.below, self.up_to]))
        width = self.up_to - self.below
        spread = np.clip((at[:, None] - self.below) / np.where(width > 0.0, width, 1.0), 0.0, 1.0)
        before, after = (
            np.where(width > 0.0, spread, step(at[:, None], self.below)).mean(axis=1) - at
            for step in (np.greater, np.greater_equal)
        )
        return np.repeat(at, 2), np.column_stack([before, after]).ravel()

    def share_inside(self, low: float, high: float) -> float:
        """Share of the places between two values."""
        at, line = self.line()
        return float(np.interp(high, at, line + at) - np.interp(low, at, line + at))


def _sensors(comparison: Document) -> list[str]:
    """Sensors of which some law has enough places."""
    names = (
        str(get(one, "sensor"))
        for law in ranked(comparison)
        for one in listed(law, "loo", "pit")
        if places_of(one) is not None
    )
    return list(dict.fromkeys(names))


def _of(comparison: Document, sensor: str) -> list[tuple[str, Places]]:
    """Each law's places of a sensor."""
    found = []
    for law in ranked(comparison):
        for one in listed(law, "loo", "pit"):
            places = places_of(one)
            if str(get(one, "sensor")) == sensor and places is not None:
                found.append((str(get(law, "id")), places))
    return found


def places_of(one: Document) -> Places | None:
    """Places of a sensor's readings; None where there are too few, or numbers are missing."""
    events = list(map(str, listed(one, "events")))
    below, up_to = (floats(listed(one, name)) for name in ("below", "up_to"))
    whole = len(below) == len(up_to) == len(events) >= _LEAST
    return Places(events, below, up_to) if whole and np.isfinite(below + up_to).all() else None


def _limit(n: int) -> float:
    """Half height of the band (Kolmogorov and Smirnov), for places that do not depend on each other."""
    from scipy.stats import kstwo

    return float(kstwo.ppf(INSIDE, n))


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
    for number, (law, places) in enumerate(_of(comparison, sensor)):
        if number == 0:
            limit = _limit(len(places.events))
            label = f"holds the line with probability {INSIDE:g}"
            axes.axhspan(-limit, limit, color=PALE, linewidth=0, label=label)
        x, y = places.line()
        axes.plot(x, y, color=colours[law], linewidth=1.2, label=figure_text(law, 24))
        told = [
            f"{event}, {sensor}, {law}: {100 * p:.0f} % of the prediction lies below the reading"
            for event, p in zip(places.events, places.middle.tolist(), strict=True)
        ]
        mark(axes, places.middle, np.interp(places.middle, x, y), told, places.events)
    axes.axhline(0.0, color=GREY, linewidth=0.8)
    axes.set_xlim(0.0, 1.0)
    axes.set_title(figure_text(sensor, 30))
    axes.set_xlabel("place of the reading in its prediction [-]")


def places_by_sensor(comparison: Document) -> list[tuple[str, str, Places]]:
    """Sensor, law and places of the readings, of all that have enough."""
    return [
        (sensor, law, places) for sensor in _sensors(comparison) for law, places in _of(comparison, sensor)
    ]


def pit_rows(comparison: Document) -> list[dict[str, Any]]:
    """For each sensor and law: how many readings, where they lie, and how far from even, as text."""
    rows = []
    for sensor, law, places in places_by_sensor(comparison):
        _, line = places.line()
        limit = _limit(len(places.events))
        rows.append(
            {
                "sensor": printable(sensor),
                "law": printable(law),
                "n": len(places.events),
                "mean": fixed(float(places.middle.mean())),
                "inside": share(places.share_inside(*_MIDDLE)),
                "departure": fixed(float(np.abs(line).max())),
                "limit": fixed(limit),
                "told": told(line, limit),
            }
        )
    return rows


def told(line: FloatArray, limit: float) -> str:
    """What the line of the places says, in words."""
    above, below = float(line.max()) > limit, float(line.min()) < -limit
    if above and below:
        return (
            "predictions are too sure" if line.argmax() < line.argmin() else "predictions are not sure enough"
        )
    if above or below:
        return f"readings are {'lower' if above else 'higher'} than predicted"
    return "nothing against it"
