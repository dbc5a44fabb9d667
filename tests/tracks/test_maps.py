"""Files of lines, their reference systems, and what is refused."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
from map_cases import (
    EAST,
    NORTH,
    UTM,
    on_map,
    plane,
    pyproj,
    rasterio,
    shapely,
    write_dem,
    write_line,
    write_shapes,
)

from skred.errors import InputError
from skred.tracks.build import Wanted, make_track
from skred.tracks.lines import read_line

DOWN = [(100.0, 100.0), (500.0, 400.0), (900.0, 400.0)]
GEOGRAPHIC = "EPSG:4326"


@pytest.fixture
def dem(tmp_path: Path) -> Path:
    return write_dem(tmp_path / "dem.tif", plane)


def on_globe(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Distances from the corner as longitude and latitude."""
    to = pyproj.Transformer.from_crs(UTM, GEOGRAPHIC, always_xy=True)
    return [to.transform(*point) for point in on_map(points)]


@pytest.mark.parametrize("suffix", ["shp", "geojson", "gpkg", "gpx"])
def test_every_kind_of_file_gives_the_same_track(dem: Path, tmp_path: Path, suffix: str) -> None:
    expected = make_track(Wanted(dem, write_line(tmp_path / "reference.gpkg", DOWN)))
    file = tmp_path / f"line.{suffix}"
    if suffix in ("geojson", "gpx"):
        layer = {"layer": "tracks"} if suffix == "gpx" else {}
        shape = shapely.LineString(on_globe(DOWN))
        write_shapes(file, [shapely.MultiLineString([shape]) if layer else shape], crs=GEOGRAPHIC, **layer)
    else:
        write_line(file, DOWN)
    made = make_track(Wanted(dem, file))
    np.testing.assert_allclose(made["profile"]["x_m"], expected["profile"]["x_m"], atol=0.2)
    np.testing.assert_allclose(made["profile"]["z_m"], expected["profile"]["z_m"], atol=0.2)
    moved = [one for one in made["notices"] if one.startswith("line brought from EPSG:4326 (WGS 84) into")]
    assert len(moved) == (suffix in ("geojson", "gpx"))


def test_a_line_of_another_zone_is_brought_into_the_terrains(dem: Path, tmp_path: Path) -> None:
    to = pyproj.Transformer.from_crs(UTM, "EPSG:3035", always_xy=True)
    points = [to.transform(*point) for point in on_map([(100.0, 100.0), (500.0, 400.0)])]
    file = write_shapes(tmp_path / "other.gpkg", [shapely.LineString(points)], crs="EPSG:3035")
    made = make_track(Wanted(dem, file))
    assert made["line"]["horizontal_length_m"] == pytest.approx(500.0, abs=1e-3)
    assert any("into the terrain's EPSG:32632" in one for one in made["notices"])


def test_how_well_two_reference_systems_are_related_is_told(tmp_path: Path) -> None:
    """UTM on WGS 84 is exact; the Austrian one to 1.5 m; of an ellipsoid without a datum nothing is."""
    unknown = "+proj=tmerc +lon_0=12 +k=1 +x_0=0 +y_0=0 +ellps=bessel +units=m +type=crs"
    told = {}
    for crs in (UTM, "EPSG:31287", unknown):
        to = pyproj.Transformer.from_crs(GEOGRAPHIC, crs, always_xy=True)
        x, y = to.transform(12.5, 47.3)
        dem = write_dem(tmp_path / "dem.tif", plane, crs=crs, corner=(x - 500.0, y - 500.0))
        points = [to.transform(*point, direction="INVERSE") for point in ((x, y), (x + 300.0, y))]
        file = tmp_path / "line.geojson"
        file.unlink(missing_ok=True)
        write_shapes(file, [shapely.LineString(points)], crs=GEOGRAPHIC)
        told[crs] = make_track(Wanted(dem, file))["notices"][0]
    assert told[UTM].endswith("zone 32N)")
    assert told["EPSG:31287"].endswith("EPSG:31287 (MGI / Austria Lambert), known to 1.5 m")
    assert told[unknown].endswith("it may be off by 100 m, so look at it on a map")


