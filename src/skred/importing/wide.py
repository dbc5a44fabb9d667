"""What reading a wide table needs, and what it finds wrong or open."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from skred.campaign import CampaignError, Problem
from skred.campaign.cells import CellError
from skred.importing.column_meaning import Meaning
from skred.importing.mapping import Column
from skred.importing.mapping import Mapping as Declared
from skred.importing.numbers import Notation
from skred.importing.places import Places
from skred.importing.questions import Question, Unclear
from skred.importing.sheet import Sheet


@dataclass
class Open:
    """What is wrong and what is open, kept until every table was read."""

    problems: list[Problem] = field(default_factory=list)
    questions: list[Question] = field(default_factory=list)

    def settle(self) -> None:
        """Raise what there is."""
        if self.problems:
            raise CampaignError(self.problems)
        if self.questions:
            raise Unclear(self.questions)


@dataclass(frozen=True)
class Wide:
    """A wide table with everything that is needed to read its cells."""

    sheet: Sheet
    meanings: Mapping[str, Meaning]
    declared: Declared
    places: Places
    notation: Notation
    open: Open

    def of_kind(self, *kinds: str) -> dict[str, Column]:
        """Columns of some kinds."""
        return {name: one.column for name, one in self.meanings.items() if one.column.is_ in kinds}

    def fail(self, line: int, name: str, found: str, error: CellError) -> None:
        """Keep a problem of a cell."""
        self.open.problems.append(Problem(self.sheet.file, line, name, found, str(error)))
