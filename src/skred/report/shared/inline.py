"""A figure as markup inside a page: lines and letters as they are, colours that follow light and dark.

The drawing is matplotlib's SVG with text as text. What a strict Content-Security-Policy forbids is taken out
of it (styles become attributes), colours become variables of the page's style, and what `mark` has said of
places is laid over it as transparent targets with a title each: a browser shows these without a script.
"""

from __future__ import annotations

import io
import math
import re
import warnings
from typing import TYPE_CHECKING
from xml.etree import ElementTree

from skred.report.shared.labels import printable
from skred.report.shared.marks import MOST_MARKS, notes_of
from skred.report.shared.style import fold, is_narrow, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Text

_SVG, _LINK = "http://www.w3.org/2000/svg", "{http://www.w3.org/1999/xlink}href"
_TARGET = 7.0
"""Radius of a target, in points: as large as a finger's tip needs on a telephone, nearly."""
_DROPPED = frozenset({"font-family", "stroke-linejoin", "stroke-linecap", "font-stretch", "font-variant"})
_MOST_FOLDS = 3
_PLACES, _CLOSEST, _LONG = 1, 0.6, 80
"""Of paths: decimals of a point, and which points of which are left out: closer ones of longer ones."""
_RASTER = 110
"""Dots per inch of what has too many points to be drawn as lines."""
_TICK_WIDTH = 0.55
"""Inches that a tick's label takes."""


@styled
def inline_svg(figure: Figure, key: str) -> str:
    """A figure as an ``svg`` element, with an empty ``aria-label``: the page says what it shows.

    Parameters
    ----------
    figure : Figure
        As it was laid out for a file; one for a narrow screen is laid out here.
    key : str
        Letters and digits that no other figure of the page has: ids begin with it.
    """
    with warnings.catch_warnings():
        # Names may be in any script; a box for a missing glyph is no reason to fail.
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        _finish(figure)
        figure.set_layout_engine("none")  # it is laid out, which takes as long as to draw it
        root = _drawn(figure)
    _without_what_a_page_has(root)
    for element in root.iter():
        _plain_attributes(element)
    _own_ids(root, key)
    marks = _targets(figure)
    if marks is not None:
        root.append(marks)
    width, height = (72.0 * float(size) for size in figure.get_size_inches())
    root.attrib.clear()
    root.attrib |= {
        "viewBox": f"0 0 {width:.2f} {height:.2f}",
        "role": "img",
        "aria-label": "",
    }
    for element in root.iter():  # a page knows what svg is
        element.tag = element.tag.rpartition("}")[2]
    return ElementTree.tostring(root, encoding="unicode")


def colours_in(markup: str) -> set[str]:
    """Colours that drawings of a page refer to, as ``#rrggbb``."""
    return {f"#{found}" for found in re.findall(r"var\(--c([0-9a-f]{6})\)", markup)}


def _finish(figure: Figure) -> None:
    """Labels that stacked panels share; in a narrow figure what is too long for its panel is folded."""
    if not is_narrow():
        return
    for axes in figure.axes:
        _fewer_ticks(axes)
    for panels in notes_of(figure).stacked:
        for axes in panels[1:]:
            if not axes.get_ylabel() and panels[0].get_shared_y_axes().joined(axes, panels[0]):
                axes.set_ylabel(panels[0].get_ylabel())
    for _ in range(_MOST_FOLDS):  # what is folded takes room from the panels
        figure.draw_without_rendering()
        if not sum(_fold_labels(axes) for axes in figure.axes):
            return


def _fewer_ticks(axes: Axes) -> None:
    """No more ticks along a short axis than their labels have room for."""
    from matplotlib.ticker import AutoLocator, MaxNLocator

    figure = axes.get_figure(root=True)
    assert figure is not None
    width = axes.get_position().width * float(figure.get_size_inches()[0])
    locator = axes.xaxis.get_major_locator()
    if isinstance(locator, (AutoLocator, MaxNLocator)):
        locator.set_params(nbins=max(2, min(6, int(width / _TICK_WIDTH))))


def _fold_labels(axes: Axes) -> int:
    """Fold titles and labels that are longer than their panel; how many were."""
    from matplotlib.text import Text

    figure = axes.get_figure(root=True)
    assert figure is not None
    whole, panel = figure.bbox, axes.get_window_extent()
    beside = 0.97 * (whole.x1 - panel.x0)
    titles = [part for part in axes.get_children() if isinstance(part, Text) and part not in axes.texts]
    rooms = [(title, beside, 0) for title in titles]
    rooms += [(axes.xaxis.label, beside, 0), (axes.yaxis.label, 1.35 * panel.height, 1)]
    return sum(_fold(text, room, side) for text, room, side in rooms)


def _fold(text: Text, room: float, side: int) -> bool:
    words = text.get_text()
    if not words.strip() or room <= 0.0:
        return False
    box = text.get_window_extent()
    length = box.height if side else box.width
    longest = max(map(len, words.split("\n")))
    folded = fold(words, int(longest * room / length)) if length > room else words
    if folded == words or "$" in words:
        return False
    text.set_text(folded)
    return True