def test_a_way_that_does_not_exist_is_told(tmp_path: Path) -> None:
    line = write_shapes(tmp_path / "l.geojson", [shapely.LineString(on_globe(DOWN))], crs=GEOGRAPHIC)
    odd = "+proj=tmerc +lon_0=9 +k=0.9996 +x_0=500000 +R=6378137 +units=m +type=crs"
    with pytest.raises(InputError, match="bring line and terrain into the same reference system"):
        make_track(Wanted(write_dem(tmp_path / "d.asc", plane), line, crs=odd))


def test_terrain_without_reference_system_is_taken_to_be_in_the_lines(tmp_path: Path) -> None:
    made = make_track(Wanted(write_dem(tmp_path / "d.asc", plane), write_line(tmp_path / "l.gpkg", DOWN)))
    assert made["notices"] == [
        "d.asc has no reference system: taken to be in that of the line, EPSG:32632 (WGS 84 / UTM zone 32N)"
    ]


def test_a_prj_beside_the_grid_is_read(tmp_path: Path) -> None:
    dem = write_dem(tmp_path / "d.asc", plane)
    (tmp_path / "d.prj").write_text(rasterio.crs.CRS.from_string(UTM).to_wkt(version="WKT1_ESRI"))
    made = make_track(Wanted(dem, write_line(tmp_path / "l.gpkg", DOWN)))
    assert made["notices"] == [] and made["terrain"]["reference_system"].startswith("EPSG:32632")


