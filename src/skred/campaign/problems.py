"""What is wrong with a campaign, said so that its owner can put it right."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass

from skred.errors import InputError

SHOWN_CHARACTERS = 60
SHOWN_PROBLEMS_PER_FILE = 20
FEWEST_ALIKE = 6
"""Problems that say the same of one column are told in one line from so many on."""
SHOWN_ROWS = 5


def shown(text: str, longest: int = SHOWN_CHARACTERS) -> str:
    r"""Text from a stranger's file as it may be shown in a terminal.

    Characters that do not print (control and escape sequences, direction marks) appear as ``\x1b`` and the
    like, because a terminal would obey them.

    Parameters
    ----------
    text : str
        Anything.
    longest : int
        Longer text is cut, and an ellipsis says so.

    Returns
    -------
    str
        Printable text.
    """
    cut = text[:longest]
    printable = "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in cut)
    return printable + ("…" if len(text) > longest else "")


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong, where it is, and what to do about it.

    Parameters
    ----------
    file : str
        Name of the file in the campaign's folder.
    row : int or None
        Line of the file, the first line being 1; None where the whole file is meant.
    column : str or None
        Name of the column, or of the key in ``campaign.toml``; None where the whole row is meant.
    found : str or None
        What stands there, safe to show in a terminal; None where there is nothing to show.
    message : str
        What was expected and what to do.
    """

    file: str
    row: int | None
    column: str | None
    found: str | None
    message: str

    def __post_init__(self) -> None:
        """Make everything that came from the file safe to show."""
        object.__setattr__(self, "file", shown(self.file))
        if self.column is not None:
            object.__setattr__(self, "column", shown(self.column))
        if self.found is not None:
            object.__setattr__(self, "found", shown(self.found))

    def __str__(self) -> str:
        """Return the problem as one line."""
        place = [self.file]
        if self.row is not None:
            place.append(f"row {self.row}")
        if self.column is not None:
            place.append(f"key {self.column}" if self.file.endswith(".toml") else f"column {self.column}")
        found = "" if self.found is None else f"found '{self.found}': "
        return f"{', '.join(place)}: {found}{self.message}"

    def as_dict(self) -> dict[str, str | int | None]:
        """Return the problem as plain data, for JSON."""
        return asdict(self)


class CampaignError(InputError):
    """A campaign that cannot be read, written or found; carries every problem, not only the first.

    Parameters
    ----------
    problems : iterable of Problem
        At least one.
    """

    problems: tuple[Problem, ...]

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__(self.problems)

    def __str__(self) -> str:
        """Return the problems, one a line, the longest lists cut short."""
        return "\n".join(problem_lines(self.problems))


def problem_lines(problems: Iterable[Problem], per_file: int = SHOWN_PROBLEMS_PER_FILE) -> list[str]:
    """List the problems as lines of text, by file.

    Parameters
    ----------
    problems : iterable of Problem
        In any order.
    per_file : int
        So many are shown of each file; a last line says how many more there are.

    Returns
    -------
    list of str
        One line for each problem shown.
    """
    by_file: dict[str, list[Problem]] = {}
    for problem in problems:
        by_file.setdefault(problem.file, []).append(problem)
    lines: list[str] = []
    for file, of_file in by_file.items():
        alike = _alike(of_file)
        lines += [_line(same) for same in alike[:per_file]]
        if len(alike) > per_file:
            more = sum(len(same) for same in alike[per_file:])
            lines.append(f"{file}: … and {more} more problems in this file")
    return lines


def _alike(problems: Sequence[Problem]) -> list[list[Problem]]:
    """Problems of one file, those together that say the same of several rows of a column."""
    told: dict[tuple[object, ...], list[Problem]] = {}
    for position, problem in enumerate(problems):
        column = position if problem.row is None or problem.column is None else problem.column
        told.setdefault((column, problem.message), []).append(problem)
    groups: list[list[Problem]] = []
    for same in told.values():
        groups += [same] if len(same) >= FEWEST_ALIKE else [[problem] for problem in same]
    return sorted(groups, key=lambda same: problems.index(same[0]))


def _line(same: Sequence[Problem]) -> str:
    """One line for problems that say the same."""
    first = same[0]
    if len(same) == 1:
        return str(first)
    rows = ", ".join(
        f"{problem.row}" + ("" if problem.found == first.found else f" '{problem.found}'")
        for problem in same[1:SHOWN_ROWS]
    )
    return f"{first} (so in {len(same)} rows: {first.row}, {rows} and {len(same) - SHOWN_ROWS} more)"
