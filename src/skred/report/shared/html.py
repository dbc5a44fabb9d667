"""Pages that need nothing else, neither network nor script: their templates, and pictures inside them."""

from __future__ import annotations

import base64
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from skred.report.shared import document as doc
from skred.report.shared.labels import name_text, population_role, printable, symbol_text, unit_text
from skred.report.shared.numbers import (
    decimals_for,
    fixed,
    is_number,
    odds,
    rounded,
    share,
    three_digits,
    whole,
)

if TYPE_CHECKING:
    from jinja2 import Environment


def picture(file: Path) -> str:
    """A picture as a data URI."""
    kind = "svg+xml" if file.suffix == ".svg" else "png"
    return f"data:image/{kind};base64," + base64.b64encode(file.read_bytes()).decode("ascii")


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
    environment.globals.update(get=doc.get, listed=doc.listed, decimals_for=decimals_for, is_number=is_number)
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
