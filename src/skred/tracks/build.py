"""A track from a terrain model and a line: the steps, one after the other."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from skred.physics.terrain import build_terrain, default_smoothing
from skred.tracks.elevations import Elevations, open_elevations
from skred.tracks.fall_line import FallLine, fall_line, turn_notice
from skred.tracks.lines import read_line
from skred.tracks.plan import Plan
from skred.tracks.profile import (
    Shape,
    goes_uphill,
    require_ground,
    rise_notice,
    sampled,
    shape,
    short_notice,
    smoothed,
    smoothed_twice_as_m,
)
from skred.tracks.provenance import of_file, of_skred
from skred.tracks.reference_system import given_reference_system, in_the_terrains, named
from skred.tracks.releases import releases_on

if TYPE_CHECKING:
    from pyproj import CRS

    from skred.tracks.lines import MapLine

FORMAT = 1
SMOOTHING_WRITTEN_M = 5.0
"""Smoothing of what is written [m].

Commands that read a track smooth it by 10 m themselves. Both together are as once by 11.2 m: what is taken
away here is what a raster's steps and a line drawn by hand add, and nearly nothing else.
"""
DECIMALS = 4
"""Of lengths in metres, as written."""


@dataclass(frozen=True)
class Wanted:
    """What a track is to be made from, and how.

    Attributes
    ----------
    dem, line : Path
    layer, feature : str or None
        Which line, where the file holds several.
    crs : str or None
        Reference system of the terrain model, where its file does not say.
    step_m : float or None
        Largest horizontal distance between points [m]; by default the side of a cell.
    smoothing_m : float
        Smoothing length [m]; 0 for none.
    extend_m : float
        Horizontal length to go on along the fall line [m].
    releases : tuple of Path
        Shapefiles of release areas or points.
    """

    dem: Path
    line: Path
    layer: str | None = None
    feature: str | None = None
    crs: str | None = None
    step_m: float | None = None
    smoothing_m: float = SMOOTHING_WRITTEN_M
    extend_m: float = 0.0
    releases: tuple[Path, ...] = ()


def make_track(wanted: Wanted) -> dict[str, Any]:
    """Make a track.

    Parameters
    ----------
    wanted : Wanted

    Returns
    -------
    dict
        The content of the document beside ``track.csv``. Its ``profile`` has, for each point, the arc
        length ``s_m`` and horizontal distance ``x_m``, the elevation ``z_m`` as written, ``z_sampled_m`` as
        in the terrain model and ``z_read_m`` as commands smooth it when they read it, and ``east_m`` and
        ``north_m`` on the map.

    Raises
    ------
    InputError
        If terrain and line do not make a track; the message says what to do.
    """
    given = given_reference_system(wanted.crs) if wanted.crs is not None else None
    line = read_line(wanted.line, wanted.layer, wanted.feature)
    with open_elevations(wanted.dem) as elevations:
        plan, crs, notices = in_the_terrains(line, elevations, given)
        if line.has_heights:
            notices.append("heights that the line has itself are not used")
        step = wanted.step_m or elevations.cell_m
        z = sampled(elevations, plan.resampled(step)[1])
        turned = goes_uphill(z)
        if turned:
            plan = plan.turned()
            notices.append(f"the line goes uphill, from {z[0]:.0f} to {z[-1]:.0f} m: turned")
        drawn_m = plan.length
        extension = _extension(elevations, plan, wanted.extend_m)
        if extension is not None:
            notices += turn_notice(plan, extension.plan, elevations.cell_m)
            plan = plan.then(extension.plan)
        along, points = plan.resampled(step)
        z = sampled(elevations, points)
        require_ground(elevations, along, points, z, wanted.smoothing_m)
        profile = _profile(along, points, z, wanted.smoothing_m)
        s_m = np.array(profile["s_m"])
        notices += [*rise_notice(s_m, z), *short_notice(float(s_m[-1]))]
        return {
            "format": FORMAT,
            "skred": of_skred(),
            "terrain": _terrain(elevations, crs),
            "line": _line(line, turned=turned, length_m=drawn_m),
            "step_m": float(along[1]),
            "extension": _of_extension(
                extension, wanted.extend_m, float(np.interp(drawn_m, along, s_m)), s_m
            ),
            "smoothing": _smoothing(profile, wanted.smoothing_m),
            "releases": releases_on(points, s_m, crs, wanted.releases),
            "notices": notices,
            "profile": profile,
        }


def _extension(elevations: Elevations, plan: Plan, length_m: float) -> FallLine | None:
    if length_m == 0.0:
        return None
    return fall_line(elevations, float(plan.x[-1]), float(plan.y[-1]), length_m, elevations.cell_m)


def _profile(along: Any, points: Plan, z: Any, smoothing_m: float) -> dict[str, list[float]]:
    """The track's points as they are written, rounded."""
    x_m = np.round(along, DECIMALS)
    z_m = np.round(smoothed(along, z, smoothing_m), DECIMALS)
    s_m = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x_m), np.diff(z_m)))])
    columns = {
        "s_m": s_m,
        "x_m": x_m,
        "z_m": z_m,
        "z_sampled_m": z,
        "z_read_m": smoothed(s_m, z_m, default_smoothing(s_m[-1])),
        "east_m": points.x,
        "north_m": points.y,
    }
    return {name: np.round(values, DECIMALS).tolist() for name, values in columns.items()}


def _terrain(elevations: Elevations, crs: CRS | None) -> dict[str, Any]:
    return {
        **of_file(elevations.file),
        "cell_m": elevations.cell_m,
        "reference_system": None if crs is None else named(crs),
        "reference_system_wkt": None if crs is None else crs.to_wkt(),
    }


def _line(line: MapLine, *, turned: bool, length_m: float) -> dict[str, Any]:
    feature = line.feature
    return {
        **of_file(feature.file),
        "layer": feature.layer,
        "feature": feature.number,
        "name": feature.name,
        "reference_system": None if feature.crs is None else named(feature.crs),
        "vertices": len(line.plan.x),
        "horizontal_length_m": length_m,
        "turned": turned,
    }


def _of_extension(
    extension: FallLine | None, asked_m: float, s_from_m: float, s_m: Any
) -> dict[str, Any] | None:
    if extension is None:
        return None
    return {
        "asked_m": asked_m,
        "horizontal_length_m": extension.plan.length,
        "s_from_m": s_from_m,
        "s_to_m": float(s_m[-1]),
        "stopped": extension.stopped,
    }


def _smoothing(profile: dict[str, list[float]], smoothing_m: float) -> dict[str, Any]:
    """What smoothing changed, here and once more in the commands that read the track."""
    x, written, before = (np.array(profile[name]) for name in ("x_m", "z_m", "z_sampled_m"))
    terrain = build_terrain(x, written)
    fallen, slopes = terrain.sin_slope * np.diff(terrain.edge_s_m), np.degrees(terrain.slope_rad)
    steepest, uphill = float(slopes.max()), float(max(0.0, -slopes.min()))
    return {
        "smoothing_m": smoothing_m,
        "smoothing_of_commands_m": terrain.smoothing_m,
        "sampled": asdict(shape(x, before)),
        "written": asdict(shape(x, written)),
        "as_read": asdict(Shape(float(fallen.sum()), terrain.length_m, steepest, uphill)),
        "largest_shift_m": float(np.abs(written - before).max()),
        "with_the_commands_m": smoothed_twice_as_m(smoothing_m, terrain.smoothing_m),
    }
