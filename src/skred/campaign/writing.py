"""Write a campaign so that a folder holds all of it or none of it."""

import csv
import io
import json
import math
import shutil
import uuid
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from skred.campaign.problems import CampaignError, Problem
from skred.campaign.reading import read_campaign
from skred.campaign.records import Campaign, Covariate, Status

Cell = Covariate
_FILES = ("campaign.toml", "track.csv", "sensors.csv", "events.csv", "recordings.csv")


def write_campaign(campaign: Campaign, folder: Path, *, force: bool = False) -> None:
    """Write a campaign as a folder of five files.

    The files are written to a temporary folder beside the target, read back and compared, and only then
    moved into place, so what is written can be read. Numbers round-trip exactly. Every event has a row for
    every sensor, also where the reading is missing: a gap is seen to be meant.

    Parameters
    ----------
    campaign : Campaign
        What to write.
    folder : Path
        Where to; must not exist, or be empty.
    force : bool
        Replace the campaign that the folder holds. Other files in it are kept.

    Raises
    ------
    CampaignError
        Where the campaign breaks a rule of the format or the folder is in use.
    """

    def check(temporary: Path) -> None:
        if read_campaign(temporary).fingerprint() != campaign.fingerprint():
            message = "the campaign would not be read back as it is; remove blanks around texts"
            raise CampaignError([Problem(str(folder), None, None, None, message)])

    write_files(dict(zip(_FILES, _texts(campaign), strict=True)), folder, force=force, check=check)


def write_files(
    texts: Mapping[str, str],
    folder: Path,
    *,
    force: bool = False,
    check: Callable[[Path], None] | None = None,
) -> None:
    """Write the texts of a campaign's files, and of files beside them, all at once.

    Parameters
    ----------
    texts : mapping
        From names of files to texts; `write_campaign` makes those of a campaign.
    folder : Path
        Where to; must not exist, or be empty.
    force : bool
        Replace the campaign that the folder holds. Other files in it are kept.
    check : callable, optional
        Looks at the folder with the files before it is moved into place; what it raises leaves all as it was.

    Raises
    ------
    CampaignError
        Where the folder is in use.
    """
    target = Path(folder).resolve()
    require_free(target, force)
    made = [parent for parent in target.parents if not parent.exists()]
    temporary = target.parent / f".{target.name[:100]}.{uuid.uuid4().hex}"
    try:
        temporary.mkdir(parents=True)
        for file, text in texts.items():
            (temporary / file).write_bytes(text.encode("utf-8", "backslashreplace"))
        if check is not None:
            check(temporary)
        _move_into_place(temporary, target)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
        if not target.exists():
            with suppress(OSError):  # of these, those that are empty
                for parent in made:
                    parent.rmdir()


def require_free(target: Path, force: bool) -> None:
    """Refuse to write over what is there, unless it is a campaign and that is wanted.

    Parameters
    ----------
    target : Path
        Where a campaign is to go.
    force : bool
        Whether it may replace another.

    Raises
    ------
    CampaignError
        Where it must not.
    """
    if not target.exists() or (target.is_dir() and not any(target.iterdir())):
        return
    if not (target / "campaign.toml").is_file():
        message = "something other than a campaign is there; choose another folder"
    elif not force:
        message = "a campaign is there already; choose another folder, or replace it with --force"
    else:
        return
    raise CampaignError([Problem(str(target), None, None, None, message)])


def _move_into_place(temporary: Path, target: Path) -> None:
    """Put the finished folder where it belongs; the old one stands until then."""
    if not target.exists():
        temporary.rename(target)
        return
    for entry in target.iterdir():
        if entry.name not in _FILES and not (temporary / entry.name).exists():
            _copy(entry, temporary / entry.name)
    replaced = temporary.with_name(temporary.name + ".old")
    target.rename(replaced)
    try:
        temporary.rename(target)
    except OSError:
        replaced.rename(target)
        raise
    shutil.rmtree(replaced)


