"""What every page of skred must be: one file, a strict policy, complete without scripts, read by anyone."""

from __future__ import annotations

import base64
import hashlib
import json
import re
import zlib
from html.parser import HTMLParser
from typing import Any

MOST_BYTES = 5_000_000
VOID = {"meta", "br", "img", "input", "hr"}
EXPERT = ("nats", "pareto", "elpd", "bayes factor", "posterior", "r-hat", "crps")
"""Words that the first paragraph does without."""


class Element:
    """An element of a page."""

    def __init__(self, tag: str, attributes: dict[str, str], parent: Element | None) -> None:
        self.tag, self.attributes, self.parent = tag, attributes, parent
        self.children: list[Element] = []
        self.words: list[str] = []

    def all(self, *tags: str) -> list[Element]:
        """Elements below this one with one of the tags, in order; all of them without tags."""
        found = []
        for child in self.children:
            found += [child] if not tags or child.tag in tags else []
            found += child.all(*tags)
        return found

    @property
    def text(self) -> str:
        """Text of it and of all below, in no particular order."""
        own = [*self.words, *(child.text for child in self.children if child.tag not in ("script", "style"))]
        return " ".join(" ".join(own).split())

    def has(self, name: str) -> bool:
        """Whether it has a class."""
        return name in self.attributes.get("class", "").split()


class Tree(HTMLParser):
    """Reads a page; fails on elements that do not close."""

    def __init__(self, html: str) -> None:
        super().__init__(convert_charrefs=True)
        self.root = self.at = Element("", {}, None)
        self.feed(html)
        assert self.at is self.root, f"<{self.at.tag}> is not closed"

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        child = Element(tag, {name: value or "" for name, value in attrs}, self.at)
        self.at.children.append(child)
        if tag not in VOID:
            self.at = child

    def handle_endtag(self, tag: str) -> None:
        if tag in VOID:
            return
        assert self.at.tag == tag, f"</{tag}> closes <{self.at.tag}>"
        assert self.at.parent is not None
        self.at = self.at.parent

    def handle_data(self, data: str) -> None:
        self.at.words.append(data)


def check_page(html: str) -> Element:
    """Assert everything that can be seen in the file itself; returns the page."""
    assert len(html.encode()) < MOST_BYTES
    page = Tree(html).root
    _check_policy(page)
    _check_references(page)
    _check_headings(page)
    _check_figures(page)
    _check_tables(page)
    _check_first_paragraph(page)
    return page


def _check_policy(page: Element) -> None:
    """Nothing but the page's own style and script, known by their hashes."""
    first = next(one for one in page.all("meta") if one.attributes.get("http-equiv"))
    assert first.attributes["http-equiv"] == "Content-Security-Policy"
    parts = dict(part.split(" ", 1) for part in re.split(r";\s*", first.attributes["content"]))
    assert parts["default-src"] == parts["connect-src"] == "'none'" and "unsafe" not in parts["script-src"]
    assert parts["img-src"] == "data:" and parts["base-uri"] == parts["form-action"] == "'none'"
    data = [one for one in page.all("script") if one.attributes]
    (style,), (script,) = page.all("style"), [one for one in page.all("script") if one not in data]
    assert not style.attributes, "from nowhere else"
    programs, styles = [_digest("".join(script.words))], _digest("".join(style.words))
    if data:  # figures to explore: bokeh is packed, and writes styles as it draws
        (bokeh,) = [one for one in data if one.attributes.get("id") == "bokeh"]
        programs.append(_digest(_unpacked(bokeh)))
        styles = "'unsafe-inline'"
    assert parts["script-src"].split() == programs and parts["style-src"] == styles
    for element in data:
        assert element.attributes["type"] == "text/plain" and len(element.attributes) == 2
        assert element.attributes.get("id") == "bokeh" or element.attributes["class"] == "exploration-data"
        assert re.fullmatch(r"[A-Za-z0-9+/=]+", "".join(element.words)), "data, which nothing runs"
    for element in page.all():
        assert not {name for name in element.attributes if name == "style" or name.startswith("on")}


