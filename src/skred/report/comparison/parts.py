"""What the figures that compare laws have in common."""

from __future__ import annotations

from typing import TYPE_CHECKING

from skred.report.shared.document import Document, get, listed
from skred.report.shared.labels import figure_text
from skred.report.shared.numbers import fixed, is_number
from skred.report.shared.style import GREY, PALE, law_colours, law_markers

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def law_axis(axes: Axes, laws: list[Document]) -> None:
    """One row per law, best at the top."""
    axes.set_yticks(range(len(laws)), [figure_text(law["id"], 24) for law in laws])
    axes.set_ylim(len(laws) - 0.5, -0.5)
    axes.spines["left"].set_visible(False)
    axes.tick_params(axis="y", length=0)


def styles(comparison: Document) -> tuple[dict[str, str], dict[str, str]]:
    """Colour and marker of each law."""
    ids = [str(law["id"]) for law in listed(comparison, "models")]
    return law_colours(ids), law_markers(ids)


def typeset(number: float) -> str:
    """Two decimals, with the minus sign of the axes."""
    return fixed(number).replace("-", "\N{MINUS SIGN}")


def practical_band(axes: Axes, comparison: Document) -> None:
    """No difference of elpd, and those that are none in practice."""
    least = get(comparison, "limits", "practical_difference")
    if is_number(least):
        label = f"no practical difference: less than {least:.0f}"
        axes.axvspan(-least, least, color=PALE, alpha=0.7, linewidth=0, label=label)
    axes.axvline(0, color=GREY, linewidth=0.8)
