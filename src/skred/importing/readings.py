"""One cell of readings: a number, a bound, or a word for why there is none."""

import re
from dataclasses import dataclass

from skred.campaign.cells import CellError, number
from skred.campaign.problems import shown
from skred.importing.mapping import Cells
from skred.importing.numbers import Notation
from skred.importing.questions import Question
from skred.importing.sheet import NumberText

OBSERVED, NOT_REACHED, MISSING = "observed", "not_reached", "missing"
AT_LEAST, AT_MOST, BETWEEN = "at_least", "at_most", "between"
BOUNDS = {AT_LEAST: AT_MOST, AT_MOST: AT_LEAST}
"""Each bound, and what it is of a quantity that falls where its own rises."""
DASHES = frozenset(("-", "\u2013", "\u2014", "\u2212", "--", "---"))
_BOUNDS = (
    (AT_LEAST, r">=|=>|>|≥|⩾|at least|at-least|min\.?|mind\.?|mindestens|minst|au moins|almeno"),
    (AT_MOST, r"<=|=<|<|≤|⩽|at most|at-most|max\.?|höchstens|maks\.?|au plus|al massimo|up to"),
)
_BOUND = re.compile(
    f"(?:{'|'.join(f'(?P<{name}>{words})' for name, words in _BOUNDS)})" + r"(?=[\s\d])", re.IGNORECASE
)
_NUMBER = r"[+\-\u2212]?\s*\d[\d.,' \u00a0\u202f\u2019]*"
_TO = (
    r"\.\.\.?|\u2026|-|\u2013|\u2014|\u2212"
    r"|(?<=\s)(?:to|and|bis|und|til|og|à|et|a|e)(?=\s)"
)
_RANGE = re.compile(
    rf"(?:(?:between|from|zwischen|von|mellom|fra|entre|de|tra|da)\s+)?"
    rf"(?P<low>{_NUMBER}?)\s*(?:{_TO})\s*(?P<high>{_NUMBER})",
    re.IGNORECASE,
)
"""Two numbers and what stands between them; a date has three and is none."""
_LONGEST_RANGE = 100  # the pattern takes time that grows with the square of a cell's length
_DATE = re.compile(r"\d{4}-\d{2}-\d{2}( .*)?")
_WITH_SD = re.compile(r"±|\+/-|\+-")
_NUMBER_LIKE = re.compile(r"\d")


@dataclass(frozen=True)
class Reading:
    """What one cell says.

    Attributes
    ----------
    status : str
        As in recordings.csv.
    value, sd, value_to : str
        Numbers with a decimal point, in the cell's own unit; empty where there is none.
    """

    status: str
    value: str = ""
    sd: str = ""
    value_to: str = ""


def bound_question(where: str, text: str) -> Question:
    """Whether a bound that stands beside an altitude speaks of the runout: what is higher is less far."""
    what = f"'{shown(text, 40)}' as an altitude: is the bound of the runout or of the altitude?"
    return Question(("runout", "bounds"), where, what, ("runout", "altitude"))


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
    """Read a cell with a number: ``50``, ``50 ± 5``, ``>= 2140``, ``at least 2140``, ``12-18``.

    Raises
    ------
    CellError
        If it is anything else.
    """
    if isinstance(text, NumberText):
        return Reading(OBSERVED, notation.with_point(text))
    if _DATE.fullmatch(text):
        raise CellError("a date stands here; if a program made it of two numbers such as 3-12, write 3 to 12")
    status = OBSERVED
    bound = _BOUND.match(text)
    if bound is not None:
        status = str(bound.lastgroup)
        text = text[bound.end() :].strip()
    # Blanks are no part of the pattern, which would take time that grows with the square of their number.
    value, *sd = (part.strip() for part in _WITH_SD.split(text))
    if len(sd) > 1:
        raise CellError("expected one number, and one standard deviation after ±; correct it")
    sd_text = notation.with_point(sd[0]) if sd else ""
    ends = _RANGE.fullmatch(value) if len(value) <= _LONGEST_RANGE else None
    if ends is None:
        return Reading(status, notation.with_point(value), sd_text)
    if bound is not None:
        raise CellError("a bound is one number; write the interval alone, or one bound")
    low, high = (notation.with_point(ends.group(name).strip()) for name in ("low", "high"))
    if number(low) == number(high):
        raise CellError("both ends of the interval are the same; write the number once")
    return Reading(BETWEEN, low, sd_text, high)