def _digest(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def _unpacked(element: Element) -> str:
    return zlib.decompress(base64.b64decode("".join(element.words))).decode()


def explorations(page: Element) -> list[list[dict[str, Any]]]:
    """What can be explored in place of each figure that has it."""
    blocks = [one for one in page.all("script") if one.has("exploration-data")]
    assert all(one.parent is not None and one.parent.tag == "figure" for one in blocks)
    return [json.loads(_unpacked(one)) for one in blocks]


def _check_references(page: Element) -> None:
    """Everything that is referred to is in the page; ids are unique."""
    ids = [one.attributes["id"] for one in page.all() if "id" in one.attributes]
    assert len(ids) == len(set(ids))
    for element in page.all():
        assert element.tag not in ("link", "iframe", "object", "embed", "base", "form")
        for name, value in element.attributes.items():
            local = re.fullmatch(r"url\(#([^)]+)\)", value) or re.fullmatch(r"#(.+)", value)
            if name in ("href", "src", "srcset", "xlink:href", "clip-path"):
                assert (local and local[1] in ids) or value.startswith("data:image/png;base64,")
            elif name in ("aria-labelledby", "aria-describedby", "for"):
                assert set(value.split()) <= set(ids)
            assert name == "content" or not re.match(r"\s*(https?:)?//", value)
    style = "".join(page.all("style")[0].words)
    assert "url(" not in style and "@import" not in style


def _check_headings(page: Element) -> None:
    levels = [int(one.tag[1]) for one in page.all("h1", "h2", "h3", "h4")]
    assert levels[0] == 1 and levels.count(1) == 1
    assert all(below <= above + 1 for above, below in zip(levels, levels[1:], strict=False))
    assert page.all("html")[0].attributes["lang"] == "en" and page.all("title")[0].text
    assert len(page.all("main")) == 1


def _check_figures(page: Element) -> None:
    """Each has a caption, a wide and a narrow drawing, and words for those who cannot see it."""
    for figure in page.all("figure"):
        drawings = figure.all("svg")
        assert [one.parent.attributes["class"] for one in drawings if one.parent] == [
            "wide-figure",
            "narrow-figure",
        ]
        assert len(figure.all("figcaption")) == 1 and figure.all("figcaption")[0].text
        for drawing in drawings:
            assert drawing.attributes["role"] == "img" and len(drawing.attributes["aria-label"]) > 10
            for mark in (one for one in drawing.all("g") if one.has("mark")):
                assert len(mark.all("title")) == len(mark.all("circle")) == 1 and mark.all("title")[0].text
                assert "\ufffd" not in mark.all("title")[0].text, "lines stay lines"
    assert not page.all("img"), "pictures are drawings with words"


def _check_tables(page: Element) -> None:
    for table in page.all("table"):
        region = table.parent
        assert region is not None and region.has("wide") and region.attributes["tabindex"] == "0"
        assert region.attributes["role"] == "region"
        assert region.attributes.get("aria-label") or region.attributes.get("aria-labelledby")
        for head in table.all("thead"):
            assert all(one.attributes["scope"] == "col" for one in head.all("th"))
        for body in table.all("tbody"):
            assert all(one.attributes["scope"] == "row" for one in body.all("th"))
        if table.has("sortable"):
            (head,) = table.all("thead")
            assert len(head.all("tr")) == 1 and all(one.text for one in head.all("th"))
            widths = {len(row.children) for row in table.all("tr")}
            assert len(widths) == 1 and not any(
                "colspan" in cell.attributes for cell in table.all("td", "th")
            )


def _check_first_paragraph(page: Element) -> None:
    (lay,) = [one for one in page.all("p", "div") if one.has("lay")]
    before = page.all("p", "div", "figure", "table")
    assert not any(one.tag in ("figure", "table") for one in before[: before.index(lay)])
    assert len(lay.text) > 60
    assert not [word for word in EXPERT if word in lay.text.lower()]


def without_scripts(html: str) -> str:
    """All that can be read where no script runs."""
    return Tree(html).root.all("body")[0].text


def texts(html: str, *tags: str) -> list[str]:
    """Texts of all elements with one of the tags, sorted."""
    return sorted(one.text for one in Tree(html).root.all(*tags))
