"""Figure of the named places: how often which speed and which impact pressure is exceeded."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from skred.report.prediction.axis import probability_axis
from skred.report.shared.document import get, listed
from skred.report.shared.labels import figure_text, unit_text
from skred.report.shared.marks import mark
from skred.report.shared.style import (
    GREY,
    PALETTE,
    legend_below,
    new_figure,
    side_by_side,
    styled,
)

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from skred.report.shared.document import Document

MOST_SHOWN = 7
"""Places drawn at most, the lowest: more lines are not told apart, and fewer avalanches come there."""
_FLOOR, _LEAST = 0.0005, 0.005
_DASHES = ("-", (0, (6, 2)), (0, (1.5, 1.5)), (0, (6, 2, 1.5, 2)))


@styled
def places_figure(document: Document, tree: xr.DataTree) -> Figure:
    """Probability that an avalanche exceeds a speed, and an impact pressure, at each named place.

    Parameters
    ----------
    document : mapping
        The content of ``prediction.json``.
    tree : DataTree
        The content of ``prediction.nc``.
    """
    data = tree.to_dataset()
    n, name = len(data["at"]), figure_text(data.attrs["track"], 40)
    title = f"At the {f'{MOST_SHOWN} lowest of {n}' if n > MOST_SHOWN else 'named'} places of {name}"
    figure = new_figure(3.9, f"{title}\nlines: of all avalanches; bands: 90 % credible")
    speed, pressure = side_by_side(figure, 2, sharey=True)
    for axes, name, words in ((speed, "speed", "front speed"), (pressure, "pressure", "impact pressure")):
        _curves(axes, data, name)
        unit = data[f"{name}_threshold"].attrs["units"]
        axes.set_xlabel(f"{words} U [{unit_text(unit)}]" if name == "speed" else f"{words} p [{unit}]")
        axes.set_title(f"Share of avalanches that exceed the {words}")
        for row in _thresholds(document, name):
            axes.axvline(row, color=GREY, linewidth=0.7, linestyle=(0, (2, 2)))
    speed.set_ylabel("probability for an avalanche")
    probability_axis(speed, _LEAST)
    legend_below(figure, (speed,), columns=3)
    return figure


def _thresholds(document: Document, name: str) -> list[float]:
    """Thresholds that were asked for."""
    places = listed(document, "at")
    return [float(row["threshold"]) for row in listed(places[0], name, "above")] if places else []


def _curves(axes: Axes, data: xr.Dataset, name: str) -> None:
    """One line and band for each place."""
    at = data[f"{name}_threshold"].values
    data = data.isel(at=slice(-MOST_SHOWN, None))
    for k, place in enumerate(data["at"].values):
        value, low, high = (
            np.maximum(data[f"{name}_exceedance{end}"].values[k], _FLOOR) for end in ("", "_low", "_high")
        )
        colour, dashes = PALETTE[k % len(PALETTE)], _DASHES[k % len(_DASHES)]
        axes.fill_between(at, low, high, color=colour, alpha=0.16, linewidth=0)
        label = figure_text(place, 30)
        unit = unit_text(data[f"{name}_threshold"].attrs["units"])
        told = [
            f"{place}: {100 * v:.3g} % exceed {t:.3g} {unit} ({100 * a:.3g} to {100 * b:.3g} %)"
            for t, v, a, b in zip(at, value, low, high, strict=True)
        ]
        step = max(1, len(at) // 40)
        mark(axes, at[::step], value[::step], told[::step])
        axes.plot(at, value, color=colour, linestyle=dashes, linewidth=1.6, label=label)
    least = [data[f"{name}_exceedance_high"].values[k] for k in range(len(data["at"]))]
    seen = np.flatnonzero(np.max(least, axis=0) >= _LEAST)
    axes.set_xlim(0, float(at[min(len(at) - 1, seen[-1] + 1)]) if len(seen) else float(at[-1]))
    axes.grid(axis="y")


def has_places(document: Document) -> bool:
    """Whether there is anything to draw."""
    return bool(listed(document, "at")) and get(document, "valid") is True
