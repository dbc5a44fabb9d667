"""The text of one cell turned into a number or a word, or refused with advice.

Nothing is guessed: a column's meaning comes from the format, never from what its cells happen to look like.
"""

import math
import re

# Larger than any SI quantity of an avalanche, and small enough that its square is still an ordinary number.
LARGEST_NUMBER = 1e12
LONGEST_WORD = 200
NO_DATA = frozenset({-999.0, -9999.0, -99999.0, -999999.0, -32767.0, -32768.0, -3.4028234663852886e38})
"""Numbers by which terrain models and loggers say that they have none."""
STATUSES = ("observed", "not_reached", "missing", "at_least", "at_most", "between")
"""What can be known of a reading, in the order of `skred.campaign.records.Status`."""

_NUMBER = re.compile(r"[+-]?(\d+(?:\.\d*)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+", re.ASCII)
_THOUSANDS = re.compile(r"[+-]?\d{1,3}([,' _\u00a0\u202f]\d{3})+(\.\d+)?", re.ASCII)
_BOUND = re.compile(r"[<>≤≥]|(at|min|max|up to)\b", re.IGNORECASE)
_UNIT = re.compile(
    r".*[^_]_(?:1|percent|permille|degC|deg|rad|Hz|K|"
    r"(?:m|km|cm|mm|s|min|h|d|kg|N|kN|Pa|hPa|kPa|MPa|J|kJ|W)[1-4]?)"
)


class CellError(ValueError):
    """A cell that cannot be read; the message says what was expected and what to do."""


def number(text: str) -> float:
    """Read a finite number with a decimal point.

    Raises
    ------
    CellError
        For anything else, including ``nan``, ``inf``, thousands separators, decimal commas and the numbers
        that stand for no value.
    """
    value = coordinate(text)
    if value in NO_DATA:
        raise CellError(
            f"{value:g} is how other programs write that there is no value; leave the cell empty if its "
            "column allows that, else leave out the row"
        )
    return value


def coordinate(text: str) -> float:
    """Read a finite number that may be any: along a coordinate every number is a place."""
    if text == "":
        raise CellError("expected a number, the cell is empty; fill it in")
    if not _NUMBER.fullmatch(text):
        raise CellError(f"expected a number; {_number_advice(text)}")
    value = float(text)
    if abs(value) > LARGEST_NUMBER:
        raise CellError(f"expected a number of at most {LARGEST_NUMBER:g}; correct it")
    if value == 0 and re.search("[1-9]", re.split("[eE]", text)[0]):
        raise CellError("the number is too small to be told from 0; write 0 or correct it")
    return value


def _number_advice(text: str) -> str:
    """Say what to do about a cell that is not a number."""
    if text.lower().lstrip("+-") in ("nan", "inf", "infinity", "na", "n/a", "null", "none"):
        return "values must be finite; where there is none, leave the cell empty if its column allows that"
    if _THOUSANDS.fullmatch(text) or "_" in text:
        return "write it without thousands separators"
    if _DECIMAL_COMMA.fullmatch(text):
        return "write a decimal point, not a comma"
    return "write digits with a decimal point and no unit, such as 12.5"


def positive(text: str) -> float:
    """Read a number greater than 0."""
    value = number(text)
    if value <= 0:
        raise CellError("expected a number greater than 0; correct it")
    return value


def not_negative(text: str) -> float:
    """Read a number that is 0 or greater."""
    value = number(text)
    if value < 0:
        raise CellError("expected 0 or a greater number; correct it, or write 0 if there is no such part")
    return value


def optional_number(text: str) -> float | None:
    """Read a number, or nothing from an empty cell."""
    return None if text == "" else number(text)


def reading(text: str) -> float | None:
    """Read the value of a reading; a bound that stands in it has a column of its own."""
    try:
        return optional_number(text)
    except CellError as error:
        if not _BOUND.match(text):
            raise
        raise CellError(
            f"{error}; a bound is the number alone, with the status at_least or at_most"
        ) from None


def optional_positive(text: str) -> float | None:
    """Read a number greater than 0, or nothing from an empty cell."""
    return None if text == "" else positive(text)


def optional_not_negative(text: str) -> float | None:
    """Read a number that is 0 or greater, or nothing from an empty cell."""
    return None if text == "" else not_negative(text)


def optional_word(text: str) -> str | None:
    """Read a short text, or nothing from an empty cell."""
    return None if text == "" else word(text)


def word(text: str) -> str:
    """Read a short printable text, such as an id."""
    if text == "":
        raise CellError("the cell is empty; fill it in")
    if not text.isprintable():
        raise CellError("expected printable text in one line; remove the control characters")
    if len(text) > LONGEST_WORD:
        raise CellError(f"expected at most {LONGEST_WORD} characters, found {len(text)}; shorten it")
    return text


def quantity(text: str) -> str:
    """Read what a sensor records."""
    if text not in ("front_velocity", "runout"):
        raise CellError("expected 'front_velocity' or 'runout'; correct it")
    return text


def status(text: str) -> str:
    """Read what is known of a reading."""
    if text not in STATUSES:
        named = ", ".join(f"'{word}'" for word in STATUSES[:-1])
        raise CellError(f"expected {named} or '{STATUSES[-1]}'; correct it")
    return text


def has_unit(name: str) -> bool:
    """Tell whether a covariate's name ends in a unit, as in ``release_volume_m3`` or ``snow_density_kg_m3``.

    ``_1`` marks a pure number, as in ``danger_level_1``.
    """
    return _UNIT.fullmatch(name) is not None


def covariate_number(text: str) -> float | None:
    """Read a cell of a covariate whose name ends in a unit."""
    try:
        return optional_number(text)
    except CellError as error:
        raise CellError(f"the column's name ends in a unit: {error}; or rename a column of text") from None


def covariate_word(text: str) -> str | None:
    """Read a cell of a covariate whose name has no unit.

    A bare number is refused: with a unit it would be a number, and without one nobody can tell.
    """
    if _NUMBER.fullmatch(text) or math.isfinite(_float_or_nan(text)):
        raise CellError(
            "a number in a column without a unit; end the column's name in one (_m, _m3, _kg_m3, _degC, "
            "_percent; _1 for a pure number), or write a label as a word (class2)"
        )
    return optional_word(text)


def _float_or_nan(text: str) -> float:
    """Return what Python takes for a number (such as ``1_000``), NaN for everything else."""
    try:
        return float(text)
    except ValueError:
        return math.nan
