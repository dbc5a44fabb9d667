"""An AvaFrame ``Inputs`` folder as it is: a terrain model, ``LINES``, ``REL``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from skred.errors import InputError
from skred.tracks.elevations import DRIVERS


@dataclass(frozen=True)
class AvaframeInputs:
    """What of an ``Inputs`` folder a track is made from.

    Attributes
    ----------
    dem, line : Path
    releases : tuple of Path
        Shapefiles of release areas or points; often none.
    """

    dem: Path
    line: Path
    releases: tuple[Path, ...]


def find_inputs(folder: Path, dem: Path | None = None, line: Path | None = None) -> AvaframeInputs:
    """Find terrain model, line and release areas.

    Parameters
    ----------
    folder : Path
        ``Inputs``, or the avalanche's folder that it is in.
    dem, line : Path, optional
        Taken instead of what the folder holds.

    Raises
    ------
    InputError
        If a part is missing, or it is not clear which one is meant.
    """
    if not folder.is_dir():
        raise InputError(f"--avaframe {folder}: no such folder; give an Inputs folder of AvaFrame")
    if (folder / "Inputs").is_dir():
        folder = folder / "Inputs"
    rasters = _files(folder, tuple(DRIVERS))
    lines = [*_files(folder / "LINES", (".shp",)), *_files(folder / "PROFILE", (".shp",))]
    releases = tuple(_files(folder / "REL", (".shp",)))
    return AvaframeInputs(
        dem or _only(folder, rasters, "terrain model (.asc or .tif)", "--dem"),
        line or _only(folder, lines, "shapefile in LINES or PROFILE", "--line"),
        releases,
    )


def _files(folder: Path, suffixes: tuple[str, ...]) -> list[Path]:
    """Files of a folder by the end of their names; none where there is no folder."""
    if not folder.is_dir():
        return []
    return sorted(one for one in folder.iterdir() if one.suffix.lower() in suffixes and one.is_file())


def _only(folder: Path, found: list[Path], what: str, option: str) -> Path:
    """The one file there is."""
    if len(found) == 1:
        return found[0]
    if not found:
        raise InputError(f"--avaframe {folder}: no {what}; put one there, or give it by {option}")
    listed = "".join(f"\n  {option} {one}" for one in found[:20])
    raise InputError(f"--avaframe {folder}: {len(found)} times a {what}; choose one:{listed}")
