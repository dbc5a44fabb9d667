"""Where release areas and points lie on a track."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from skred.arrays import FloatArray
from skred.campaign.problems import shown
from skred.tracks.features import Feature, read_features
from skred.tracks.plan import Plan
from skred.tracks.reference_system import moved_into

if TYPE_CHECKING:
    from pyproj import CRS


def releases_on(plan: Plan, s_m: FloatArray, crs: CRS | None, files: Iterable[Path]) -> list[dict[str, Any]]:
    """Release areas and points, placed along the track.

    Parameters
    ----------
    plan : Plan
        The points of the track.
    s_m : (n,) array, m
        Arc length at each.
    crs : pyproj.CRS or None
        Of the plan.
    files : iterable of Path
        Shapefiles of polygons or points.

    Returns
    -------
    list of dict
        For each feature its ``file`` and ``name``; ``s_from_m`` and ``s_to_m`` of the part of the track
        inside of an area, or, for a point, of the nearest place twice; ``distance_m`` from the track. Both
        places are None for an area that the track does not cross.

    Raises
    ------
    InputError
        If a file cannot be read.
    """
    return [_placed(one, plan, s_m, crs) for file in files for one in read_features(file)]


def _placed(feature: Feature, plan: Plan, s_m: FloatArray, crs: CRS | None) -> dict[str, Any]:
    import shapely

    shape = shapely.make_valid(moved_into(feature.geometry, feature.crs, crs))
    track = shapely.LineString(np.column_stack([plan.x, plan.y]))
    distance = float(shapely.distance(shape, track))
    where: list[float] = []
    if shape.geom_type in ("Point", "MultiPoint"):
        where = [float(shapely.line_locate_point(track, shapely.get_parts(shape)[0]))]
    elif distance == 0.0:
        inside = shapely.get_coordinates(shapely.intersection(shape, track))
        where = [float(shapely.line_locate_point(track, shapely.Point(point))) for point in inside]
    places = np.interp([min(where), max(where)], plan.along, s_m).tolist() if where else [None, None]
    return {
        "file": feature.file.name,
        "name": feature.name,
        "s_from_m": places[0],
        "s_to_m": places[1],
        "distance_m": distance,
    }


def release_sentences(releases: Iterable[dict[str, Any]]) -> Iterator[str]:
    """Where releases lie on the track, for people.

    Parameters
    ----------
    releases : iterable of dict
        As `releases_on` returns them.
    """
    for one in releases:
        what = f"Release {shown(one['file'])}" + (f" ({shown(one['name'])})" if one["name"] else "")
        s_from, s_to, distance = one["s_from_m"], one["s_to_m"], one["distance_m"]
        if s_to is None:
            yield f"{what}: the track does not cross it, {distance:.0f} m away."
        elif s_from == s_to:
            yield f"{what}: s = {s_to:.0f} m, {distance:.0f} m beside the track; --release {s_to:.0f}."
        else:
            start = f"its lower end is where fronts start, --release {s_to:.0f}"
            yield f"{what}: s = {s_from:.0f} to {s_to:.0f} m; {start}."