def test_a_line_without_reference_system_is_taken_to_be_in_the_terrains(dem: Path, tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of pyogrio, that it writes none
        line = write_line(tmp_path / "line.shp", DOWN, crs=None)
    asc = write_dem(tmp_path / "d.asc", plane)
    assert make_track(Wanted(dem, line))["notices"][0].startswith("line.shp has no reference system")
    assert make_track(Wanted(asc, line))["notices"] == [
        "neither file has a reference system: taken to be in the same one, in metres"
    ]


def test_a_gpx_needs_to_know_where_the_grid_lies(tmp_path: Path) -> None:
    dem = write_dem(tmp_path / "d.asc", plane)
    line = write_shapes(tmp_path / "l.geojson", [shapely.LineString(on_globe(DOWN))], crs=GEOGRAPHIC)
    with pytest.raises(InputError, match="say which one the terrain is in, such as --crs EPSG:32632"):
        make_track(Wanted(dem, line))
    made = make_track(Wanted(dem, line, crs=UTM))
    assert made["smoothing"]["sampled"]["fall_m"] == pytest.approx(475.0, abs=0.1)


@pytest.mark.parametrize(
    ("crs", "corner", "cell", "said"),
    [
        (GEOGRAPHIC, (7.7, 46.9), 1e-4, "which measures degrees"),
        ("EPSG:3857", (850_000.0, 5_930_000.0), 10.0, "whose map stretches lengths by 46 % here"),
        ("EPSG:2225", (6_500_000.0, 2_200_000.0), 10.0, "which measures US survey foot"),
    ],
)
def test_a_map_that_does_not_measure_metres_is_refused(
    tmp_path: Path, crs: str, corner: tuple[float, float], cell: float, said: str
) -> None:
    dem = write_dem(tmp_path / "dem.tif", plane, crs=crs, corner=corner, cell=cell)
    ends = [(corner[0] + share * cell, corner[1] + share * cell) for share in (10, 60)]
    line = write_shapes(tmp_path / "l.gpkg", [shapely.LineString(ends)], crs=crs)
    with pytest.raises(InputError) as error:
        make_track(Wanted(dem, line))
    zone = "EPSG:32610" if crs == "EPSG:2225" else "EPSG:32632"
    assert said in str(error.value) and f"dem-utm.tif --dst-crs {zone} --resampling bilinear" in str(
        error.value
    )


def test_degrees_without_a_reference_system_are_seen(tmp_path: Path) -> None:
    dem = write_dem(tmp_path / "d.asc", plane, corner=(7.7, 46.9), cell=1e-4)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        line = write_shapes(
            tmp_path / "l.shp", [shapely.LineString([(7.701, 46.901), (7.706, 46.906)])], crs=None
        )
    with pytest.raises(InputError, match="are degrees, by their looks"):
        make_track(Wanted(dem, line))


def test_a_contradiction_and_a_name_of_nothing_are_refused(dem: Path, tmp_path: Path) -> None:
    line = write_line(tmp_path / "l.gpkg", DOWN)
    with pytest.raises(InputError, match="says that it is in EPSG:32632"):
        make_track(Wanted(dem, line, crs="EPSG:32633"))
    with pytest.raises(InputError, match="--crs nowhere: no reference system"):
        make_track(Wanted(dem, line, crs="nowhere"))


def test_projected_coordinates_in_a_geojson_are_seen(dem: Path, tmp_path: Path) -> None:
    """A GeoJSON without a reference system is said to be in longitude and latitude."""
    file = tmp_path / "l.geojson"
    file.write_text(shapely.to_geojson(shapely.LineString(on_map(DOWN))))
    with pytest.raises(InputError, match=r"\(400100, 5200100\) are no longitude and latitude"):
        make_track(Wanted(dem, file))


def turned(points: list[tuple[float, float]]) -> shapely.LineString:
    return shapely.LineString([(y, x) for x, y in points])


@pytest.mark.parametrize("grid", ["utm", "far east", "degrees", "without"])
def test_coordinates_the_other_way_round_are_the_lines_fault(tmp_path: Path, grid: str) -> None:
    """Not the terrain's, which measures metres where it lies; in Japan they are not even on the globe."""
    what, crs, options = "longitude and latitude", GEOGRAPHIC, {}
    if grid == "utm":
        dem, points = write_dem(tmp_path / "dem.tif", plane), on_globe(DOWN)
    elif grid == "far east":
        dem, points = write_dem(tmp_path / "dem.tif", plane, crs="EPSG:32654"), on_map(DOWN)
        to = pyproj.Transformer.from_crs("EPSG:32654", GEOGRAPHIC, always_xy=True)
        points = [to.transform(*point) for point in points]
    elif grid == "degrees":
        options = {"crs": GEOGRAPHIC, "corner": (7.7, 46.9), "cell": 1e-4}
        dem, points = write_dem(tmp_path / "dem.tif", plane, **options), [(7.701, 46.901), (7.706, 46.906)]
    else:
        dem, points = write_dem(tmp_path / "dem.asc", plane), on_map(DOWN)
        what, crs = "easting and northing", UTM
    line = write_shapes(tmp_path / "line.gpkg", [turned(points)], crs=crs)
    with pytest.raises(InputError) as error:
        make_track(Wanted(dem, line))
    assert f"line.gpkg: {what} of the line are exchanged" in str(error.value)
    assert "rio warp" not in str(error.value) and "export the line again" in str(error.value)


def test_a_line_somewhere_else_is_told_with_both_places(dem: Path, tmp_path: Path) -> None:
    far = [(x + 9.0, y) for x, y in on_globe(DOWN)]
    line = write_shapes(tmp_path / "line.geojson", [shapely.LineString(far)], crs=GEOGRAPHIC)
    with pytest.raises(InputError) as error:
        make_track(Wanted(dem, line))
    told = str(error.value)
    assert "line.geojson: the line lies off the raster: its first point is (16.6" in told
    assert "in the terrain's reference system (" in told and "dem.tif covers x 400005 to 400995" in told
    assert "rio warp" not in told


def lines_of(n: int) -> list[shapely.LineString]:
    return [shapely.LineString(on_map([(100.0, 100.0 + 10 * k), (500.0, 400.0)])) for k in range(n)]


def test_several_lines_are_listed_and_one_is_chosen(dem: Path, tmp_path: Path) -> None:
    file = write_shapes(tmp_path / "l.shp", lines_of(3), names=["upper", "lower", "lower"])
    with pytest.raises(InputError) as error:
        read_line(file)
    assert "several lines; choose one by --feature" in str(error.value)
    assert "\n  feature 0 (upper), 2 points\n  feature 1 (lower), 2 points" in str(error.value)
    assert (
        read_line(file, feature="upper").feature.number == 0
        and read_line(file, feature="2").plan.y[0] == NORTH + 120
    )
    for wrong, said in (("lower", "2 lines of --feature lower"), ("9", "no lines of --feature 9")):
        with pytest.raises(InputError, match=said):
            read_line(file, feature=wrong)
    assert make_track(Wanted(dem, file, feature="upper"))["line"]["name"] == "upper"


def test_layers_are_listed_and_one_is_chosen(tmp_path: Path) -> None:
    file = tmp_path / "l.gpkg"
    write_shapes(file, lines_of(1), layer="paths")
    write_shapes(file, lines_of(1), layer="profiles", append=True)
    with pytest.raises(InputError, match="lines in the layers paths, profiles; choose one by --layer"):
        read_line(file)
    assert read_line(file, layer="profiles").feature.layer == "profiles"
    with pytest.raises(InputError, match="--layer roads: .* holds paths, profiles"):
        read_line(file, layer="roads")


def test_parts_are_joined_where_they_meet(tmp_path: Path) -> None:
    ends = on_map([(0, 0), (100, 0), (200, 50), (250, 50)])
    joined = shapely.MultiLineString([ends[:2], ends[1:3]])
    apart = shapely.MultiLineString([ends[:2], ends[2:]])
    line = read_line(write_shapes(tmp_path / "joined.gpkg", [joined]))
    np.testing.assert_allclose(line.plan.x, [EAST, EAST + 100, EAST + 200])
    with pytest.raises(InputError, match="has 2 parts that do not meet end to end"):
        read_line(write_shapes(tmp_path / "apart.gpkg", [apart]))


def test_heights_of_a_line_are_not_used(dem: Path, tmp_path: Path) -> None:
    shape = shapely.LineString([(x, y, 5000.0) for x, y in on_map(DOWN)])
    file = write_shapes(tmp_path / "l.geojson", [shape], RFC7946="NO")
    made = make_track(Wanted(dem, file))
    assert made["profile"]["z_m"][0] == pytest.approx(1925.0, abs=0.5)
    assert "heights that the line has itself are not used" in made["notices"]


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("points.geojson", '{"type": "Point", "coordinates": [7.7, 46.9]}', "holds no line"),
        ("broken.geojson", "{]", "cannot be read"),
        (
            "empty.gpx",
            '<gpx xmlns="http://www.topografix.com/GPX/1/1" version="1.1" creator="x"/>',
            "holds no line",
        ),
        ("line.kml", "<kml/>", "expected a line as .shp, .geojson, .json, .gpkg, .gpx"),
    ],
)
def test_files_without_a_line_are_refused(tmp_path: Path, name: str, content: str, said: str) -> None:
    (tmp_path / name).write_text(content)
    with pytest.raises(InputError, match=said):
        read_line(tmp_path / name)
    with pytest.raises(InputError, match="there is no such file"):
        read_line(tmp_path / "nowhere.shp")


