"""The file ``campaign.toml``: what the campaign is and where it comes from."""

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import PydanticCustomError

from skred.campaign.cells import LARGEST_NUMBER
from skred.campaign.problems import Problem
from skred.campaign.tables import read_text

FILE = "campaign.toml"
LARGEST_BYTES = 100_000

# a.a.a. and so on: the time to parse it grows with the square of its length.
_DEEP_KEY = re.compile(r"""(?:[\w"'-]{1,50}[ \t]*\.[ \t]*){50}""")
_LINE_OF_ERROR = re.compile(r"at line (\d+)")
_KEY = re.compile(r"""\s*\[*\s*["']?([^\s"'=.\[\]]+)["']?\s*[=.\]]""")
_ADVICE = {
    "missing": "the key is missing; add it",
    "extra_forbidden": "unknown key; correct its name or remove it",
    "string_type": "expected text in quotes; correct it",
    "string_too_short": "the text is empty; fill it in",
    "string_too_long": "the text is too long; shorten it",
    "finite_number": "expected a finite number; correct it or remove the key",
    "float_type": "expected a number without quotes; correct it or remove the key",
    "less_than_equal": f"expected a number of at most {LARGEST_NUMBER:g}; correct it",
    "greater_than_equal": f"expected a number of at least {-LARGEST_NUMBER:g}; correct it",
}


def _integer_one(value: object) -> object:
    """Accept the integer 1 alone: ``true`` and ``1.0`` are other types in TOML."""
    if type(value) is not int or value != 1:
        raise PydanticCustomError("format", "expected the integer 1, the format's version; correct it")
    return value


def _printable(text: str) -> str:
    """Refuse text that a terminal would obey instead of show; lines and tabs are fine."""
    if not all(part.isprintable() for part in re.split("[\n\t]", text)):
        raise PydanticCustomError("printable", "the text holds control characters; remove them")
    return text


def _one_line(text: str) -> str:
    """Refuse a name that does not print in one line, or that blanks surround."""
    if not text.isprintable() or text != text.strip():
        raise PydanticCustomError("one_line", "expected one line of printable text, no blanks around it")
    return text


Place = Annotated[float, Field(allow_inf_nan=False, ge=-LARGEST_NUMBER, le=LARGEST_NUMBER)]


class Description(BaseModel):
    """The keys of ``campaign.toml``; no others are allowed."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)

    format: Annotated[Any, AfterValidator(_integer_one)]
    name: Annotated[str, Field(min_length=1, max_length=200), AfterValidator(_one_line)]
    description: Annotated[str, Field(max_length=20_000), AfterValidator(_printable)]
    source: Annotated[str, Field(max_length=20_000), AfterValidator(_printable)]
    origin: Literal["measured", "simulated"]
    reference_s_m: Place | None = None


def read_description(folder: Path) -> tuple[Description | None, int | None, list[Problem]]:
    """Read ``campaign.toml``.

    Parameters
    ----------
    folder : Path
        The campaign's folder.

    Returns
    -------
    description : Description or None
        None where there are problems.
    reference_row : int or None
        Line of the key ``reference_s_m``, for the check against the track.
    problems : list of Problem
        Everything that is wrong with the file by itself.
    """
    text = read_text(folder, FILE, LARGEST_BYTES)
    if isinstance(text, Problem):
        return None, None, [text]
    too_deep = Problem(FILE, None, None, None, "the values are nested too deeply; write plain values")
    if _DEEP_KEY.search(text):
        return None, None, [too_deep]
    try:
        content = tomllib.loads(text)
    except RecursionError:
        return None, None, [too_deep]
    except ValueError as error:
        # Also raised for integers of thousands of digits, which is not a TOMLDecodeError.
        place = _LINE_OF_ERROR.search(str(error))
        row = int(place.group(1)) if place else None
        message = f"not valid TOML ({_first_line(error)}); correct it"
        return None, None, [Problem(FILE, row, None, None, message)]
    try:
        return Description.model_validate(content), _line_of_keys(text).get("reference_s_m"), []
    except ValidationError as error:
        lines = _line_of_keys(text)
        return None, None, [_problem(detail, lines) for detail in error.errors()]


def _first_line(error: ValueError) -> str:
    """Return an error's message so that it can be shown."""
    message = str(error).splitlines()[0] if str(error) else "unreadable"
    return "".join(c if c.isprintable() else "?" for c in message)[:200]


def _problem(detail: Any, lines: Mapping[str, int]) -> Problem:
    """Turn what pydantic found into a problem."""
    key = str(detail["loc"][0])
    kind = detail["type"]
    message = _ADVICE.get(kind, detail["msg"])
    if kind == "literal_error":
        message = f"expected {detail['ctx']['expected']}; correct it"
    found = None if kind == "missing" else _found(detail["input"])
    return Problem(FILE, lines.get(key), key, found, message)


def _found(value: object) -> str:
    """Show a value, but not all that a table or an array holds."""
    if isinstance(value, dict | list):
        return "a table" if isinstance(value, dict) else "an array"
    try:
        return str(value)
    except ValueError:
        return "a very large integer"  # hexadecimal, thousands of digits: Python refuses to print it


def _line_of_keys(text: str) -> dict[str, int]:
    """Find the line on which each key is first set, as a person would look for it."""
    found: dict[str, int] = {}
    for line, content in enumerate(text.split("\n"), start=1):
        if match := _KEY.match(content):
            found.setdefault(match.group(1), line)
    return found
