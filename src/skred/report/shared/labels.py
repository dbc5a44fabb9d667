"""Words for figures and tables; what comes from a file is shown, never interpreted."""

from __future__ import annotations

import re
from typing import Any

from skred import units

_GREEK = {
    "mu": "μ",
    "xi": "ξ",
    "kappa": "κ",
    "phi": "φ",
    "alpha": "α",
    "beta": "β",
    "sigma": "σ",
    "tau": "τ",
    "omega": "ω",
    "pi": "π",
}


def printable(text: Any) -> str:
    """Text without control characters, such as those that steer a terminal; ``n/a`` for None."""
    if text is None:
        return "n/a"
    return "".join(c if c.isprintable() else "�" for c in str(text))


def shortened(text: Any, length: int = 40) -> str:
    """Printable text with its middle left out where it is longer than `length`."""
    shown = printable(text)
    if len(shown) <= length:
        return shown
    head = (length - 1 + 1) // 2
    return f"{shown[:head]}…{shown[len(shown) - (length - 1 - head) :]}"


def figure_text(text: Any, length: int = 40) -> str:
    """Shortened text in which matplotlib finds no formula."""
    return shortened(text, length).replace("$", r"\$")


def unit_text(unit: Any) -> str:
    """A unit for people: ``m s-1`` as m/s, ``m s-2`` as m/s², ``m-1`` as 1/m, ``1`` as -."""
    shown = " ".join(printable(unit).split())
    return "-" if shown == "1" else units.unit_text(shown)


def with_units(text: Any) -> str:
    """A text for people: ``U_c [m s-1] of 4 or 8`` as U_c [m/s] of 4 or 8."""
    return re.sub(r"\[([^\[\]]+)\]", lambda match: f"[{unit_text(match[1])}]", printable(text))


def symbol_text(symbol: Any) -> str:
    """A symbol with its Greek letters: ``xi h`` as ξ h, ``sd(log mu)`` as sd(log μ)."""
    shown = " ".join(printable(symbol).split())
    return re.sub(r"\b[a-z]+\b", lambda match: _GREEK.get(match[0], match[0]), shown)


def name_text(name: Any) -> str:
    """A parameter's name in plain words."""
    return printable(name).replace("_", " ")


def parameter_label(parameter: Any) -> str:
    """Name, symbol, the paper's symbol and unit of a law's parameter, for an axis."""
    symbol = symbol_text(parameter.symbol)
    name = name_text(parameter.name)
    shown = symbol if name == printable(parameter.symbol) else f"{name} {symbol}"
    paper = f" (paper: {printable(parameter.paper_symbol)})" if parameter.paper_symbol else ""
    return _with_unit(shown + paper, parameter)


def symbol_label(parameter: Any) -> str:
    """Symbol and unit, where there is no room for the name."""
    return _with_unit(symbol_text(parameter.symbol), parameter)


def population_label(parameter: Any) -> str:
    """What a parameter of a population is; below it its symbol and unit."""
    role, name = population_role(parameter.name), name_text(parameter.name)
    if role == "median" and name != printable(parameter.symbol):
        role = f"median {figure_text(name, 30)}"
    return f"{role}\n{symbol_label(parameter)}"


def population_role(name: Any) -> str:
    """Whether a hierarchical calibration's parameter is a median, a spread or a correlation."""
    ending = str(name).rpartition("_")[2]
    return ending if ending in ("spread", "correlation") else "median"


def _with_unit(text: str, parameter: Any) -> str:
    return f"{figure_text(text, 60)} [{figure_text(unit_text(parameter.unit), 20)}]"
