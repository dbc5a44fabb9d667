"""Figure of the bootstrap test: the recordings against clean campaigns simulated from the law."""

from __future__ import annotations

import math
from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np

from skred.arrays import FloatArray
from skred.report.diagnosis.words import AFTER, MISMATCH, with_added
from skred.report.shared import document as doc
from skred.report.shared.html import two_digits
from skred.report.shared.labels import figure_text
from skred.report.shared.style import (
    legend_below,
    new_figure,
    side_by_side,
    styled,
    tint,
)

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@styled
def check_figure(document: doc.Document, tree: xr.DataTree) -> Figure | None:
    """The statistic of clean campaigns and of the recordings, for each law that any were simulated from."""
    found = tree["check"].to_dataset()
    simulated = np.asarray(found["simulated"].transpose("law", "campaign").values, dtype=float)
    title = "Is anything wrong? The recordings against clean campaigns simulated from the law"
    shown = [number for number, values in enumerate(simulated) if np.isfinite(values).any()]
    if not shown:
        return None
    figure = new_figure(3.3, title)
    panels = side_by_side(figure, len(shown))
    checks = doc.listed(document, "report", "checks")
    for number, axes in zip(shown, panels, strict=True):
        values = simulated[number][np.isfinite(simulated[number])]
        _histogram(axes, values, float(found["statistic"].values[number]))
        check = checks[number] if number < len(checks) else {}
        # Of three laws beside each other, the name of each in lines that fit.
        name = wrap(figure_text(with_added(document, doc.listed(check, "added")), 80), 27)
        p_value = f"p {'≤' if doc.get(check, 'is_bound') else '='} {two_digits(doc.get(check, 'p_value'))}"
        axes.set_title("\n".join([*name, f"{p_value}, {len(values)} simulated"]))
        axes.set_xlabel("log odds of anything\nagainst nothing [nats]")
    panels[0].set_ylabel("clean campaigns")
    legend_below(figure, panels, columns=2)
    return figure


def _histogram(axes: Axes, values: FloatArray, statistic: float) -> None:
    low, high = float(values.min()), float(values.max())
    reach = [low, high, statistic]
    least = (max(reach) - min(reach)) / 60.0  # or else bars cannot be seen beside a distant line
    wanted = int(np.clip(2.0 * math.sqrt(len(values)), 8, 40))
    n = max(1, min(wanted, math.ceil((high - low) / max(least, 1e-12))))
    bins = low + max((high - low) / n, least, 1e-12) * np.arange(n + 1)
    bins[-1] += 1e-9
    axes.hist(
        values, bins=list(bins), color=tint(AFTER, 0.45), edgecolor="white", linewidth=0.4,
        label="clean campaigns",
    )  # fmt: skip
    axes.axvline(statistic, color=MISMATCH, linewidth=2.0, label="the recordings")
    margin = 0.06 * (max(reach) - min(reach)) or 1.0
    axes.set_xlim(min(reach) - margin, max(reach) + margin)
