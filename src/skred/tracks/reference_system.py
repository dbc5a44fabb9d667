"""Reference systems: the line is brought into that of the terrain model, which must measure metres."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from skred.arrays import FloatArray
from skred.campaign.problems import shown
from skred.errors import InputError
from skred.tracks.elevations import Elevations
from skred.tracks.plan import Plan, plan_of

if TYPE_CHECKING:
    from pyproj import CRS, Transformer

    from skred.tracks.lines import MapLine

_SMALLEST_CELL_M = 0.02
"""Terrain models of avalanche paths have larger cells, if they are in metres."""
LARGEST_SCALE_ERROR = 0.01
"""A map that stretches lengths by more is refused: slopes would be off by as much."""


def given_reference_system(text: str) -> CRS:
    """A reference system by its name on the command line.

    Raises
    ------
    InputError
        If there is none of that name.
    """
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    try:
        return CRS.from_user_input(text)
    except CRSError as error:
        raise InputError(f"--crs {shown(text)}: no reference system; give one as EPSG:32632") from error


def in_the_terrains(
    line: MapLine, elevations: Elevations, given: CRS | None
) -> tuple[Plan, CRS | None, list[str]]:
    """The line in the terrain model's reference system.

    Parameters
    ----------
    line : MapLine
    elevations : Elevations
    given : pyproj.CRS or None
        The terrain model's, where its file does not say.

    Returns
    -------
    Plan
        The line, in metres.
    pyproj.CRS or None
        The reference system; None where neither file says.
    list of str
        What was assumed or done, for people.

    Raises
    ------
    InputError
        If the two cannot be brought together, or the map does not measure metres.
    """
    terrain, of_line, notices = elevations.crs, line.feature.crs, []
    if terrain is not None and given is not None and not _same(terrain, given):
        raise InputError(
            f"--crs {named(given)}: {elevations.file} says that it is in {named(terrain)}; leave --crs away, "
            "or correct the file"
        )
    if terrain is None:
        terrain = given if given is not None else _assumed(line, elevations)
        if terrain is not None and given is None:
            notices.append(
                f"{elevations.file.name} has no reference system: taken to be in that of the line, "
                f"{named(terrain)}"
            )
    if terrain is None:
        _require_no_degrees(elevations)
        _require_on_the_raster(line, elevations, None)
        notices.append("neither file has a reference system: taken to be in the same one, in metres")
        return line.plan, None, notices
    plan = _require_on_the_raster(line, elevations, terrain)
    if of_line is None:
        notices.append(
            f"{line.feature.file.name} has no reference system: taken to be in that of the terrain, "
            f"{named(terrain)}"
        )
    elif not _same(of_line, terrain):
        known = _known_to(line.plan, of_line, terrain)
        notices.append(f"line brought from {named(of_line)} into the terrain's {named(terrain)}{known}")
    _require_metres(terrain, plan, elevations)
    return plan, terrain, notices


def _require_no_degrees(elevations: Elevations) -> None:
    """Refuse a terrain model that does not say so, but is in longitude and latitude by its looks."""
    left, low, right, high = elevations.bounds
    if -360 <= left <= right <= 360 and -90 <= low <= high <= 90 and elevations.cell_m < _SMALLEST_CELL_M:
        raise InputError(
            f"{elevations.file}: has no reference system; its cells of {elevations.cell_m:.3g} are degrees, "
            "by their looks: --crs EPSG:4326 tells how to bring it into a map in metres"
        )


def transformed(x: FloatArray, y: FloatArray, source: CRS, target: CRS) -> tuple[FloatArray, FloatArray]:
    """Coordinates in another reference system; infinite where they have none there.

    Raises
    ------
    InputError
        If no way leads from the one to the other.
    """
    return _transformer(source, target).transform(x, y)


def _transformer(source: CRS, target: CRS) -> Transformer:
    from pyproj import Transformer
    from pyproj.exceptions import ProjError

    try:
        return Transformer.from_crs(source, target, always_xy=True)
    except ProjError as error:
        raise InputError(
            f"coordinates cannot be brought from {named(source)} into {named(target)} "
            f"({shown(str(error), 200)}); bring line and terrain into the same reference system"
        ) from error


def _known_to(plan: Plan, source: CRS, target: CRS) -> str:
    """How well the relation of two reference systems is known, in words; nothing where that is exact."""
    transformer = _transformer(source, target)
    transformer.transform(plan.x[0], plan.y[0])
    used = transformer.get_last_used_operation()
    if "ballpark" in used.description.lower():
        return ", without the shift between their data: it may be off by 100 m, so look at it on a map"
    return f", known to {used.accuracy:g} m" if used.accuracy > 0 else ""


def named(crs: CRS) -> str:
    """A reference system for people: its code where it has one, and its name."""
    authority = crs.to_authority(min_confidence=100)
    name = shown(crs.name, 50)
    return f"{':'.join(authority)} ({name})" if authority else name


def _same(one: CRS, other: CRS) -> bool:
    return bool(_horizontal(one).equals(_horizontal(other), ignore_axis_order=True))


def _horizontal(crs: CRS) -> CRS:
    """Without a vertical reference system."""
    return crs.sub_crs_list[0] if crs.is_compound else crs


def _assumed(line: MapLine, elevations: Elevations) -> CRS | None:
    """The line's reference system for a terrain model without one, if that can be."""
    crs = line.feature.crs
    if crs is not None and not _horizontal(crs).is_projected:
        raise InputError(
            f"{elevations.file} has no reference system, and {line.feature.file.name} is in {named(crs)}; "
            "say which one the terrain is in, such as --crs EPSG:32632"
        )
    return crs


