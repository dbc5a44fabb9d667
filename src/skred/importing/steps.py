"""An import from files to a checked draft, and its writing; nothing is asked, nothing printed."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import tomlkit

from skred.campaign import Campaign
from skred.campaign.writing import write_files
from skred.importing.draft import Draft, description_text
from skred.importing.five_files import COLUMNS, read_five_files
from skred.importing.joined import joined
from skred.importing.mapping import FILE, Mapping, split_column
from skred.importing.mapping_text import mapping_text
from skred.importing.next_mapping import mapping_of_five, mapping_of_wide
from skred.importing.places import Places
from skred.importing.sensors_table import read_sensors
from skred.importing.sheet import Sheet
from skred.importing.sheets import section_of, sheets_of
from skred.importing.sources import CAMPAIGN, Source, Sources, open_source, refuse, sort_out
from skred.importing.track_table import TrackRead, read_track_table
from skred.importing.understanding import (
    ShownColumn,
    Understanding,
    filled,
    how_written,
    preview_of,
    wide_columns_shown,
)
from skred.importing.wide import Open
from skred.importing.wide_columns import meanings
from skred.importing.wide_table import read_wide_table


@dataclass(frozen=True)
class Imported:
    """An import before it is written.

    Attributes
    ----------
    draft : Draft
    campaign : Campaign
        The draft as it was read.
    understanding : Understanding
    mapping : Mapping
        With what the tables' names said declared too, for the next table.
    """

    draft: Draft
    campaign: Campaign
    understanding: Understanding
    mapping: Mapping


@dataclass(frozen=True)
class Files:
    """What is imported.

    Attributes
    ----------
    tables : sequence of Path
        Wide tables, or the campaign format's files, or a folder of these.
    track, sensors : Path or None
        Tables that go with a wide one.
    mapping : Path or None
        The mapping file; a track that it names lies beside it.
    """

    tables: Sequence[Path]
    track: Path | None = None
    sensors: Path | None = None
    mapping: Path | None = None


def import_tables(files: Files, declared: Mapping, columns: Sequence[str] = ()) -> Imported:
    """Read tables, and check the campaign that they make; nothing is written.

    Parameters
    ----------
    files : Files
    declared : Mapping
        Everything that was declared.
    columns : sequence of str
        More of it, as ``NAME=MEANING``.

    Raises
    ------
    CampaignError
        With every problem, by file, row and column.
    Unclear
        With what must be declared or asked about.
    InputError
        If a declaration names what is not there.
    """
    sources = sort_out(files.tables)
    given = {"track": files.track, "sensors": files.sensors}
    of_format = dict(sources.of_format)
    for key, path in given.items():
        if path is not None:
            of_format[key] = open_source(path)
    if files.mapping is not None and declared.track.file is not None and "track" not in of_format:
        folder = files.mapping.resolve().parent
        of_format["track"] = open_source(folder / declared.track.file, folder)
    sheets, wide = sheets_of(Sources(of_format, sources.others), declared)
    if columns:
        tables = [*wide, *(sheet for key, sheet in sheets.items() if key == "events")]
        names = list(dict.fromkeys(name for sheet in tables for name in sheet.columns))
        pairs = (split_column(text, names) for text in columns)
        declared = declared.with_values({("columns", name): value for name, value in pairs})
    track = _track(sheets["track"], declared, is_wide=bool(wide))
    places = Places(track.track, _reference(of_format.get(CAMPAIGN), declared))
    files_read = [sheet.file for sheet in (*wide, *(sheets[key] for key in sorted(sheets)))]
    description = _description(of_format.get(CAMPAIGN), declared, _name(files), files_read)
    if wide:
        return _wide(wide, sheets, declared, track, places, description)
    return _five(sheets, declared, track, places, description)


def write_imported(imported: Imported, folder: Path, *, force: bool = False) -> None:
    """Write the campaign and, beside it, the mapping file; all of it or nothing.

    Parameters
    ----------
    imported : Imported
    folder : Path
        Must not exist, or be empty.
    force : bool
        Replace the campaign that the folder holds.

    Raises
    ------
    CampaignError
        If the folder is in use.
    """
    texts = imported.draft.texts() | {FILE: mapping_text(imported.mapping)}
    write_files(texts, folder, force=force)


def _track(sheet: Sheet, declared: Mapping, *, is_wide: bool) -> TrackRead:
    writing = declared.track
    if not is_wide and declared.table.decimal is not None and writing.decimal is None:
        # Of five files that were declared to be written one way, the track is one.
        writing = writing.model_copy(update={"decimal": declared.table.decimal})
    return read_track_table(sheet, writing)


def _reference(description: Source | None, declared: Mapping) -> float | None:
    """The campaign's zero, if it has one."""
    if declared.campaign.reference_s_m is not None or description is None:
        return declared.campaign.reference_s_m
    try:
        value = tomlkit.parse(description.content.decode("utf-8-sig")).get("reference_s_m")
    except (ValueError, RecursionError):
        return None  # the check of the draft says what is wrong
    return float(value) if isinstance(value, int | float) else None


def _name(files: Files) -> str:
    """A campaign's name where none is declared: that of its first table."""
    return files.tables[0].resolve().stem if files.tables else "campaign"


