"""Everything here reads maps, which needs the extra `gis`."""

import pytest

pytest.importorskip("rasterio")
pytest.importorskip("pyogrio")
pytest.importorskip("shapely")
pytest.importorskip("pyproj")
