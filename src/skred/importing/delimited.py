"""Text tables: their encoding and what separates their cells. Neither is guessed where it is in doubt."""

import codecs
import csv
import io
import re

from skred.campaign.problems import shown
from skred.campaign.tables import MOST_LINES
from skred.importing.questions import Question, Unclear
from skred.importing.sheet import TABLE, TRACK, Grid, Section, in_one_line
from skred.importing.sources import Source, refuse

ENCODINGS = ("utf-8", "latin-1", "cp1252", "cp1250", "mac-roman", "cp850")
"""What may be declared for a file that is not UTF-8."""
SEPARATORS = {";": "semicolon", "\t": "tab", ",": "comma", "|": "bar"}
_MARK = "\ufeff"
"""The byte order mark, which some programs write once more at each saving."""
_HINT = re.compile(r"sep=(.)\r?\n", re.I)


def read_delimited(source: Source, encoding: str | None, separator: str | None, section: Section) -> Grid:
    """Read a text table.

    Parameters
    ----------
    source : Source
    encoding : str or None
        Used where the text is not UTF-8.
    separator : str or None
        Between cells; by default the one sign in the header that can be meant.
    section : tuple of str
        Of the mapping file, for questions.

    Raises
    ------
    CampaignError
        If it is no table.
    Unclear
        If the encoding or the separator cannot be known.
    """
    text, found = _decoded(source, encoding, section)
    hint = _HINT.match(text)
    skipped = 0
    if hint is not None:
        text, skipped = text[hint.end() :], 1
        separator = separator or hint.group(1)
    separator = separator or _separator(source.name, text, section)
    lines = _split(source.name, text, separator, skipped)
    if not lines:
        raise refuse(source.name, "the file is empty; write its header and rows")
    written = f"{found}, {SEPARATORS.get(separator, separator)}"
    return Grid(source.name, tuple(lines), written, separator, source.key)


def _decoded(source: Source, encoding: str | None, section: Section) -> tuple[str, str]:
    """The text and the name of its encoding."""
    content = source.content
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        try:
            return content.decode("utf-16").lstrip(_MARK), "UTF-16"
        except UnicodeDecodeError:
            raise refuse(source.name, "the text is not UTF-16 as its mark says; save it as UTF-8") from None
    if b"\0" in content:
        row = content[: content.index(b"\0")].count(b"\n") + 1
        raise refuse(source.name, "the file holds NUL bytes; save it as CSV in UTF-8", row)
    try:
        return content.decode("utf-8").lstrip(_MARK), "UTF-8"
    except UnicodeDecodeError as error:
        if encoding is not None and encoding != "utf-8":
            try:
                return content.decode(encoding), encoding
            except UnicodeDecodeError:
                raise refuse(source.name, f"the text is not {encoding}; declare another") from None
        row = content[: error.start].count(b"\n") + 1
        start = max(content.rfind(b"\n", 0, error.start) + 1, error.start - 25)
        around = content[start : error.start + 25].splitlines()[0].decode("latin-1")
        text = f"byte 0x{content[error.start]:02x} is not UTF-8; as latin-1 it reads '{shown(around)}'"
        where = f"{source.name}, row {row}"
        option = "" if section == TRACK else "--encoding"  # of all tables: it is used only where UTF-8 fails
        question = Question(
            (*(TRACK if section == TRACK else TABLE), "encoding"),
            where,
            text,
            ENCODINGS[1:],
            "latin-1",
            option,
        )
        raise Unclear([question]) from None


def _separator(file: str, text: str, section: Section) -> str:
    """The only separator that the first row can have."""
    # A title above the table has none; which row is the header is asked later.
    with_any = ([sign for sign in SEPARATORS if sign in _unquoted(line)] for line in text.splitlines())
    candidates = next(filter(None, with_any), [])
    if len(candidates) > 1:
        fitting = [sign for sign in candidates if _fits(text, sign)]
        candidates = fitting if len(fitting) == 1 else candidates
    if len(candidates) == 1:
        return candidates[0]
    found = " and ".join(SEPARATORS[sign] for sign in candidates) or "none of ; , tab |"
    question = f"what separates the columns is not clear from the first row (found {found})"
    option = "--separator" if section == TABLE else ""
    raise Unclear([Question((*section, "separator"), file, question, (), '";"', option)])


def _unquoted(line: str) -> str:
    """A line without its quoted parts."""
    return re.sub(r'"[^"]*"', "", line)


def _fits(text: str, separator: str) -> bool:
    """Whether all rows have equally many cells."""
    try:
        rows = csv.reader(io.StringIO(text, newline=""), delimiter=separator)
        return len({len(row) for row in rows if any(row)}) == 1
    except csv.Error:
        return False


def _split(file: str, text: str, separator: str, skipped: int) -> list[tuple[int, tuple[str, ...]]]:
    """Each row's number and its cells, empty rows left out."""
    lines = []
    # Blanks after a separator are no part of a cell, except where they are the separator.
    reader = csv.reader(
        io.StringIO(text, newline=""),
        delimiter=separator,
        strict=True,
        skipinitialspace=not separator.isspace(),
    )
    last = skipped
    try:
        for row in reader:
            cells = tuple(in_one_line(cell) for cell in row)
            if any(cells):
                lines.append((last + 1, cells))
            last = reader.line_num + skipped
            if last > MOST_LINES:
                raise refuse(file, f"the table has more than {MOST_LINES} lines; split it")
    except csv.Error as error:
        raise refuse(
            file, f"the rows from here on cannot be read ({error}); correct them", last + 1
        ) from None
    return lines
