"""How every figure looks, and how one is written.

Matplotlib is imported inside the functions: it takes half a second, and the command line's help
must not wait for it. Figures are made through the object interface, so nothing global is touched.
"""

from __future__ import annotations

import os
import textwrap
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

from skred.report.shared.marks import notes_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap
    from matplotlib.figure import Figure

DPI = 150
_LEGEND_WIDTH = 122
_NARROW_TITLE, _NARROW_LABEL = 42, 46
"""Characters of a line of a title, and of a legend, in a narrow figure."""
WIDTH, NARROW_WIDTH = 7.6, 3.7
"""Width of a figure in inches: the report's column, and the screen of a telephone."""
INK, GREY, PALE = "#222222", "#767676", "#e4e4e4"
RECORDED = "#111111"
"""What was recorded is black in every figure."""

# Okabe and Ito (2008): told apart with any colour vision; the yellow is too pale for lines.
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#5E4B3C")
MARKERS = ("o", "s", "D", "^", "v", "P")  # one fewer than colours: together they repeat late
_RC: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "axes.titlesize": 9,
    "axes.titlelocation": "left",
    "axes.labelsize": 8.5,
    "axes.labelcolor": INK,
    "axes.edgecolor": GREY,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "text.color": INK,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "grid.color": PALE,
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "figure.titlesize": 10,
    "figure.titleweight": "normal",
    "figure.dpi": DPI,
    "savefig.dpi": DPI,
}


_NARROW: ContextVar[bool] = ContextVar("narrow", default=False)


@contextmanager
def narrow() -> Iterator[None]:
    """Make figures for the screen of a telephone: panels below each other, letters not smaller."""
    token = _NARROW.set(True)
    try:
        yield
    finally:
        _NARROW.reset(token)


def is_narrow() -> bool:
    """Whether figures are made for a narrow screen."""
    return _NARROW.get()


def folded(text: str, length: int) -> str:
    """A label of a narrow figure, in lines of at most `length` characters; as it is in a wide one."""
    return fold(text, length) if is_narrow() else text


def fold(text: str, length: int) -> str:
    """Text in lines of at most `length` characters, where it already has lines as well."""
    lines = [textwrap.wrap(line, max(length, 4), break_long_words=False) or [""] for line in text.split("\n")]
    return "\n".join(part for line in lines for part in line)


def styled[**P, R](make: Callable[P, R]) -> Callable[P, R]:
    """Run a figure function in the report's style, whatever the user's own settings are."""

    @wraps(make)
    def wrapper(*args: P.args, **kwargs: P.kwargs) -> R:
        import matplotlib

        # Matplotlib's own defaults first: a user's matplotlibrc may ask for LaTeX.
        with matplotlib.rc_context():
            matplotlib.rcdefaults()
            matplotlib.rcParams.update(_RC)
            return make(*args, **kwargs)

    return wrapper


def law_colours(law_ids: Iterable[str]) -> dict[str, str]:
    """One colour per law, the same in every figure of an installation."""
    return {law_id: PALETTE[place % len(PALETTE)] for law_id, place in _places(law_ids).items()}


def law_markers(law_ids: Iterable[str]) -> dict[str, str]:
    """One marker per law, for eyes and printers that do not tell colours apart."""
    return {law_id: MARKERS[place % len(MARKERS)] for law_id, place in _places(law_ids).items()}


def _places(law_ids: Iterable[str]) -> dict[str, int]:
    """Place in the list of installed laws; laws that are not installed follow."""
    from skred.physics.laws import law_ids as installed_ids

    wanted, installed = set(law_ids), installed_ids()
    order = [*installed, *sorted(wanted - set(installed))]
    return {law_id: place for place, law_id in enumerate(order) if law_id in wanted}


def shades(colour: str, n: int) -> list[Any]:
    """Shades of one colour from dark to light, for the chains of one law."""
    from matplotlib.colors import to_rgb

    red, green, blue = to_rgb(colour)
    mixed = []
    for k in range(n):
        amount = -0.55 + 1.05 * (k / max(1, n - 1))
        target = 1.0 if amount > 0 else 0.0
        mixed.append(tuple(c + (target - c) * abs(amount) for c in (red, green, blue)))
    return mixed


def tint(colour: str, amount: float) -> tuple[float, float, float]:
    """A colour mixed with white: opaque, so that it looks the same in a legend and over another."""
    from matplotlib.colors import to_rgb

    red, green, blue = (1.0 + (part - 1.0) * amount for part in to_rgb(colour))
    return red, green, blue