def test_rasters_that_are_no_terrain_are_refused(tmp_path: Path) -> None:
    line = write_line(tmp_path / "l.gpkg", DOWN)
    (tmp_path / "text.tif").write_text("no raster")
    (tmp_path / "text.asc").write_text("no raster")
    (tmp_path / "dem.vrt").write_text("<VRTDataset/>")
    options = {"driver": "GTiff", "width": 4, "height": 4, "dtype": "float32", "crs": UTM}
    transform = rasterio.transform.from_origin(EAST, NORTH, 10.0, 10.0)
    with rasterio.open(tmp_path / "bands.tif", "w", count=3, transform=transform, **options):
        pass
    with rasterio.open(tmp_path / "feet.tif", "w", count=1, transform=transform, **options) as raster:
        raster.units = ("ft",)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with rasterio.open(tmp_path / "nowhere.tif", "w", count=1, **options):
            pass
    for name, said in (
        ("text.tif", "not a terrain model that can be read as GTiff"),
        ("text.asc", "not a terrain model that can be read as AAIGrid"),
        ("dem.vrt", "expected a terrain model as .tif or .asc"),
        ("missing.tif", "there is no such file"),
        ("bands.tif", "has 3 bands; expected one"),
        ("feet.tif", "elevations are in 'ft'"),
        ("nowhere.tif", "does not say where it lies"),
    ):
        with pytest.raises(InputError, match=said):
            make_track(Wanted(tmp_path / name, line))
