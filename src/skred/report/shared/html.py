"""Pages that need nothing else: their templates, style and script, and the policy that allows only these."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any

from skred.report.shared import document as doc
from skred.report.shared.colours import dark
from skred.report.shared.inline import colours_in
from skred.report.shared.labels import name_text, population_role, printable, symbol_text, unit_text
from skred.report.shared.numbers import (
    counted,
    decimals_for,
    fixed,
    is_number,
    odds,
    rounded,
    share,
    three_digits,
    whole,
)
from skred.report.shared.programs import bokeh_program, digest, packed_bokeh, program

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup

    from skred.report.shared.drawing import Exploration, Picture


_MOST_DRAWN = 4_300_000
"""Characters of drawings in a page: with tables and words it stays below 5 MB."""
MOST_BYTES, _ALLOWANCE = 4_960_000, 30_000
"""Of a page with explorations, and of their colours, scripts and names in it."""
_EXPLORING = ("unpack.js", "marks.js", "explore.js")
"""Programs of pages with figures to explore."""


def page(template: str, figures: Mapping[str, Picture], **values: Any) -> str:
    """Render a page: one file with all it needs, which asks no one for anything.

    Its Content-Security-Policy forbids everything but its own style and script, known by their hashes, and
    pictures that are part of it.

    Parameters
    ----------
    template : str
        Name of a template; it begins with ``head.html.jinja`` and ends with ``tail.html.jinja``.
    figures : mapping of str to Picture
    **values
        What the template is given.

    Returns
    -------
    str
    """
    figures, too_large = _that_fit(figures)
    values |= {"too_large": too_large}
    found = {name: one.exploration for name, one in figures.items() if one.exploration is not None}
    plain = {name: replace(one, exploration=None) for name, one in figures.items()}
    html = _rendered(template, plain, values)
    if not found:
        return html
    kept = _explorable(found, MOST_BYTES - len(html.encode("utf-8")))
    explored = {name: replace(one, exploration=kept.get(name)) for name, one in figures.items()}
    return _rendered(template, explored, values, [name for name in found if name not in kept])


def _rendered(
    template: str, figures: Mapping[str, Picture], values: Mapping[str, Any], not_explored: Sequence[str] = ()
) -> str:
    """Render a template with the figures that there is room for."""
    from markupsafe import Markup

    drawings = [text for one in figures.values() for text in (one.wide, one.narrow)]
    explorations = [one.exploration for one in figures.values() if one.exploration is not None]
    colours = set[str]().union(*map(colours_in, drawings), *(one.colours for one in explorations))
    style = program("style.css") + _colours(colours)
    script = "".join(map(program, ("report.js", *(_EXPLORING if explorations else ()))))
    html = (
        environment()
        .get_template(template)
        .render(
            figures=figures,
            style=Markup(style),
            script=Markup(script),
            policy=Markup(_policy(style, script, explored=bool(explorations))),
            bokeh=Markup(packed_bokeh()) if explorations else None,
            not_explored=not_explored,
            **values,
        )
    )
    return _reachable_tables(html)


def _that_fit(figures: Mapping[str, Picture]) -> tuple[dict[str, Picture], list[str]]:
    """Figures that a page has room for, the smallest first, and the names of the others."""
    room, kept = _MOST_DRAWN, set[str]()
    for name in sorted(figures, key=lambda name: figures[name].size):
        room -= figures[name].size
        kept |= {name} if room >= 0 else set()
    return {name: one for name, one in figures.items() if name in kept}, [n for n in figures if n not in kept]


def _explorable(found: Mapping[str, Exploration], room: int) -> dict[str, Exploration]:
    """Explorations that a page has room for beside all else, smallest first."""
    room -= len(packed_bokeh()) + _ALLOWANCE
    kept = {}
    for name in sorted(found, key=lambda name: found[name].size):
        room -= found[name].size
        if room >= 0:
            kept[name] = found[name]
    return kept


def _policy(style: str, script: str, *, explored: bool) -> str:
    """What the page may do: show what is in it, and nothing else."""
    scripts = [digest(script), *([digest(bokeh_program())] if explored else ())]
    # Bokeh writes style elements as it draws, which no digest can know beforehand; a digest beside
    # 'unsafe-inline' would switch it off. Styles load nothing: whatever they name is not allowed either.
    styles = "'unsafe-inline'" if explored else digest(style)
    return (
        f"default-src 'none'; style-src {styles}; script-src {' '.join(scripts)};"
        " img-src data:; connect-src 'none'; base-uri 'none'; form-action 'none'"
    )


def _colours(colours: set[str]) -> str:
    """Colours of the drawings, and their counterparts in the dark."""
    ordered = sorted(colours)
    light = "".join(f"--c{colour[1:]}:{colour};" for colour in ordered)
    night = "".join(f"--c{colour[1:]}:{dark(colour)};" for colour in ordered)
    return f":root{{{light}}}\n@media screen and (prefers-color-scheme: dark){{:root{{{night}}}}}\n"


def _reachable_tables(html: str) -> str:
    """Give tables that may be wider than the screen a name and a place in the keyboard's order."""
    number = 0

    def named(found: re.Match[str]) -> str:
        nonlocal number
        number += 1
        if found["caption"]:
            name, caption = f'aria-labelledby="table-{number}"', f'<caption id="table-{number}"><span>'
        else:
            name, caption = f'aria-label="Table {number}"', ""
        return f'<div class="wide" role="region" tabindex="0" {name}>{found["table"]}{caption}'

    pattern = r'<div class="wide">(?P<table><table[^>]*>\s*)(?P<caption><caption>)?'
    html = re.sub(pattern, named, html).replace("</caption>", "</span></caption>")
    html = re.sub(
        r"<thead>.*?</thead>",
        lambda head: re.sub(r"<th(?=[ >])", '<th scope="col"', head[0]),
        html,
        flags=re.DOTALL,
    )
    return re.sub(r"<th(?=[ >])(?! scope=)", '<th scope="row"', html)


def drawn(figures: Mapping[str, Picture], key: str, words: str) -> Markup:
    """A figure as a page has it; nothing where there is none."""
    from markupsafe import Markup

    return figures[key].markup(words) if key in figures else Markup("")


@cache
def environment() -> Environment:
    """Templates of this package, with every value escaped unless a template says otherwise."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("skred.report", "templates"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
    )
    environment.filters.update(
        fixed=fixed,
        whole=whole,
        counted=counted,
        share=share,
        odds=odds,
        rounded=rounded,
        shown=shown,
        unit=lambda unit: _kept_together(unit_text(unit)),
        symbol=lambda symbol: _kept_together(symbol_text(symbol)),
        name=name_text,
        role=population_role,
        two_digits=two_digits,
        three_digits=three_digits,
    )
    environment.globals.update(
        get=doc.get, listed=doc.listed, decimals_for=decimals_for, is_number=is_number, drawn=drawn
    )
    return environment


def shown(value: Any) -> str:
    """Any plain value as text; ``n/a`` where it is null."""
    if value is None:
        return "n/a"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return printable(value)


def two_digits(value: Any) -> str:
    """A number with two significant digits, as a p-value has them."""
    return f"{value:.2g}" if is_number(value) else fixed(None)


def _kept_together(text: str) -> str:
    """A unit or symbol without line breaks, but after a comma."""
    return text.replace(" ", "\N{NO-BREAK SPACE}").replace(",\N{NO-BREAK SPACE}", ", ")
