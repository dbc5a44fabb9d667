"""The axis of probabilities that figures of predictions have."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_TICKS = (1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005)


def probability_axis(axes: Axes, least: float) -> None:
    """Make the upright axis one of probabilities in percent, from a least one to all."""
    axes.set_yscale("log")
    axes.set_ylim(least, 1.15)
    axes.set_yticks(_TICKS, [f"{100 * tick:g} %" for tick in _TICKS])
    axes.minorticks_off()
