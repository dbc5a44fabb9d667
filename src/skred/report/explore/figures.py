"""Bokeh figures: how all of them look, and marks that belong to an event.

A source with a column `event` is what a page highlights: `marks.js` selects in every such source the rows of
the event that was chosen. The same in reports and in the dashboard.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from bokeh.core.properties import value
from bokeh.models import (
    BasicTicker,
    BasicTickFormatter,
    BoxZoomTool,
    ColumnDataSource,
    GlyphRenderer,
    HoverTool,
    PanTool,
    ResetTool,
    SaveTool,
    TapTool,
    Text,
    Title,
    WheelZoomTool,
)
from bokeh.plotting import figure
from numpy.typing import ArrayLike

from skred.report.shared.style import GREY, INK, PALE, PALETTE

CHOSEN = "#D55E00"
"""The event that is followed through all views."""
BLUE = PALETTE[0]
EVENT = "event"
DRAWS_FILTER = "skred-draws"
"""Name of the filters that show draws of the chosen event only."""
_FONT = "system-ui, 'Segoe UI', 'Helvetica Neue', Arial, sans-serif"
_CYCLE = ("#3f90da", "#ffa90e", "#bd1f01", "#94a4a2", "#832db6", "#a96b59", "#e76300")
"""Colours of ArviZ's default style, in their order."""
_OURS = dict(zip(_CYCLE, PALETTE, strict=True))
_MOST_POINTS = 2000
_LEGEND_WIDTH = 46
"""Characters of a legend in a row on a narrow screen."""


def new_figure(x_label: str, y_label: str, *, height: int = 280, **more: Any) -> Any:
    """An empty figure as wide as its place in the page."""
    made = figure(
        x_axis_label=x_label,
        y_axis_label=y_label,
        height=height,
        tools=[],
        output_backend="canvas",
        **more,
    )
    return styled(made, height=height)


def styled(made: Any, *, height: int | None = None, title: str | None = None) -> Any:
    """Bring a figure, our own or one of arviz-plots, into the style of all.

    Parameters
    ----------
    made : bokeh figure
    height : int, optional
        In pixels.
    title : str, optional
        Instead of the one it has; empty for none.
    """
    made.sizing_mode = "stretch_width"
    made.min_width, made.width_policy = 240, "fit"
    if height is not None:
        made.height = height
    made.tools = [
        PanTool(dimensions="both"),
        BoxZoomTool(),
        WheelZoomTool(),
        ResetTool(),
        SaveTool(),
        *(tool for tool in made.tools if isinstance(tool, (HoverTool, TapTool))),
    ]
    made.toolbar.logo, made.toolbar.autohide = None, True
    made.toolbar.active_drag = made.toolbar.active_scroll = None
    made.background_fill_color = made.border_fill_color = None
    made.outline_line_color = None
    _text(made, title)
    made.renderers = [one for one in made.renderers if not _is_empty(one)]
    for renderer in made.renderers:
        if isinstance(renderer, GlyphRenderer):
            slim(renderer.data_source)
            _in_our_colours(renderer.glyph)
    return made


def _in_our_colours(glyph: Any) -> None:
    """Colours and letters of ours instead of ArviZ's, some of which are too pale on white and in the dark."""
    for name in ("line_color", "fill_color"):
        colour = getattr(glyph, name, None)
        if isinstance(colour, str) and colour.lower() in _OURS:
            setattr(glyph, name, _OURS[colour.lower()])
    if isinstance(glyph, Text):
        glyph.text_font, glyph.text_font_size, glyph.text_color = value(_FONT), "12px", INK


def _is_empty(renderer: Any) -> bool:
    """Whether a renderer has nothing to draw; bokeh would complain of missing columns."""
    return isinstance(renderer, GlyphRenderer) and not any(len(v) for v in renderer.data_source.data.values())


def _text(made: Any, title: str | None) -> None:
    """Axes, grid and title."""
    for axis in made.axis:
        axis.axis_label_text_font = axis.major_label_text_font = _FONT
        axis.axis_label_text_font_style, axis.axis_label_text_font_size = "normal", "13px"
        axis.major_label_text_font_size = "12px"
        axis.axis_label_text_color = axis.major_label_text_color = INK
        axis.axis_line_color = axis.major_tick_line_color = GREY
        axis.minor_tick_line_color = None
        if isinstance(axis.formatter, BasicTickFormatter):
            axis.formatter = BasicTickFormatter(power_limit_low=-5)
        if isinstance(axis.ticker, BasicTicker):
            axis.ticker.desired_num_ticks = 5
        if isinstance(axis.axis_label, str):
            axis.axis_label = plain(axis.axis_label)
    for axis in made.xaxis:
        if isinstance(axis.ticker, BasicTicker):
            axis.ticker.desired_num_ticks = 4  # numbers beside each other need more room
    for grid in made.grid:
        grid.grid_line_color = PALE
    if title is not None:
        made.title = Title(text=plain(title))
    if made.title is not None:
        made.title.text = plain(str(made.title.text or ""))
        made.title.text_font, made.title.text_font_size = _FONT, "13px"
        made.title.text_color, made.title.align = INK, "left"
        made.title.visible = bool(made.title.text)


def plain(text: str) -> str:
    """Text in which bokeh finds no formula: it would ask for another program to draw it."""
    return text.replace("$$", "$ $").replace("\\(", "(").replace("\\[", "[")