def _require_on_the_raster(line: MapLine, elevations: Elevations, terrain: CRS | None) -> Plan:
    """The line in the terrain's reference system, with a point on the raster at least.

    Before anything is said of the terrain: a line in the wrong place says nothing about it.
    """
    file, source, given = line.feature.file, line.feature.crs, line.plan
    plan = _placed(given, source, terrain)
    if plan is not None and elevations.contains(plan.x, plan.y).any():
        return plan
    at, moved = _first_point(given), source is not None and terrain is not None and not _same(source, terrain)
    turned = _placed(Plan(given.y, given.x), source, terrain)
    geographic = source is not None and _horizontal(source).is_geographic
    if turned is not None and elevations.contains(turned.x, turned.y).any():
        what = "longitude and latitude" if geographic else "easting and northing"
        raise InputError(
            f"{file}: {what} of the line are exchanged: {at} lies off the raster {elevations.file.name}, and "
            "the other way round on it; export the line again, with the easting or the longitude first"
        )
    if geographic and moved and not _on_the_globe(given):
        raise InputError(
            f"{file}: coordinates such as {at} are no longitude and latitude, which the file "
            "says they are; export the line with its reference system, for example as .gpkg"
        )
    if plan is None:
        assert source is not None and terrain is not None
        raise InputError(f"{file}: {at} in {named(source)} has no place in {named(terrain)}")
    there = f", in the terrain's reference system {_first_point(plan, '.1f')}" if moved else ""
    left, low, right, high = elevations.bounds
    raise InputError(
        f"{file}: the line lies off the raster: its first point is {at}{there}; "
        f"{elevations.file.name} covers x {left:.10g} to {right:.10g}, y {low:.10g} to {high:.10g}. Give the "
        "line that belongs to this terrain, or correct its coordinates or its reference system"
    )


def _placed(plan: Plan, source: CRS | None, terrain: CRS | None) -> Plan | None:
    """Vertices in another reference system; None where they have no place there."""
    if source is None or terrain is None or _same(source, terrain):
        return plan
    if _horizontal(source).is_geographic and not _on_the_globe(plan):
        return None
    x, y = transformed(plan.x, plan.y, source, terrain)
    return plan_of(x, y) if np.all(np.isfinite(x)) and np.all(np.isfinite(y)) else None


def _on_the_globe(plan: Plan) -> bool:
    """Whether coordinates can be longitude and latitude."""
    return bool(np.abs(plan.x).max() <= 360 and np.abs(plan.y).max() <= 90)


def _first_point(plan: Plan, form: str = ".10g") -> str:
    return f"({plan.x[0]:{form}}, {plan.y[0]:{form}})"


def _require_metres(terrain: CRS, plan: Plan, elevations: Elevations) -> None:
    """Refuse a map on which a metre is not a metre."""
    from pyproj import Proj

    flat = _horizontal(terrain)
    what = None
    if not flat.is_projected:
        what = "which measures degrees"
    elif any(abs(axis.unit_conversion_factor - 1.0) > 1e-9 for axis in flat.axis_info[:2]):
        what = f"which measures {flat.axis_info[0].unit_name}"
    longitude, latitude = _geographic(plan, flat)
    if what is None and np.isfinite(longitude):
        factors = Proj(flat).get_factors(longitude, latitude)
        stretch = max(abs(scale - 1.0) for scale in (factors.meridional_scale, factors.parallel_scale))
        if stretch > LARGEST_SCALE_ERROR:
            what = f"whose map stretches lengths by {100 * stretch:.0f} % here"
    if what is None:
        return
    target = f"EPSG:{_utm(longitude, latitude)}" if np.isfinite(longitude) else "a UTM zone"
    new = f"{elevations.file.stem}-utm.tif"
    raise InputError(
        f"{elevations.file}: is in {named(terrain)}, {what}; slopes would be wrong. Bring it into a map in "
        "metres:\n"
        f"  rio warp {elevations.file} {new} --dst-crs {target} --resampling bilinear"
    )


def _geographic(plan: Plan, crs: CRS) -> tuple[float, float]:
    """Longitude and latitude of the middle of the line [degrees]."""
    from pyproj import CRS

    middle = len(plan.x) // 2
    x, y = transformed(plan.x[middle], plan.y[middle], crs, CRS.from_epsg(4326))
    return float(x), float(y)


def _utm(longitude: float, latitude: float) -> int:
    """EPSG code of the UTM zone, WGS 84."""
    zone = int((longitude + 180.0) // 6.0) % 60 + 1
    return (32600 if latitude >= 0 else 32700) + zone


def moved_into(geometry: Any, source: CRS | None, target: CRS | None) -> Any:
    """A shape in another reference system; as it is where one of the two is not known."""
    import shapely

    if source is None or target is None or _same(source, target):
        return geometry

    def move(points: FloatArray) -> FloatArray:
        return np.column_stack(transformed(points[:, 0], points[:, 1], source, target))

    return shapely.transform(geometry, move)
