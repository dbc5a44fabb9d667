"""A line from a file of the map: a shapefile, GeoJSON, GeoPackage or GPX."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from skred.campaign.problems import shown
from skred.errors import InputError
from skred.tracks.features import Feature, read_features
from skred.tracks.plan import Plan, plan_of

MOST_VERTICES = 1_000_000
_LISTED = 20


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
