"""The track's table: which column is horizontal distance, which elevation."""

from dataclasses import dataclass

import numpy as np

from skred.campaign import CampaignError, Problem, Track
from skred.campaign.cells import CellError
from skred.importing.draft import DraftTable, Where
from skred.importing.mapping import TrackWriting
from skred.importing.numbers import Notation, notation_of
from skred.importing.questions import Question, Unclear
from skred.importing.sheet import TRACK, Sheet

X_NAMES = ("distance", "dist", "x", "chainage", "station", "horizontal distance", "distanz")
Z_NAMES = ("elevation", "z", "altitude", "height", "höhe", "elev")
"""How other programs name the columns of a profile; the first two are those of QGIS."""


@dataclass(frozen=True, eq=False)
class TrackRead:
    """A track as it was read.

    Attributes
    ----------
    table : DraftTable
    track : Track or None
        None where its points are not in downhill order; checking the draft says so.
    x, z : str
        The columns that it was taken from.
    declared : bool
        Whether the columns were declared, or have the names of the format.
    ignored : tuple of str
        Columns that were left out.
    notation : Notation
    """

    table: DraftTable
    track: Track | None
    x: str
    z: str
    declared: bool
    ignored: tuple[str, ...]
    notation: Notation


def read_track_table(sheet: Sheet, writing: TrackWriting) -> TrackRead:
    """Read a track.

    Raises
    ------
    CampaignError
        With every cell that is no number.
    Unclear
        If its columns are not clear.
    """
    (x, x_declared), (z, z_declared) = _columns(sheet, writing)
    names = {x: "x_m", z: "z_m"}
    # A misspelt width_m beside x_m and z_m is told by the format's reader; those of others are left out.
    kept = [name for name in sheet.columns if name in names or name == "width_m" or x == "x_m"]
    ignored = tuple(name for name in sheet.columns if name not in kept)
    cells = ((line, name, text) for name in kept for line, text in sheet.cells(name))
    declared = (writing.decimal, writing.thousands)
    notation = notation_of(cells, sheet.file, sheet.separator, declared, TRACK)
    problems, rows = list[Problem](), list[tuple[Where, dict[str, str]]]()
    sources = {names.get(name, name): name for name in kept}
    for line, row in sheet.rows():
        read = {}
        for name in kept:
            try:
                read[names.get(name, name)] = notation.with_point(row[name])
            except CellError as error:
                problems.append(Problem(sheet.file, line, name, row[name], str(error)))
        rows.append((Where(sheet.file, line, sources, row), read))
    if problems:
        raise CampaignError(problems)
    table = DraftTable(tuple(sources), tuple(rows))
    return TrackRead(table, _track(table), x, z, x_declared and z_declared, ignored, notation)


def _columns(sheet: Sheet, writing: TrackWriting) -> list[tuple[str, bool]]:
    """The columns of x and z, and whether each was declared."""
    found = []
    questions = []
    by_word = {name.casefold(): name for name in reversed(sheet.columns)}
    for key, own, others, what in (
        ("x", "x_m", X_NAMES, "horizontal distance"),
        ("z", "z_m", Z_NAMES, "elevation"),
    ):
        declared = getattr(writing, key)
        fitting = list(dict.fromkeys(by_word[name] for name in others if name in by_word))
        if declared in sheet.columns:
            found.append((str(declared), True))
        elif own in sheet.columns:
            found.append((own, True))
        elif len(fitting) == 1:
            found.append((fitting[0], False))
        else:
            text = f"which column is the {what} [m]? There are: {', '.join(sheet.columns)}"
            questions.append(
                Question(("track", key), sheet.file, text, sheet.columns, f'"{sheet.columns[0]}"')
            )
    if questions:
        raise Unclear(questions)
    return found


def _track(table: DraftTable) -> Track | None:
    """The track, if its points are in downhill order."""
    x_m = np.array([float(row["x_m"]) for _, row in table.rows])
    z_m = np.array([float(row["z_m"]) for _, row in table.rows])
    return Track(x_m, z_m) if len(x_m) > 1 and bool(np.all(np.diff(x_m) > 0)) else None
