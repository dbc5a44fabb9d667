"""Tracks and routes of a GPX file, read without GDAL.

GDAL chooses what reads an XML file by words that it finds in it. A file that calls itself GPX could so be
read as something that leads to other files or to the network.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from skred.errors import InputError

LAYERS = {"tracks": ("trk", "trkseg", "trkpt"), "routes": ("rte", None, "rtept")}
"""What makes a line in each layer: element, its parts where it has some, and points."""
MOST_BYTES = 100_000_000
_EXPORT = "expected a GPX file with tracks or routes; export it again"


class GpxLine(NamedTuple):
    """A track or a route, its number in its layer, and its shape in longitude and latitude."""

    layer: str
    number: int
    name: str
    geometry: Any


def gpx_lines(file: Path) -> list[GpxLine]:
    """All tracks and routes of a file; those without two points are left out.

    Raises
    ------
    InputError
        If it is no GPX file, is too large, or a point has no coordinates.
    """
    try:
        size = file.stat().st_size
        if size > MOST_BYTES:
            raise InputError(f"{file}: larger than {MOST_BYTES / 1e6:g} MB; export the one line")
        root = ET.parse(file).getroot()
    except (OSError, ET.ParseError, ValueError, LookupError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{file}: cannot be read as GPX ({error}); {_EXPORT}") from error
    if _local(root) != "gpx":
        raise InputError(f"{file}: is no GPX file, it holds <{_local(root):.40}>; {_EXPORT}")
    return [line for layer in LAYERS for line in _lines(file, root, layer)]


def _lines(file: Path, root: ET.Element, layer: str) -> Iterator[GpxLine]:
    import shapely

    what, part, point = LAYERS[layer]
    for number, element in enumerate(_children(root, what)):
        parts = [element] if part is None else list(_children(element, part))
        where = f"{file}, {layer}, feature {number}"
        lines = [[_coordinates(where, one) for one in _children(each, point)] for each in parts]
        lines = [line for line in lines if len(line) > 1]
        if lines:
            name = next((one.text or "" for one in _children(element, "name")), "")
            yield GpxLine(layer, number, name.strip(), shapely.MultiLineString(lines))


def _coordinates(where: str, point: ET.Element) -> tuple[float, float]:
    """Longitude and latitude; heights are the terrain model's."""
    try:
        return float(point.attrib["lon"]), float(point.attrib["lat"])
    except (KeyError, ValueError):
        raise InputError(f"{where}: a point has no lon and lat that are numbers; {_EXPORT}") from None


def _children(element: ET.Element, name: str) -> Iterator[ET.Element]:
    return (child for child in element if _local(child) == name)


def _local(element: ET.Element) -> str:
    """The element's name without its namespace, which differs between versions of GPX."""
    return str(element.tag).rpartition("}")[2]