def _copy(entry: Path, copy: Path) -> None:
    """Copy a file, folder or link as it is."""
    if entry.is_dir() and not entry.is_symlink():
        shutil.copytree(entry, copy, symlinks=True)
    else:
        shutil.copy2(entry, copy, follow_symlinks=False)


def _texts(campaign: Campaign) -> tuple[str, ...]:
    """Return the texts of the five files."""
    return (
        _description(campaign),
        _track(campaign),
        _sensors(campaign),
        _events(campaign),
        _recordings(campaign),
    )


def _description(campaign: Campaign) -> str:
    """Return the text of campaign.toml."""
    lines = ["format = 1"]
    for key in ("name", "description", "source", "origin"):
        # A JSON string is a TOML string too, as long as characters outside ASCII stay as they are.
        lines.append(f"{key} = {json.dumps(getattr(campaign, key), ensure_ascii=False)}")
    if campaign.reference_s_m is not None:
        lines.append(f"reference_s_m = {float(campaign.reference_s_m)!r}")
    return "\n".join(lines) + "\n"


def _track(campaign: Campaign) -> str:
    """Return the text of track.csv."""
    track = campaign.track
    columns = {"x_m": track.x_m, "z_m": track.z_m}
    if track.width_m is not None:
        columns["width_m"] = track.width_m
    return _table(list(columns), zip(*(values.tolist() for values in columns.values()), strict=True))


def _sensors(campaign: Campaign) -> str:
    """Return the text of sensors.csv."""
    header = ["sensor", "quantity", "s_from_m", "s_to_m", "relative_sd", "absolute_sd"]
    rows: list[tuple[Cell, ...]] = [
        (s.id, s.quantity, s.s_from_m, s.s_to_m, s.relative_sd, s.absolute_sd) for s in campaign.sensors
    ]
    if any(sensor.place_sd_m is not None for sensor in campaign.sensors):
        header.append("place_sd_m")
        rows = [(*row, s.place_sd_m) for row, s in zip(rows, campaign.sensors, strict=True)]
    return _table(header, rows)


def _events(campaign: Campaign) -> str:
    """Return the text of events.csv."""
    covariates = list(dict.fromkeys(name for event in campaign.events for name in event.covariates))
    optional = ("release_sd_m", "release_speed_m_s", "release_speed_sd_m_s")
    used = [name for name in optional if any(getattr(event, name) is not None for event in campaign.events)]
    rows: list[tuple[Cell, ...]] = [
        (
            event.id,
            event.release_s_m,
            *(getattr(event, name) for name in used),
            *(event.covariates.get(name) for name in covariates),
        )
        for event in campaign.events
    ]
    return _table(["event", "release_s_m", *used, *covariates], rows)


def _recordings(campaign: Campaign) -> str:
    """Return the text of recordings.csv."""
    numbers = {"value": campaign.values, "value_to": campaign.values_to, "sd": campaign.stated_sd}
    used = {name: array for name, array in numbers.items() if name == "value" or np.isfinite(array).any()}
    rows: list[tuple[Cell, ...]] = []
    for i, event_id in enumerate(campaign.event_ids):
        for j, sensor_id in enumerate(campaign.sensor_ids):
            status = Status(campaign.status[i, j]).name.lower()
            rows.append((event_id, sensor_id, *(float(array[i, j]) for array in used.values()), status))
    return _table(["event", "sensor", *used, "status"], rows)


def _table(header: Sequence[str], rows: Iterable[Sequence[Cell]]) -> str:
    """Return a table as text, numbers with all the digits that tell them apart."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows([_cell(value) for value in row] for row in rows)
    return text.getvalue()


def _cell(value: Cell) -> str:
    """Return a value as the text of a cell; nothing for None and NaN."""
    if value is None or isinstance(value, str):
        return value or ""
    return "" if math.isnan(value) else repr(float(value))
