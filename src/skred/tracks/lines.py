"""A line from a file of the map: a shapefile, GeoJSON, GeoPackage or GPX."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from skred.campaign.problems import shown
from skred.errors import InputError
from skred.tracks.plan import Plan, plan_of

if TYPE_CHECKING:
    from pyproj import CRS

SUFFIXES = (".shp", ".geojson", ".json", ".gpkg", ".gpx")
"""What is read, by the end of the file's name."""
MOST_FEATURES = 1000
MOST_VERTICES = 1_000_000
_LISTED = 20


@dataclass(frozen=True, eq=False)
class Feature:
    """One thing on a map.

    Attributes
    ----------
    file : Path
    layer : str
        The file's layer that it is in.
    number : int
        Its number there, from 0; in a GeoPackage its key, mostly from 1.
    name : str
        What the file calls it; empty where it has no name.
    geometry : shapely geometry
    crs : pyproj.CRS or None
        None where the file does not say.
    """

    file: Path
    layer: str
    number: int
    name: str
    geometry: Any
    crs: CRS | None

    @property
    def label(self) -> str:
        """How messages speak of it."""
        return f"feature {self.number}" + (f" ({shown(self.name, 40)})" if self.name else "")


@dataclass(frozen=True, eq=False)
class MapLine:
    """A line as its file has it.

    Attributes
    ----------
    feature : Feature
    plan : Plan
        Its vertices, in the units of the feature's `crs`.
    has_heights : bool
        Whether the file gives heights, which are not used.
    """

    feature: Feature
    plan: Plan
    has_heights: bool


def read_line(file: Path, layer: str | None = None, feature: str | None = None) -> MapLine:
    """Read a line.

    Parameters
    ----------
    file : Path
    layer : str, optional
        Needed where several layers hold lines.
    feature : str, optional
        Number or name; needed where the layer holds several lines.

    Raises
    ------
    InputError
        If there is no line or it is not clear which; the message lists all.
    """
    lines = [one for one in read_features(file, layer) if "LineString" in one.geometry.geom_type]
    lines = [one for one in lines if one.geometry.length > 0]
    if not lines:
        raise InputError(f"{file}: holds no line; draw one along the track, from top to bottom")
    return _as_line(_chosen(file, lines, layer, feature))


def read_features(file: Path, layer: str | None = None) -> list[Feature]:
    """Everything with a geometry in a file.

    Parameters
    ----------
    file : Path
    layer : str, optional
        By default all layers; of a GPX file its tracks and routes.

    Raises
    ------
    InputError
        If it cannot be read, has no such layer or holds too much.
    """
    import pyogrio
    from pyogrio.errors import DataLayerError, DataSourceError

    if file.suffix.lower() not in SUFFIXES:
        raise InputError(f"{file}: expected a line as {', '.join(SUFFIXES)}; export it as one of these")
    if not file.is_file():
        raise InputError(f"{file}: there is no such file; give a line as {', '.join(SUFFIXES)}")
    try:
        layers = [str(name) for name, kind in pyogrio.list_layers(file) if kind is not None]
        if layer is not None and layer not in layers:
            raise InputError(
                f"--layer {layer}: {file} holds {', '.join(map(shown, layers))}; choose one of these"
            )
        if file.suffix.lower() == ".gpx" and layer is None:
            layers = [name for name in layers if name in ("tracks", "routes")]
        return [one for name in layers if layer in (None, name) for one in _layer(file, name)]
    except (DataSourceError, DataLayerError) as error:
        raise InputError(f"{file}: cannot be read ({shown(str(error), 200)}); export it again") from error


def _layer(file: Path, layer: str) -> list[Feature]:
    """Everything with a geometry in a layer."""
    import pyogrio
    import shapely
    from pyproj import CRS

    meta, numbers, shapes, columns = pyogrio.raw.read(
        file, layer=layer, max_features=MOST_FEATURES + 1, return_fids=True
    )
    if len(numbers) > MOST_FEATURES:
        raise InputError(
            f"{file}, layer {shown(layer)}: more than {MOST_FEATURES} features; export the one line"
        )
    crs = CRS.from_user_input(meta["crs"]) if meta["crs"] else None
    names = _names(meta["fields"], columns, len(numbers))
    found = []
    for number, shape, name in zip(numbers.tolist(), shapes, names, strict=True):
        if shape is not None:
            found.append(Feature(file, layer, int(number), name, shapely.from_wkb(shape), crs))
    return found


def _names(fields: Sequence[str], columns: Sequence[Any], n: int) -> list[str]:
    """What features are called: the column `name` in any case."""
    for field, column in zip(fields, columns, strict=True):
        if str(field).lower() == "name":
            return ["" if value is None or value != value else str(value) for value in column]
    return [""] * n


def _chosen(file: Path, lines: list[Feature], layer: str | None, feature: str | None) -> Feature:
    """The one line that is meant."""
    layers = list(dict.fromkeys(one.layer for one in lines))
    if layer is None and len(layers) > 1:
        raise InputError(
            f"{file}: lines in the layers {', '.join(map(shown, layers))}; choose one by --layer"
        )
    wanted = lines if feature is None else [one for one in lines if feature in (str(one.number), one.name)]
    if len(wanted) == 1:
        return wanted[0]
    rows = [f"{one.label}, {len(_coordinates(one))} points" for one in lines[:_LISTED]]
    more = [f"and {len(lines) - _LISTED} more"] if len(lines) > _LISTED else []
    listed = "".join(f"\n  {row}" for row in rows + more)
    what = (
        "several lines" if feature is None else f"{len(wanted) or 'no'} lines of --feature {shown(feature)}"
    )
    raise InputError(f"{file}: {what}; choose one by --feature, its number or its name:{listed}")


def _coordinates(feature: Feature) -> Any:
    import shapely

    return shapely.get_coordinates(feature.geometry)


def _as_line(feature: Feature) -> MapLine:
    """The vertices of a feature, its parts joined."""
    import shapely

    line = shapely.line_merge(feature.geometry)
    where = f"{feature.file}, {feature.label}"
    if line.geom_type != "LineString":
        n = len(shapely.get_parts(line))
        raise InputError(f"{where}: has {n} parts that do not meet end to end; join them to one line")
    points = shapely.get_coordinates(line)
    if len(points) > MOST_VERTICES:
        raise InputError(f"{where}: has {len(points)} points, at most {MOST_VERTICES} are read; simplify it")
    if not np.all(np.isfinite(points)):
        raise InputError(f"{where}: has points without coordinates; draw it again")
    return MapLine(feature, plan_of(points[:, 0], points[:, 1]), bool(feature.geometry.has_z))
