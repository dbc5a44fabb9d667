"""Everything with a geometry in a file of the map: a shapefile, GeoJSON, GeoPackage or GPX.

Files come from strangers. GDAL, left to itself, reads any of its formats under any name, and some of these
lead to other files or to the network. So each file is read as what its name says, or not at all.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from skred.campaign.problems import shown
from skred.errors import InputError
from skred.tracks.gpx import gpx_lines

if TYPE_CHECKING:
    from pyproj import CRS

SHAPEFILE, GEOPACKAGE = b"\x00\x00\x27\x0a", b"SQLite format 3\x00"
"""First bytes of these files. GDAL looks for words of other formats only before the first byte of 0."""
MOST_FEATURES = 1000
_GEOGRAPHIC = "EPSG:4326"
_ANY_BYTES = "ISO-8859-1"
"""An encoding in which every byte is a letter."""


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


def read_features(file: Path, layer: str | None = None) -> list[Feature]:
    """Everything with a geometry in a file.

    Parameters
    ----------
    file : Path
    layer : str, optional
        By default all layers.

    Raises
    ------
    InputError
        If it cannot be read as what its name says, has no such layer or holds too much.
    """
    read = _READERS.get(file.suffix.lower())
    if read is None:
        raise InputError(f"{file}: expected a line as {', '.join(SUFFIXES)}; export it as one of these")
    if not file.is_file():
        raise InputError(f"{file}: there is no such file; give a line as {', '.join(SUFFIXES)}")
    return read(file, layer)


def _geojson(file: Path, layer: str | None) -> list[Feature]:
    return _by_gdal(file, f"GeoJSON:{file}", "GeoJSON", layer)


def _shapefile(file: Path, layer: str | None) -> list[Feature]:
    return _beginning_with(SHAPEFILE, file, "a shapefile", layer)


def _geopackage(file: Path, layer: str | None) -> list[Feature]:
    return _beginning_with(GEOPACKAGE, file, "a GeoPackage", layer)


def _gpx(file: Path, layer: str | None) -> list[Feature]:
    from pyproj import CRS

    lines, crs = gpx_lines(file), CRS.from_user_input(_GEOGRAPHIC)
    layers = list(dict.fromkeys(line.layer for line in lines))
    chosen = [line for line in lines if line.layer in _layers(file, layers, layer)]
    _require_few(file, max((line.number for line in chosen), default=-1) + 1, "tracks or routes")
    return [Feature(file, one.layer, one.number, one.name, one.geometry, crs) for one in chosen]


_READERS: dict[str, Callable[[Path, str | None], list[Feature]]] = {
    ".shp": _shapefile,
    ".geojson": _geojson,
    ".json": _geojson,
    ".gpkg": _geopackage,
    ".gpx": _gpx,
}
SUFFIXES = tuple(_READERS)
"""What is read, by the end of the file's name."""


def _beginning_with(first: bytes, file: Path, kind: str, layer: str | None) -> list[Feature]:
    """Features of a file that is told by its first bytes."""
    with _told(file, kind), file.open("rb") as stream:
        begins = stream.read(len(first))
    if begins != first:
        raise InputError(f"{file}: is not {kind}, though its name says so; export it again")
    return _by_gdal(file, file, kind, layer)


def _by_gdal(file: Path, source: Path | str, kind: str, layer: str | None) -> list[Feature]:
    """Features of a file that GDAL reads, of all layers or of one."""
    import pyogrio

    with _told(file, kind):
        layers = [str(name) for name, shapes in pyogrio.list_layers(source) if shapes is not None]
        return [one for name in _layers(file, layers, layer) for one in _of_layer(file, source, name)]


@contextmanager
def _told(file: Path, kind: str) -> Iterator[None]:
    """Errors of what reads a file, told by the file."""
    from pyogrio.errors import DataLayerError, DataSourceError
    from pyproj.exceptions import CRSError

    try:
        yield
    except (OSError, DataSourceError, DataLayerError, CRSError, UnicodeDecodeError) as error:
        raise InputError(
            f"{file}: cannot be read as {kind} ({shown(str(error), 200)}); export it again"
        ) from error


def _layers(file: Path, layers: list[str], wanted: str | None) -> list[str]:
    """All layers, or the one that is wanted."""
    if wanted is not None and wanted not in layers:
        held = ", ".join(map(shown, layers)) or "no layer of shapes"
        raise InputError(f"--layer {shown(wanted)}: {file} holds {held}; choose one of these")
    return layers if wanted is None else [wanted]


def _of_layer(file: Path, source: Path | str, layer: str) -> list[Feature]:
    """Everything with a geometry in a layer."""
    from pyproj import CRS

    try:
        meta, numbers, shapes, columns = _read(source, layer)
    except UnicodeDecodeError:  # a .dbf in another encoding than it says; only names depend on it
        meta, numbers, shapes, columns = _read(source, layer, encoding=_ANY_BYTES)
    _require_few(file, len(numbers), f"features in layer {shown(layer)}")
    crs = CRS.from_user_input(meta["crs"]) if meta["crs"] else None
    names = _names(meta["fields"], columns, len(numbers))
    return [
        Feature(file, layer, int(number), name, _shape(file, int(number), shape), crs)
        for number, shape, name in zip(numbers.tolist(), shapes, names, strict=True)
        if shape is not None
    ]


def _read(source: Path | str, layer: str, **options: Any) -> Any:
    import pyogrio

    return pyogrio.raw.read(source, layer=layer, max_features=MOST_FEATURES + 1, return_fids=True, **options)


def _shape(file: Path, number: int, shape: bytes) -> Any:
    """A feature's geometry."""
    import shapely

    try:
        return shapely.from_wkb(shape)
    except shapely.errors.ShapelyError as error:
        raise InputError(
            f"{file}, feature {number}: cannot be read ({shown(str(error), 200)}); expected a line of two "
            "points or more, or an area of four: draw it again, or remove it"
        ) from error


def _require_few(file: Path, n: int, of_what: str) -> None:
    if n > MOST_FEATURES:
        raise InputError(f"{file}: more than {MOST_FEATURES} {of_what}; export the one line")


def _names(fields: Sequence[str], columns: Sequence[Any], n: int) -> list[str]:
    """What features are called: the column `name` in any case."""
    for field, column in zip(fields, columns, strict=True):
        if str(field).lower() == "name":
            return ["" if value is None or value != value else str(value) for value in column]
    return [""] * n
