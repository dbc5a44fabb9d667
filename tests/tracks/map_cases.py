"""Terrain models whose elevations are formulas, and lines on them, as files.

Tests take the packages of the extra `gis` from here: without it they are skipped.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pyogrio = pytest.importorskip("pyogrio")
pyproj = pytest.importorskip("pyproj")
rasterio = pytest.importorskip("rasterio")
shapely = pytest.importorskip("shapely")

UTM = "EPSG:32632"
EAST, NORTH = 400_000.0, 5_200_000.0
"""South-western corner of the terrain models."""
Formula = Callable[[Any, Any], Any]
Point = tuple[float, float]


def plane(x: Any, y: Any) -> Any:
    """Falls by 0.5 to the east and by 0.25 to the north, from 2000 m at the corner."""
    return 2000.0 - 0.5 * x - 0.25 * y


def bowl(x: Any, y: Any) -> Any:
    """An elliptic bowl around (500, 500), twice as steep to the north as to the east."""
    return 1000.0 + 1e-3 * (x - 500.0) ** 2 + 2e-3 * (y - 500.0) ** 2


def write_dem(
    file: Path,
    formula: Formula,
    *,
    crs: str | None = UTM,
    cell: float = 10.0,
    size: int = 100,
    holes: Sequence[tuple[int, int]] = (),
    no_data: float | None = -9999.0,
    dtype: str = "float64",
    corner: Point = (EAST, NORTH),
) -> Path:
    """A raster of a formula of the distances from its corner, and cells (row, column) without data."""
    middles = (np.arange(size) + 0.5) * cell
    z = formula(middles[None, :], middles[::-1, None]) + np.zeros((size, size))
    for row, column in holes:
        z[row, column] = -9999.0
    transform = rasterio.transform.from_origin(corner[0], corner[1] + size * cell, cell, cell)
    driver = "AAIGrid" if file.suffix == ".asc" else "GTiff"
    if driver == "AAIGrid":
        _write_asc(file, z, cell, corner, no_data)
        return file
    options: dict[str, Any] = {"driver": driver, "width": size, "height": size, "count": 1, "dtype": dtype}
    with rasterio.open(file, "w", crs=crs, transform=transform, nodata=no_data, **options) as raster:
        raster.write(z.astype(dtype), 1)
    return file


def _write_asc(file: Path, z: Any, cell: float, corner: Point, no_data: float | None) -> None:
    """As AvaFrame keeps terrain: without a reference system."""
    head = f"ncols {z.shape[1]}\nnrows {z.shape[0]}\nxllcenter {corner[0] + cell / 2!r}\n"
    head += f"yllcenter {corner[1] + cell / 2!r}\ncellsize {cell!r}\nNODATA_value {no_data!r}\n"
    file.write_text(head + "\n".join(" ".join(f"{value:.6f}" for value in row) for row in z) + "\n")


def on_map(points: Sequence[Point]) -> list[Point]:
    """Distances from the corner as coordinates."""
    return [(EAST + x, NORTH + y) for x, y in points]


def write_shapes(
    file: Path, shapes: Sequence[Any], *, crs: str | None = UTM, names: Sequence[str] = (), **options: Any
) -> Path:
    """A file of shapes, with a column `Name` where they have names."""
    fields, columns = (["Name"], [np.array(names, dtype=object)]) if names else ([], [])
    if crs is None:
        options["driver"] = "ESRI Shapefile"
    pyogrio.raw.write(
        file,
        shapely.to_wkb(np.array(shapes, dtype=object)),
        columns,
        fields,
        geometry_type=shapes[0].geom_type,
        crs=crs,
        **options,
    )
    return file


def write_line(file: Path, points: Sequence[Point], **options: Any) -> Path:
    """A file of one line, through distances from the corner."""
    return write_shapes(file, [shapely.LineString(on_map(points))], **options)
