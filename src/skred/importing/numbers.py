"""Numbers as people write them: which sign is the decimal sign, and a number's text with a point."""

import re
from collections.abc import Iterable
from dataclasses import dataclass

from skred.campaign.cells import CellError, number
from skred.campaign.problems import CampaignError, Problem, shown
from skred.importing.questions import Question, Unclear, set_option
from skred.importing.sheet import TABLE, NumberText, Section

_WITH_SIGN = re.compile(r"(?<![\w.,])\d*([.,])\d+(?![\d.,])")
_LIKE_THOUSANDS = re.compile(r"[1-9]\d{0,2}[.,]\d{3}")
_BOTH = {
    # From a number's first digit on: from each digit it would take time that grows with the square of a cell.
    sign: re.compile(rf"(?<![\d.,])\d+(?:[{other}]\d{{3}})+[{sign}]\d+")
    for sign, other in (".,", ",.")
}
_PLAIN = re.compile(r"[+-]?(\d+(?:\.\d*)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_EXPONENT = re.compile(r"(?<=\d)[eE](?=[+-]?\d)")
_NO_PART = re.compile(r"[^\d\s.,'+-]")
"""What no number has, in any notation."""
_DIGITS = re.compile(r"[+-]?\d(?:[\d.,' ]*\d)?")
_TYPOGRAPHIC = str.maketrans({"\u2212": "-", "\u00a0": " ", "\u202f": " ", "\u2019": "'"})


@dataclass(frozen=True)
class Notation:
    """How numbers are written: the decimal sign, and what stands between thousands (empty for nothing)."""

    decimal: str = "."
    thousands: str = ""

    def __str__(self) -> str:
        """In words."""
        return "decimal comma" if self.decimal == "," else "decimal point"

    def with_point(self, text: str) -> str:
        """A number's text with a decimal point and nothing between thousands.

        Raises
        ------
        CellError
            If it is not a number in this notation; the message says what to declare.
        """
        if isinstance(text, NumberText):
            number(text)
            return str(text)
        plain = text.translate(_TYPOGRAPHIC)
        self._refuse_words(plain)
        if self.thousands:
            plain = self._without_thousands(plain)
        elif re.search(r"\d[' ]\d{3}", plain):
            raise CellError("expected a number without signs between thousands; or declare table.thousands")
        other = "." if self.decimal == "," else ","
        if other in plain and re.search(r"\d", plain):
            sign, words = ("point", "commas") if other == "." else ("comma", "points")
            raise CellError(
                f"a {sign} in a table with decimal {words}; write all numbers one way, or declare "
                f'--set table.thousands="{other}" if it stands between thousands'
            )
        plain = plain.replace(self.decimal, ".")
        if not _PLAIN.fullmatch(plain):
            raise CellError(f"expected one number, such as {self.example}; correct it")
        number(plain)
        return plain

    @property
    def example(self) -> str:
        """A number with a part after the decimal sign."""
        return f"12{self.decimal}5"

    def _refuse_words(self, text: str) -> None:
        """Refuse a cell that holds something else than a number, whatever the number's signs are."""
        if not re.search(r"\d", text):
            raise CellError(
                f"there is no number; write digits, such as {self.example}, or leave the cell empty if its"
                " column allows that"
            )
        if not _NO_PART.search(_EXPONENT.sub("", text)):
            return
        numbers = _DIGITS.findall(text)
        before, _, after = (part.strip() for part in text.partition(numbers[0]))
        if len(numbers) > 1 or (before and after):
            raise CellError(f"expected one number, such as {self.example}, and nothing else in the cell")
        word, rest = before, ", and how uncertain it is as standard deviation"
        if after:
            word, rest = after, " in the column's unit, which its name says or an option declares"
        raise CellError(f"'{shown(word, 20)}' is no part of a number; write {numbers[0]} alone{rest}")

    def _without_thousands(self, text: str) -> str:
        """Take the signs between thousands out; elsewhere they are refused."""
        whole, sign, rest = text.partition(self.decimal)
        groups = whole.split(self.thousands)
        if len(groups) > 1 and not (
            re.fullmatch(r"[+-]?\d{1,3}", groups[0])
            and all(re.fullmatch(r"\d{3}", one) for one in groups[1:])
        ):
            raise CellError("signs between thousands are not after every third digit; correct the number")
        return "".join(groups) + sign + rest


def notation_of(
    cells: Iterable[tuple[int, str, str]],
    file: str,
    separator: str | None,
    declared: tuple[str | None, str | None],
    section: Section,
) -> Notation:
    """Find the decimal sign of a table from the cells that are to hold numbers.

    Parameters
    ----------
    cells : iterable of (int, str, str)
        Row, column, text.
    file : str
    separator : str or None
        Between cells; None for a workbook.
    declared : (str or None, str or None)
        Decimal sign and sign between thousands, where they were declared.
    section : tuple of str
        Of the mapping file, for questions.

    Raises
    ------
    CampaignError
        If points and commas are mixed; names row and column of both.
    Unclear
        If every sign found could stand between thousands.
    """
    decimal, thousands = declared
    if decimal is not None:
        return Notation(decimal, thousands or "")
    first = dict[str, tuple[int, str, str]]()
    sure = set[str]()
    for line, column, text in cells:
        if isinstance(text, NumberText):
            continue
        found = [(match.group(1), match.group()) for match in _WITH_SIGN.finditer(text)]
        found += [(sign, "") for sign, pattern in _BOTH.items() if pattern.search(text)]
        for sign, digits in found:
            if sign == thousands:
                continue
            first.setdefault(sign, (line, column, text))
            if not _LIKE_THOUSANDS.fullmatch(digits):
                sure.add(sign)
    if len(first) == 2:
        raise CampaignError(_mixed(file, first, section))
    if not first:
        return Notation("," if thousands == "." else ".", thousands or "")
    (sign, (line, column, text)) = next(iter(first.items()))
    if sign in sure or (sign == "." and separator == ","):
        return Notation(sign, thousands or "")
    where = f"{file}, row {line}, column {column}"
    doubt = (
        f"'{text}' can be a decimal number or thousands, and no other number tells which: the decimal sign "
        f"is '{sign}' if it is a decimal number; if it is thousands, add "
        f"{set_option((*section, 'thousands'), sign)} instead"
    )
    option = "--decimal" if section == TABLE else ""
    # No example: whatever sign it showed would answer the question for who copies the line.
    raise Unclear([Question((*section, "decimal"), where, doubt, (".", ","), "", option)])


def _mixed(file: str, first: dict[str, tuple[int, str, str]], section: Section) -> list[Problem]:
    """Both decimal signs in one table: where each is."""
    problems = []
    for sign, other in ((",", "."), (".", ",")):
        line, column, text = first[sign]
        word, elsewhere = ("comma", "points") if sign == "," else ("point", "commas")
        message = (
            f"a decimal {word} here, decimal {elsewhere} elsewhere (row {first[other][0]}); write all "
            f"numbers one way, or declare {set_option((*section, 'thousands'), sign)} if it stands between "
            "thousands"
        )
        problems.append(Problem(file, line, column, text, message))
    return problems
