"""One cell of readings: a number, a bound, or a word for why there is none."""

import re
from dataclasses import dataclass

from skred.campaign.cells import CellError
from skred.importing.mapping import Cells
from skred.importing.numbers import Notation
from skred.importing.sheet import NumberText

OBSERVED, NOT_REACHED, MISSING = "observed", "not_reached", "missing"
AT_LEAST, AT_MOST = "at_least", "at_most"
STATUSES = (OBSERVED, NOT_REACHED, MISSING, AT_LEAST, AT_MOST)
"""Every status that an import writes; the last two are additions to version 1 of the format."""
DASHES = frozenset(("-", "\u2013", "\u2014", "\u2212", "--", "---"))
_BOUNDS = (
    (AT_LEAST, r">=|=>|>|≥|⩾|at least|at-least|min\.?|mind\.?|mindestens|minst|au moins|almeno"),
    (AT_MOST, r"<=|=<|<|≤|⩽|at most|at-most|max\.?|höchstens|maks\.?|au plus|al massimo"),
)
_BOUND = re.compile(
    f"(?:{'|'.join(f'(?P<{name}>{words})' for name, words in _BOUNDS)})" + r"(?=[\s\d])", re.IGNORECASE
)
_WITH_SD = re.compile(r"\s*(?:±|\+/-|\+-)\s*")
_NUMBER_LIKE = re.compile(r"\d")


@dataclass(frozen=True)
class Reading:
    """What one cell says.

    Attributes
    ----------
    status : str
        One of `STATUSES`.
    value, sd : str
        Numbers with a decimal point, in the cell's own unit; empty where there is none.
    """

    status: str
    value: str = ""
    sd: str = ""


def silence(text: str, cells: Cells) -> tuple[tuple[str, ...], str | None] | None:
    """For a cell without a number: the key that says what it means, and what was declared there.

    Parameters
    ----------
    text : str
    cells : Cells
        What was declared.

    Returns
    -------
    (key, status) or None
        None where the cell holds a digit.
    """
    if text == "":
        return ("cells", "blank"), cells.blank
    if text in DASHES:
        return ("cells", "dash"), cells.dash
    declared = {word.casefold(): status for word, status in cells.words.items()}
    if text.casefold() in declared:
        return ("cells", "words", text), declared[text.casefold()]
    if isinstance(text, NumberText) or _NUMBER_LIKE.search(text):
        return None
    return ("cells", "words", text), None


def number_of(text: str, notation: Notation) -> Reading:
    """Read a cell with a number: ``50``, ``50 ± 5``, ``>= 2140``, ``at least 2140``.

    Raises
    ------
    CellError
        If it is anything else.
    """
    if isinstance(text, NumberText):
        return Reading(OBSERVED, notation.with_point(text))
    status = OBSERVED
    bound = _BOUND.match(text)
    if bound is not None:
        status = str(bound.lastgroup)
        text = text[bound.end() :].strip()
    value, *sd = _WITH_SD.split(text)
    if len(sd) > 1:
        raise CellError("expected one number, and one standard deviation after ±; correct it")
    return Reading(status, notation.with_point(value), notation.with_point(sd[0]) if sd else "")
