"""Which tables there are: the campaign format's own by their names, all others wide ones."""

from collections import Counter
from contextlib import suppress
from dataclasses import replace
from typing import Any

from skred.importing.delimited import read_delimited
from skred.importing.mapping import Mapping, TableWriting
from skred.importing.questions import Unclear
from skred.importing.sheet import TABLE, TRACK, Grid, Section, Sheet, sheet_of
from skred.importing.sources import TABLES, Source, Sources, refuse
from skred.importing.workbook import EmptySheet, read_workbook, sheet_names, which_sheet

MOST_TABLES = 100
ALL_SHEETS = "*"


def sheets_of(sources: Sources, declared: Mapping) -> tuple[dict[str, Sheet], list[Sheet]]:
    """Read every table that was given.

    Parameters
    ----------
    sources : Sources
    declared : Mapping

    Returns
    -------
    of_format : dict of str to Sheet
        By the format's table.
    wide : list of Sheet
        Wide tables; empty where the format's own tables are all.

    Raises
    ------
    CampaignError
        If a table cannot be read, is missing, or is one too many.
    Unclear
        If how it is written, or which sheet is meant, is open.
    """
    of_format = {key: source for key, source in sources.of_format.items() if key in TABLES}
    grids = {key: _of_format(source, declared, key) for key, source in of_format.items()}
    wide = list[Grid]()
    _require_sheets(sources.others, declared.table)
    several = len(sources.others) > 1
    for other in sources.others:
        parts = _parts_of_workbook(other)
        if parts and declared.table.sheet is None:
            grids |= {
                key: read_workbook(other, sheet, TABLE) for key, sheet in parts.items() if key not in grids
            }
        else:
            wide += _wide(other, declared, several=several)
    if sources.others and not wide and "recordings" not in grids:
        raise refuse(sources.others[0].name, "every sheet is empty; write a table")
    if len(wide) > MOST_TABLES:
        raise refuse(wide[MOST_TABLES].file, f"more than {MOST_TABLES} tables; import fewer at a time")
    _require_tables(grids, wide)
    rows = {key: declared.track.header_row if key == "track" else None for key in grids}
    sections = {key: TRACK if key == "track" else TABLE for key in grids}
    wide = _keyed(wide)
    return (
        {key: sheet_of(grid, rows[key], sections[key]) for key, grid in grids.items()},
        [sheet_of(grid, declared.writing(grid.key).header_row, section_of(grid, wide)) for grid in wide],
    )


def section_of(table: Grid | Sheet, tables: list[Grid] | list[Sheet] | Any) -> Section:
    """Where a mapping file declares how a wide table is written: on its own, where there are several."""
    return TABLE if len(tables) == 1 else ("tables", table.key)


def _require_tables(grids: dict[str, Grid], wide: list[Grid]) -> None:
    """Refuse an import without a track, or with two kinds of tables."""
    for key in ("track",) if wide else TABLES:
        if key not in grids:
            what = "--track FILE" if key == "track" else f"{key}.csv, or one wide table"
            raise refuse(f"{key}.csv", f"the {key} table was not given; add {what}")
    if wide and {"events", "recordings"} & set(grids):
        raise refuse(wide[0].file, "a wide table beside events or recordings; import one of the two")


def _parts_of_workbook(source: Source) -> dict[str, str]:
    """Sheets of a workbook that are named as the format's tables, if it holds recordings so."""
    if not source.is_workbook:
        return {}
    parts = {name.lower(): name for name in sheet_names(source) if name.lower() in TABLES}
    return parts if "recordings" in parts else {}


def _of_format(source: Source, declared: Mapping, key: str) -> Grid:
    """Cells of one of the format's own tables, or of the track and sensors of a wide one."""
    writing, section = (declared.track, TRACK) if key == "track" else (declared.table, TABLE)
    if source.is_workbook:
        return read_workbook(source, declared.track.sheet if key == "track" else None, section)
    return read_delimited(source, writing.encoding, writing.separator, section)


def _wide(source: Source, declared: Mapping, *, several: bool) -> list[Grid]:
    """Cells of the wide tables in one file."""
    section = ("tables", source.key) if several else TABLE
    if not source.is_workbook:
        writing = declared.writing(source.key)
        return [read_delimited(source, writing.encoding, writing.separator, section)]
    names, wanted = sheet_names(source), declared.table.sheets
    if len(names) > 1 and not wanted:
        raise Unclear([which_sheet(source, names, section)])
    if ALL_SHEETS not in wanted or len(names) == 1:
        chosen = names if len(names) == 1 else [one for one in names if one in wanted]
        return [read_workbook(source, name, section) for name in chosen]
    grids = []
    for name in names:
        with suppress(EmptySheet):  # of those that programs put behind the first
            grids.append(read_workbook(source, name, section))
    return grids


def _require_sheets(sources: tuple[Source, ...], table: TableWriting) -> None:
    """Refuse names of sheets that no workbook has, and workbooks without any of them."""
    there = {source.name: sheet_names(source) for source in sources if source.is_workbook}
    wanted = [name for name in table.sheets if name != ALL_SHEETS]
    for name in wanted:
        if there and not any(name in names for names in there.values()):
            file, names = next(iter(there.items()))
            raise refuse(file, f"no sheet named '{name}'; there are: {', '.join(names)}")
    for file, names in there.items():
        if wanted and ALL_SHEETS not in table.sheets and not set(wanted) & set(names):
            raise refuse(file, f"none of the sheets {', '.join(wanted)}; there are: {', '.join(names)}")


def _keyed(wide: list[Grid]) -> list[Grid]:
    """The tables, those of one name (sheets of two workbooks) told apart by their files'."""
    count = Counter(grid.key for grid in wide)
    return [grid if count[grid.key] == 1 else replace(grid, key=grid.file) for grid in wide]