def _description(source: Source | None, declared: Mapping, name: str, sheets: Sequence[str]) -> str:
    """The text of campaign.toml: as given, with what was declared otherwise."""
    own = declared.campaign.model_dump(exclude_none=True)
    if source is None:
        files = ", ".join(dict.fromkeys(sheets))
        default = {"name": name, "description": "", "source": f"Imported from {files}.", "origin": "measured"}
        return description_text(default | own)
    try:
        text = source.content.decode("utf-8-sig")
        if not own:
            return text
        document = tomlkit.parse(text)
    except (ValueError, RecursionError) as error:
        raise refuse(source.name, f"not valid TOML in UTF-8 ({str(error)[:100]}); correct it") from None
    document.update(own)
    return tomlkit.dumps(document)


def _track_columns(sheet: Sheet, track: TrackRead) -> tuple[ShownColumn, ...]:
    """The track's columns as they were understood."""
    kinds = {track.x: "track: horizontal distance x", track.z: "track: elevation z"}
    kinds |= dict.fromkeys(track.ignored, "left out")
    options = {track.x: f"--set track.x={track.x}", track.z: f"--set track.z={track.z}"}
    return tuple(
        ShownColumn(
            sheet.file,
            name,
            kinds.get(name, f"track: {name}"),
            "" if name in track.ignored else "m",
            filled(sheet, name),
            track.declared or name not in options,
            options.get(name, ""),
        )
        for name in sheet.columns
    )


def _wide(
    wide: Sequence[Sheet],
    sheets: dict[str, Sheet],
    declared: Mapping,
    track: TrackRead,
    places: Places,
    description: str,
) -> Imported:
    """Import wide tables."""
    length_m = places.track.length_m if places.track else None
    sensors = read_sensors(sheets["sensors"], declared, length_m) if "sensors" in sheets else None
    found = meanings(wide, declared, sensors)
    releases = any(one.column.is_ == "release" for columns in found for one in columns.values())
    open_ = Open()
    read = [
        read_wide_table(
            sheet, columns, declared, places, open_, section=section_of(sheet, wide), releases=releases
        )
        for sheet, columns in zip(wide, found, strict=True)
    ]
    open_.settle()
    tables = joined([tables for tables, _ in read], declared.release.s_m, open_.problems)
    open_.settle()
    draft = Draft(description, track.table, **tables)
    campaign = draft.check()
    columns = [shown for pair in zip(wide, found, strict=True) for shown in wide_columns_shown(*pair)]
    columns += _track_columns(sheets["track"], track)
    written = [how_written(sheet, notation) for sheet, (_, notation) in zip(wide, read, strict=True)]
    written.append(how_written(sheets["track"], track.notation))
    understanding = Understanding(tuple(written), tuple(columns), preview_of(draft), len(wide) > 1)
    notations = {sheet.key: notation for sheet, (_, notation) in zip(wide, read, strict=True)}
    complete = {
        sheet.key: {name: one.column for name, one in columns_.items()}
        for sheet, columns_ in zip(wide, found, strict=True)
    }
    mapping = mapping_of_wide(declared, complete, notations, track)
    return Imported(draft, campaign, understanding, mapping)


def _five(
    sheets: dict[str, Sheet], declared: Mapping, track: TrackRead, places: Places, description: str
) -> Imported:
    """Import the campaign format's own tables."""
    own = {key: sheets[key] for key in COLUMNS}
    tables, notations = read_five_files(own, declared, places)
    draft = Draft(description, track.table, **tables)
    campaign = draft.check()
    written = [how_written(sheets["track"], track.notation)]
    written += [how_written(own[key], notations[key]) for key in own]
    columns = list(_track_columns(sheets["track"], track))
    for key, sheet in own.items():
        origin = (
            {name: new for new, name in tables[key].rows[0][0].columns.items()} if tables[key].rows else {}
        )
        for name in sheet.columns:
            new = origin.get(name)
            meaning = "left out" if new is None else f"{key}: {new}{_turned(new, declared)}"
            unit = new.rpartition("_")[2] if new is not None and new.endswith(("_m", "_m_s")) else ""
            columns.append(ShownColumn(sheet.file, name, meaning, unit, filled(sheet, name), True))
    understanding = Understanding(tuple(written), tuple(columns), preview_of(draft))
    mapping = mapping_of_five(declared, notations["recordings"], track)
    return Imported(draft, campaign, understanding, mapping)


def _turned(column: str, declared: Mapping) -> str:
    """In words, how a column of the format is given otherwise than the format has it."""
    said = []
    if column == "value":
        if declared.velocity.unit == "km/h":
            said.append("velocities in km/h")
        if declared.runout.unit == "km":
            said.append("runouts in km")
        if declared.runout.place not in (None, "s"):
            said.append(f"runouts as {declared.runout.place}")
    elif column in ("s_from_m", "s_to_m") and declared.velocity.place not in (None, "s"):
        said.append(f"as {declared.velocity.place}")
    elif column == "release_s_m" and declared.release.place not in (None, "s"):
        said.append(f"as {declared.release.place}")
    return f", {', '.join(said)}" if said else ""