def _drawn(figure: Figure) -> ElementTree.Element:
    """Matplotlib's drawing; the same figure gives the same one."""
    import matplotlib

    into = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": "skred", "svg.fonttype": "none"}):
        figure.savefig(into, format="svg", dpi=_RASTER, metadata={"Date": None, "Creator": None})
    return ElementTree.fromstring(into.getvalue())


def _without_what_a_page_has(root: ElementTree.Element) -> None:
    """Take away metadata, styles and the paper: the page has its own."""
    parents = {child: parent for parent in root.iter() for child in parent}
    for element in list(root.iter()):
        name = element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""
        if name in ("metadata", "style"):
            parents[element].remove(element)
    paper = root.find(f"{{{_SVG}}}g/{{{_SVG}}}g[@id='patch_1']")
    if paper is not None:
        parents[paper].remove(paper)
    for element in root.iter():
        if (
            element.tag != f"{{{_SVG}}}text"
            and element.tag != f"{{{_SVG}}}tspan"
            and not (element.text or "").strip()
        ):
            element.text = None
        element.tail = None


def _plain_attributes(element: ElementTree.Element) -> None:
    """Styles as attributes, colours as variables, numbers with two decimals."""
    for part in element.attrib.pop("style", "").split(";"):
        name, colon, value = part.partition(":")
        if colon and name.strip() not in _DROPPED:
            element.set(name.strip(), value.strip())
    for name in ("fill", "stroke"):
        colour = element.get(name, "")
        if re.fullmatch(r"#[0-9a-fA-F]{6}", colour):
            element.set(name, f"var(--c{colour[1:].lower()})")
    if "d" in element.attrib:
        element.set("d", _short_path(element.attrib["d"]))
    for name in (
        "transform",
        "x",
        "y",
        "stroke-width",
        "font-size",
        "width",
        "height",
        "stroke-dasharray",
    ):
        if name in element.attrib:
            element.set(name, _short(element.attrib[name]))
    if element.get("transform", "").startswith(("rotate(-0 ", "rotate(0 ")):
        del element.attrib["transform"]
    if _LINK in element.attrib:
        element.set("href", element.attrib.pop(_LINK))


def _short(text: str) -> str:
    return " ".join(re.sub(r"-?\d+\.\d+(?:e-?\d+)?", lambda found: f"{float(found[0]):.2f}", text).split())


def _short_path(text: str) -> str:
    """A path with numbers of a tenth of a point; of long lines no points closer than that can be seen."""
    points = re.findall(r"([MLCQzZ])([^MLCQzZ]*)", text)
    thinned: list[tuple[str, str, str]] = []
    last: tuple[float, ...] = (math.inf, math.inf)
    for number, (command, numbers) in enumerate(points):
        at = tuple(float(one) for one in numbers.split())
        next_is_line = number + 1 < len(points) and points[number + 1][0] == "L"
        close = len(at) == 2 and math.dist(at, last) < _CLOSEST
        if command == "L" and next_is_line and close and len(points) > _LONG:
            continue
        last = at if len(at) == 2 else (math.inf, math.inf)
        same = command == "L" and thinned and thinned[-1][0] in "LM"
        thinned.append((command, " " if same else command, " ".join(f"{one:.{_PLACES}f}" for one in at)))
    return "".join(shown + numbers for _, shown, numbers in thinned)


def _own_ids(root: ElementTree.Element, key: str) -> None:
    """Keep the ids that something refers to, made the figure's own; drop all others."""
    text = ElementTree.tostring(root, encoding="unicode")
    wanted = set(re.findall(r'(?:href="#|url\(#)([^")]+)', text))
    names = {name: f"{key}{number}" for number, name in enumerate(sorted(wanted))}
    for element in root.iter():
        found = element.attrib.pop("id", None)
        if found in names:
            element.set("id", names[found])
        for name, value in list(element.attrib.items()):
            if name == "href" and value.startswith("#"):
                element.set(name, f"#{names[value[1:]]}")
            elif value.startswith("url(#"):
                element.set(name, f"url(#{names[value[5:-1]]})")


def _targets(figure: Figure) -> ElementTree.Element | None:
    """Transparent circles where there is something to be told, each with its title."""
    marks = notes_of(figure).marks
    if not marks or len(marks) > MOST_MARKS:
        return None
    group = ElementTree.Element(f"{{{_SVG}}}g", {"class": "marks"})
    scale, height = 72.0 / figure.dpi, 72.0 * float(figure.get_size_inches()[1])
    for one in marks:
        x, y = one.axes.transData.transform((one.x, one.y))
        box = one.axes.bbox
        if not (box.x0 - 2 <= x <= box.x1 + 2 and box.y0 - 2 <= y <= box.y1 + 2):
            continue
        target = ElementTree.SubElement(group, f"{{{_SVG}}}g", {"class": "mark"})
        if one.event is not None:
            target.set("data-event", printable(one.event))
        ElementTree.SubElement(target, f"{{{_SVG}}}title").text = "\n".join(
            map(printable, one.words.split("\n"))
        )
        place = {"cx": f"{scale * x:.1f}", "cy": f"{height - scale * y:.1f}", "r": f"{_TARGET:g}"}
        ElementTree.SubElement(target, f"{{{_SVG}}}circle", place)
    return group if len(group) else None