def slim(source: Any) -> None:
    """Numbers of a source as arrays of half the size, which go into the page as they are."""
    for name, values in source.data.items():
        array = values if isinstance(values, np.ndarray) else np.array(list(values), dtype=object)
        if array.ndim == 1 and array.size and all(isinstance(v, (float, int, np.number)) for v in array):
            source.data[name] = np.asarray(array, dtype=np.float32)


def thin(source: Any, most: int) -> None:
    """Keep evenly chosen points of a curve, at most so many."""
    kept = spread_out(next(iter(source.data.values()), ()), most)
    if len(kept) == most:
        source.data = {name: np.asarray(values)[kept] for name, values in source.data.items()}


def figures_of(collection: Any) -> dict[str, Any]:
    """Figures of a plot of arviz-plots, by the name of the variable in each."""
    found = {str(name): values.item() for name, values in collection.viz["plot"].data_vars.items()}
    for made in found.values():
        apart(made)
    return found


def apart(made: Any) -> None:
    """Give a figure ranges of its own: those of a grid share them, and here each is embedded by itself."""
    made.x_range, made.y_range = made.x_range.clone(), made.y_range.clone()


@contextmanager
def quietly() -> Iterator[None]:
    """Without warnings of large Pareto k and of sizes of figures: views show the ones and set the others."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def points(
    made: Any,
    data: Mapping[str, Any],
    events: Sequence[str],
    *,
    x: str = "x",
    y: str = "y",
    size: float = 7,
    colour: str = BLUE,
    marker: str = "circle",
    legend: str | None = None,
    tips: Sequence[tuple[str, str]] = (),
) -> GlyphRenderer:
    """Points of events that can be tapped.

    Parameters
    ----------
    made : bokeh figure
    data : mapping of arrays
        Columns; numbers, or texts that the tips show.
    events : sequence of str
        The event of each point.
    x, y : str
        Columns.
    size : float
        In pixels.
    colour, marker : str
    legend : str, optional
    tips : sequence of (label, format)
        What is told beside the event where one points at it.
    """
    source = ColumnDataSource({**{k: _column(v) for k, v in data.items()}, EVENT: list(events)})
    more = {"legend_label": plain(legend)} if legend else {}
    renderer = made.scatter(
        x, y, source=source, size=size, marker=marker, color=colour, alpha=0.75, line_width=1.2, **more
    )
    return chosen_stands_out(made, renderer, tips)


def chosen_stands_out(
    made: Any, renderer: GlyphRenderer, tips: Sequence[tuple[str, str]] = (), *, line: bool = False
) -> GlyphRenderer:
    """Give a renderer of events its looks where one is chosen, a tap, and what is told of each."""
    glyph = renderer.glyph.clone()
    if line:
        glyph.line_color, glyph.line_alpha, glyph.line_width = CHOSEN, 1.0, 3.0
        muted = renderer.glyph.clone()
        muted.line_alpha = 0.18
    else:
        glyph.fill_color = glyph.line_color = CHOSEN
        glyph.fill_alpha = glyph.line_alpha = 1.0
        glyph.size = 12
        muted = renderer.glyph.clone()
        muted.fill_alpha, muted.line_alpha = 0.25, 0.25
    renderer.selection_glyph, renderer.nonselection_glyph = glyph, muted
    _tool(made, TapTool, renderer)
    rows = [("event", f"@{EVENT}"), *tips]
    made.add_tools(HoverTool(renderers=[renderer], tooltips=rows, line_policy="interp", visible=False))
    return renderer


def _tool(made: Any, kind: type[Any], renderer: GlyphRenderer) -> None:
    """One tool of a kind for all renderers that take it."""
    found = [tool for tool in made.tools if isinstance(tool, kind)]
    if not found:
        made.add_tools(kind(renderers=[renderer], visible=False))
        return
    found[0].renderers = [*found[0].renderers, renderer]


def of_events(renderer: GlyphRenderer, events: Sequence[str], made: Any, **more: Any) -> GlyphRenderer:
    """Make marks of a plot of arviz-plots those of events, in their order."""
    renderer.data_source.data[EVENT] = list(events)
    return chosen_stands_out(made, renderer, **more)


def spread_out(values: ArrayLike, most: int = _MOST_POINTS) -> Any:
    """Evenly chosen numbers of places of an array along its first axis, at most `most`."""
    n = len(np.asarray(values))
    return np.unique(np.linspace(0, n - 1, min(n, most)).astype(int))


def legend_above(made: Any) -> None:
    """Put the legend in a row over the figure."""
    for legend in made.legend:
        legend.orientation, legend.border_line_color = "horizontal", None
        legend.background_fill_alpha, legend.padding, legend.margin = 0.0, 0, 2
        legend.label_text_font, legend.label_text_font_size = _FONT, "12px"
        legend.label_text_color = INK
        legend.click_policy = "hide"
        labels = [str(getattr(item.label, "value", "")) for item in legend.items]
        if sum(len(label) + 5 for label in labels) > _LEGEND_WIDTH:
            legend.orientation = "vertical"
        legend.glyph_width = 16
        made.add_layout(legend, "above")


def _column(values: ArrayLike) -> Any:
    array = np.asarray(values)
    return array.astype(np.float32) if array.dtype.kind in "iuf" else [str(one) for one in array]
