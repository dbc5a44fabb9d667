"""Write a made-up terrain model and a line on it, to try ``skred track`` with.

``python scripts/example_track.py FOLDER`` makes ``FOLDER/dem.tif`` and ``FOLDER/line.geojson``; it needs the
extra `gis`. The line is drawn as such lines often are: by a few points, in longitude and latitude, from the
bottom up.
"""

import sys
from pathlib import Path

import numpy as np
import pyogrio
import rasterio
import shapely
from pyproj import Transformer

CRS = "EPSG:32633"
EAST, NORTH, CELL = 380_000.0, 5_240_000.0, 5.0
COLUMNS, ROWS = 520, 200


def gully(x: np.ndarray) -> np.ndarray:
    """Where the bottom of the gully is, as a distance to the north of the corner [m]."""
    return np.asarray(500.0 + 60.0 * np.sin(x / 320.0))


def elevation(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """A slope that flattens out, with a gully, a rocky step and rough ground [m]."""
    slope = 1000.0 + 900.0 * np.exp(-x / 1100.0)
    step = -25.0 / (1.0 + np.exp(-(x - 620.0) / 6.0))
    rough = 0.4 * np.sin(x / 6.0) * np.cos(y / 8.0)
    return np.asarray(slope + step + 0.0015 * (y - gully(x)) ** 2 + rough)


def main(folder: Path) -> None:
    """Write both files."""
    folder.mkdir(parents=True, exist_ok=True)
    x, y = ((np.arange(n) + 0.5) * CELL for n in (COLUMNS, ROWS))
    z = elevation(x[None, :], y[::-1, None]).astype("float32")
    transform = rasterio.transform.from_origin(EAST, NORTH + ROWS * CELL, CELL, CELL)
    shape = {"width": COLUMNS, "height": ROWS, "count": 1, "dtype": "float32", "nodata": -9999.0}
    with rasterio.open(
        folder / "dem.tif", "w", driver="GTiff", crs=CRS, transform=transform, compress="deflate", **shape
    ) as raster:
        raster.write(z, 1)
    along = np.linspace(1900.0, 60.0, 9)
    to_globe = Transformer.from_crs(CRS, "EPSG:4326", always_xy=True)
    line = shapely.LineString(np.column_stack(to_globe.transform(EAST + along, NORTH + gully(along))))
    (folder / "line.geojson").unlink(missing_ok=True)
    pyogrio.raw.write(
        folder / "line.geojson",
        shapely.to_wkb(np.array([line])),
        [np.array(["main gully"], dtype=object)],
        ["name"],
        geometry_type="LineString",
        crs="EPSG:4326",
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