def shade_map(colour: str) -> Colormap:
    """Colour map from white to a dark shade of one colour."""
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list("shades", ["#ffffff", colour, shades(colour, 2)[0]])


def new_figure(height: float, title: str, width: float = WIDTH) -> Figure:
    """Empty figure, inches, with its title at the left; for a narrow screen as wide as that."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    if is_narrow():
        folded_title = fold(title, _NARROW_TITLE)
        height += 0.16 * (folded_title.count("\n") - title.count("\n"))
        width, title = min(width, NARROW_WIDTH), folded_title
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title, x=0.01, ha="left", linespacing=1.35)
    return figure


def grow(figure: Figure, factor: float) -> None:
    """Make a figure taller."""
    width, height = figure.get_size_inches()
    figure.set_size_inches(float(width), factor * float(height))


def side_by_side(
    figure: Figure, n: int, *, sharey: bool = False, width_ratios: Sequence[float] | None = None
) -> list[Axes]:
    """`n` panels beside each other; in a narrow figure below each other, and it grows as much.

    In a narrow figure, panels without a label of their own at the left get that of the first.
    """
    if not is_narrow() or n == 1:
        return list(figure.subplots(1, n, squeeze=False, sharey=sharey, width_ratios=width_ratios)[0])
    width, height = figure.get_size_inches()
    figure.set_size_inches(width, height + (n - 1) * max(0.62 * height, 1.3))
    panels = list(figure.subplots(n, 1, squeeze=False, sharey=sharey)[:, 0])
    notes_of(figure).stacked.append(panels)
    return panels


def grid_for(n: int) -> tuple[int, int]:
    """Rows and columns of a figure with one panel for each of `n` sensors."""
    if is_narrow():
        return n, 1
    columns = 1 if n == 1 else 2 if n <= 4 else 3
    return -(-n // columns), columns


def panels_in(figure: Figure, n: int, columns: int, *, sharey: bool = False) -> list[Axes]:
    """`n` panels, row by row; the last row need not be full."""
    if is_narrow():
        columns = 1
    panels = figure.subplots(-(-n // columns), columns, squeeze=False, sharey=sharey).ravel()
    for axes in panels[n:]:
        axes.remove()
    return list(panels[:n])


def bare(axes: Axes) -> None:
    """Take away the vertical axis, where heights have no unit worth reading."""
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)


def legend_below(figure: Figure, panels: Iterable[Axes], columns: int) -> None:
    """One legend for all panels, below them; an entry that several panels have stands once."""
    entries: dict[str, Any] = {}
    for axes in panels:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            entries.setdefault(str(label), handle)
    most = _LEGEND_WIDTH * figure.get_figwidth() / WIDTH
    columns = next((n for n in range(columns, 1, -1) if _legend_width(list(entries), n) <= most), 1)
    labels = [folded(label, _NARROW_LABEL) for label in entries]
    if is_narrow():  # the wide figure's height has room for two rows
        rows = -(-len(labels) // columns) + sum(label.count("\n") for label in labels)
        width, height = figure.get_size_inches()
        figure.set_size_inches(width, height + 0.17 * max(0, rows - 2))
    figure.legend(list(entries.values()), labels, loc="outside lower left", ncols=columns)


def _legend_width(labels: list[str], columns: int) -> int:
    """Characters in a row of a legend, its handles counted as eight."""
    size, more = divmod(len(labels), columns)
    starts = [k * size + min(k, more) for k in range(columns + 1)]
    parts = [labels[start:end] for start, end in zip(starts, starts[1:], strict=False)]
    return sum(8 + max(map(len, part)) for part in parts if part)


@styled
def write_svg(figure: Figure, file: Path) -> Path:
    """Write a figure as SVG, whole or not at all; the same figure gives the same file."""
    import matplotlib

    partial = file.with_name(f".{file.name}.partial")
    with warnings.catch_warnings(), matplotlib.rc_context({"svg.hashsalt": "skred"}):
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        figure.savefig(partial, format="svg", metadata={"Date": None, "Creator": "skred"})
    os.replace(partial, file)
    return file


@styled
def write_png(figure: Figure, file: Path) -> Path:
    """Write a figure as PNG, whole or not at all."""
    partial = file.with_name(f".{file.name}.partial")
    with warnings.catch_warnings():
        # Names may be in any script; a box for a missing glyph is no reason to fail.
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        figure.savefig(partial, format="png", dpi=DPI, metadata={"Software": "skred"})
    os.replace(partial, file)
    return file
