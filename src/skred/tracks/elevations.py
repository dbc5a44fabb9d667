"""A terrain model read where it is asked for, tile by tile: a huge raster costs no more than a small one."""

from __future__ import annotations

import warnings
from collections import OrderedDict
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from skred.arrays import BoolArray, FloatArray
from skred.campaign.problems import shown
from skred.errors import InputError

if TYPE_CHECKING:
    from pyproj import CRS

DRIVERS = {".tif": "GTiff", ".tiff": "GTiff", ".asc": "AAIGrid"}
"""What is read, by the end of the file's name. Others, such as virtual rasters, may lead to anywhere."""
LOWEST_M, HIGHEST_M = -500.0, 9000.0
"""Elevations outside are no data that the file does not declare, such as -9999."""
_TILE = 256
_TILES_KEPT = 64
_ON_THE_EDGE = 1e-6


class Elevations:
    """Elevations of a terrain model, between the centres of its cells.

    Attributes
    ----------
    file : Path
    cell_m : float, m
        Length of a cell's side; of a cell that is not square, of the square of the same area.
    crs : pyproj.CRS or None
        None where the file does not say.
    bounds : (4,) tuple of float
        Least x and y, largest x and y of the cells' centres, in the units of `crs`.
    """

    def __init__(self, dataset: Any, file: Path) -> None:
        from pyproj import CRS

        self.file = file
        self._dataset = dataset
        self._to_cell = ~dataset.transform
        self.cell_m = float(abs(dataset.transform.determinant) ** 0.5)
        self.crs: CRS | None = CRS.from_wkt(dataset.crs.to_wkt()) if dataset.crs else None
        on_map = dataset.transform
        columns, rows = np.meshgrid([0.5, self._columns - 0.5], [0.5, self._rows - 0.5])
        x = on_map.a * columns + on_map.b * rows + on_map.c
        y = on_map.d * columns + on_map.e * rows + on_map.f
        self.bounds = (float(x.min()), float(y.min()), float(x.max()), float(y.max()))
        self._tiles: OrderedDict[tuple[int, int], FloatArray] = OrderedDict()

    @property
    def _columns(self) -> int:
        return int(self._dataset.width)

    @property
    def _rows(self) -> int:
        return int(self._dataset.height)

    def heights(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Elevation [m] by bilinear interpolation.

        Parameters
        ----------
        x, y : (n,) array
            Places, in the units of `crs`.

        Returns
        -------
        (n,) array
            NaN where there is no data, and outside of the raster.
        """
        return self._interpolated(x, y, lambda patch: (patch[1:3, 1:3],))[0]

    def gradient(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Derivatives of the elevation by x and y.

        Bilinear between central differences at the cells' centres: continuous, and exact where the terrain is
        a polynomial of second degree.

        Parameters
        ----------
        x, y : (n,) array
            Places, in the units of `crs`.

        Returns
        -------
        (n,) array, (n,) array
            NaN within a cell of where there is no data.
        """

        def differences(patch: FloatArray) -> tuple[FloatArray, FloatArray]:
            by_column = 0.5 * (patch[1:3, 2:4] - patch[1:3, 0:2])
            by_row = 0.5 * (patch[2:4, 1:3] - patch[0:2, 1:3])
            return by_column, by_row

        by_column, by_row = self._interpolated(x, y, differences)
        inverse = self._to_cell
        return by_column * inverse.a + by_row * inverse.d, by_column * inverse.b + by_row * inverse.e

    def contains(self, x: FloatArray, y: FloatArray) -> BoolArray:
        """Whether places lie between the centres of the raster's cells."""
        column, row = self._cell(x, y)
        return (column >= 0) & (column <= self._columns - 1) & (row >= 0) & (row <= self._rows - 1)

    def _cell(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Places in cells from the centre of the first; rounding does not lead over the edge."""
        to = self._to_cell
        x, y = np.asarray(x, float), np.asarray(y, float)
        found = []
        for value, n in (
            (to.a * x + to.b * y + to.c, self._columns),
            (to.d * x + to.e * y + to.f, self._rows),
        ):
            place = value - 0.5
            for edge in (0.0, n - 1.0):
                place = np.where(np.abs(place - edge) < _ON_THE_EDGE, edge, place)
            found.append(place)
        return found[0], found[1]

    def _interpolated(self, x: FloatArray, y: FloatArray, corners: Any) -> tuple[FloatArray, ...]:
        """Bilinear interpolation of quantities that follow from the 4 x 4 cells around each place."""
        column, row = self._cell(x, y)
        inside = (column >= 0) & (column <= self._columns - 1) & (row >= 0) & (row <= self._rows - 1)
        column, row = np.where(inside, column, 0.0), np.where(inside, row, 0.0)
        left = np.minimum(column.astype(int), self._columns - 2)
        above = np.minimum(row.astype(int), self._rows - 2)
        right_share, below_share = column - left, row - above
        weights = np.array([1.0 - below_share, below_share])[:, None] * np.array(
            [1.0 - right_share, right_share]
        )
        found = []
        for values in corners(self._patches(left, above)):
            parts = np.where(
                weights > 0.0, weights * values, 0.0
            )  # no data beside a row of cells is no matter
            found.append(np.where(inside, parts.sum(axis=(0, 1)), np.nan))
        return tuple(found)

    def _patches(self, left: Any, above: Any) -> FloatArray:
        """Elevations of the 4 x 4 cells from one above and left of each given one, (4, 4, n)."""
        rows, columns = (np.arange(4)[:, None, None], np.arange(4)[None, :, None])
        across, down = left // _TILE, above // _TILE
        found = np.empty((4, 4, len(left)))
        for key in dict.fromkeys(zip(across.tolist(), down.tolist(), strict=True)):
            here = (across == key[0]) & (down == key[1])
            tile = self._tile(*key)
            found[:, :, here] = tile[
                above[here] - key[1] * _TILE + rows, left[here] - key[0] * _TILE + columns
            ]
        return found

    def _tile(self, across: int, down: int) -> FloatArray:
        """A tile of the raster, from the file or as it was read last."""
        key = across, down
        if key not in self._tiles:
            self._tiles[key] = self._read(across, down)
            if len(self._tiles) > _TILES_KEPT:
                self._tiles.popitem(last=False)
        self._tiles.move_to_end(key)
        return self._tiles[key]

    def _read(self, across: int, down: int) -> FloatArray:
        """A tile with the cells around it; NaN outside of the raster."""
        from rasterio.errors import RasterioIOError
        from rasterio.windows import Window

        size = _TILE + 3
        column, row = across * _TILE - 1, down * _TILE - 1
        left, above = max(column, 0), max(row, 0)
        right, below = min(column + size, self._columns), min(row + size, self._rows)
        try:
            raw = self._dataset.read(1, window=Window(left, above, right - left, below - above), masked=True)
        except RasterioIOError as error:
            raise InputError(
                f"{self.file}: cannot be read here ({shown(str(error), 200)}); is the file whole?"
            ) from error
        values = np.ma.filled(raw.astype(float), np.nan) * self._dataset.scales[0] + self._dataset.offsets[0]
        tile = np.full((size, size), np.nan)
        inside = np.where((values >= LOWEST_M) & (values <= HIGHEST_M), values, np.nan)
        tile[above - row : below - row, left - column : right - column] = inside
        return tile


@contextmanager
def open_elevations(file: Path) -> Iterator[Elevations]:
    """Open a terrain model.

    Parameters
    ----------
    file : Path
        A GeoTIFF or an ESRI ASCII grid, with one band of elevations in metres.

    Raises
    ------
    InputError
        If it is not such a file.
    """
    import rasterio
    from rasterio.errors import NotGeoreferencedWarning, RasterioIOError

    driver = DRIVERS.get(file.suffix.lower())
    if driver is None:
        raise InputError(f"{file}: expected a terrain model as .tif or .asc; convert it, or name it so")
    if not file.is_file():
        raise InputError(f"{file}: there is no such file; give a terrain model as .tif or .asc")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", NotGeoreferencedWarning)  # refused below
            dataset = rasterio.open(file, driver=driver)
    except RasterioIOError as error:
        raise InputError(
            f"{file}: not a terrain model that can be read as {driver} ({shown(str(error), 200)})"
        ) from error
    with dataset:
        _check(dataset, file)
        yield Elevations(dataset, file)


def _check(dataset: Any, file: Path) -> None:
    """Refuse what is no raster of elevations in metres on a map."""
    if dataset.count != 1:
        raise InputError(f"{file}: has {dataset.count} bands; expected one, of elevations: export that alone")
    unit = (dataset.units[0] or "m").lower()
    if unit not in ("m", "metre", "meter", "metres", "meters"):
        raise InputError(f"{file}: elevations are in {unit!r}; convert them to metres")
    if dataset.transform.is_identity:
        raise InputError(f"{file}: does not say where it lies on the map; export it with its georeference")
    if min(dataset.width, dataset.height) < 2:
        raise InputError(f"{file}: has {dataset.width} x {dataset.height} cells; expected at least 2 x 2")
