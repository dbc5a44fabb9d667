"""Files of the map are read as what their names say: no other file, no network, no traceback."""

from __future__ import annotations

import json
import socket
import threading
from pathlib import Path

import pytest
from map_cases import EAST, on_map, shapely, write_line, write_shapes

from skred.errors import InputError
from skred.tracks.features import MOST_FEATURES, read_features
from skred.tracks.lines import read_line

DOWN = [(100.0, 100.0), (500.0, 400.0), (900.0, 400.0)]
SUFFIXES = (".shp", ".geojson", ".json", ".gpkg", ".gpx")


class Called:
    """A place on this machine that nobody is to call; who does is hung up on, and counted."""

    def __init__(self) -> None:
        self.times = 0
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._server.getsockname()[1])
        threading.Thread(target=self._answer, daemon=True).start()

    def _answer(self) -> None:
        while True:
            self._server.accept()[0].close()
            self.times += 1


def leads_to(source: str) -> str:
    """A virtual file that shows a layer of another one."""
    layer = f'<OGRVRTLayer name="line"><SrcDataSource>{source}</SrcDataSource><SrcLayer>line</SrcLayer>'
    return f"<OGRVRTDataSource>{layer}</OGRVRTLayer></OGRVRTDataSource>"


GPX = '<gpx version="1.1" xmlns="http://www.topografix.com/GPX/1/1">'
LINE = '{"type": "LineString", "coordinates": [[7.7, 46.9], [7.8, 46.9]]}'
DISGUISES = [
    *((suffix, "{}") for suffix in SUFFIXES),
    (".shp", "\x00\x00\x27\x0a{}"),
    (".gpkg", "SQLite format 3\x00{}"),
    (".gpx", f"{GPX}{{}}</gpx>"),
    (".gpx", "<!-- <gpx> -->{}"),
    (".gpx", f"<!-- {{}} -->{GPX}</gpx>"),
    (".json", f'{{"vrt": "{{}}", {LINE[1:]}'),
    (".geojson", f"{LINE}{{}}"),
]


@pytest.mark.filterwarnings("ignore")  # of GDAL, on the database that is none
@pytest.mark.parametrize(("suffix", "disguise"), DISGUISES)
def test_a_virtual_file_leads_nowhere(tmp_path: Path, suffix: str, disguise: str) -> None:
    other = write_line(tmp_path / "other.gpkg", DOWN)
    called = Called()
    for source in (str(other), f"/vsicurl/http://127.0.0.1:{called.port}/line.geojson"):
        file = tmp_path / f"line{suffix}"
        file.write_text(disguise.replace("{}", leads_to(source)), encoding="latin-1")
        try:
            found = read_features(file)
        except InputError as error:
            assert str(error).startswith(f"{file}: ")
            found = []
        assert all(shapely.get_coordinates(one.geometry).max() < EAST for one in found)
    assert called.times == 0


@pytest.mark.parametrize(
    "content",
    [
        {"type": "gdal_streamed_alg", "command_line": "gdal vector pipeline ! read other.gpkg ! write x"},
        {"displayFieldName": "", "geometryType": "esriGeometryPolyline", "features": []},
        {"stac_version": "1.0.0", "type": "Topology", "objects": {}},
    ],
)
def test_json_that_is_no_geojson_is_refused(tmp_path: Path, content: dict[str, object]) -> None:
    file = tmp_path / "line.json"
    file.write_text(json.dumps(content))
    with pytest.raises(InputError, match=r"line\.json: cannot be read as GeoJSON .*; export it again"):
        read_line(file)


@pytest.mark.parametrize(("written", "named"), [(".gpkg", ".shp"), (".geojson", ".gpkg"), (".gpkg", ".gpx")])
def test_a_file_under_another_formats_name_is_refused(tmp_path: Path, written: str, named: str) -> None:
    shape = shapely.LineString([(7.7, 46.9), (7.8, 46.9)])
    file = write_shapes(tmp_path / f"line{written}", [shape], crs="EPSG:4326")
    with pytest.raises(InputError, match=f"line{named}: .*; export it again"):
        read_line(file.rename(tmp_path / f"line{named}"))


def test_a_name_with_signs_of_addresses_is_only_a_name(tmp_path: Path) -> None:
    for name in ("Spur größe 1.geojson", "a#b?c=d.geojson"):
        (tmp_path / name).write_text(LINE)
        assert len(read_line(tmp_path / name).plan.x) == 2


def test_tracks_and_routes_of_a_gpx(tmp_path: Path) -> None:
    file = tmp_path / "walk.gpx"
    points = "".join(f'<{{}}pt lat="46.{k}" lon="7.7"><ele>9</ele></{{}}pt>' for k in (7, 8, 9))
    track = points.replace("{}", "trk")
    file.write_text(
        f"{GPX}<metadata><name>all</name></metadata><trk><name>short</name><trkseg/></trk>"
        f"<trk><name> path </name><trkseg>{track}</trkseg></trk>"
        f"<rte><name>plan</name>{points.replace('{}', 'rte')}</rte></gpx>"
    )
    found = [(one.layer, one.number, one.name) for one in read_features(file)]
    assert found == [("tracks", 1, "path"), ("routes", 0, "plan")]
    line = read_line(file, layer="routes")
    assert line.plan.y.tolist() == [46.7, 46.8, 46.9] and line.feature.crs is not None
    with pytest.raises(InputError, match="--layer waypoints: .* holds tracks, routes; choose one"):
        read_line(file, layer="waypoints")


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("<kml/>", "is no GPX file, it holds <kml>; expected a GPX file with tracks or routes; export it"),
        ("<gpx>", "cannot be read as GPX"),
        ('<?xml version="1.0" encoding="nonsense"?><gpx/>', "cannot be read as GPX"),
        (
            '<gpx><trk><trkseg><trkpt lat="46" lon="x"/></trkseg></trk></gpx>',
            "tracks, feature 0: a point has no lon and lat",
        ),
        ("<gpx>" + MOST_FEATURES * "<trk/>" + "<rte/></gpx>", "holds no line"),
        (
            "<gpx>"
            + (MOST_FEATURES + 1) * '<rte><rtept lat="1" lon="1"/><rtept lat="2" lon="1"/></rte>'
            + "</gpx>",
            f"more than {MOST_FEATURES} tracks or routes",
        ),
        ('<!DOCTYPE gpx [<!ENTITY x SYSTEM "other.xml">]><gpx>&x;</gpx>', "cannot be read as GPX"),
    ],
)
def test_a_gpx_that_is_none_is_refused(tmp_path: Path, content: str, said: str) -> None:
    (tmp_path / "other.xml").write_text("<trk/>")
    (tmp_path / "walk.gpx").write_text(content)
    with pytest.raises(InputError) as error:
        read_line(tmp_path / "walk.gpx")
    assert said in str(error.value) and "walk.gpx" in str(error.value)


def test_a_line_of_one_point_is_told_by_its_number(tmp_path: Path) -> None:
    whole = {"type": "Feature", "properties": {}, "geometry": json.loads(LINE)}
    one_point = {**whole, "geometry": {"type": "LineString", "coordinates": [[7.7, 46.9]]}}
    file = tmp_path / "line.geojson"
    file.write_text(json.dumps({"type": "FeatureCollection", "features": [whole, one_point]}))
    with pytest.raises(InputError, match=r"line\.geojson, feature 1: cannot be read .* two points or more"):
        read_line(file)


def test_an_attribute_table_in_another_encoding_than_it_says_is_read(tmp_path: Path) -> None:
    file = write_shapes(tmp_path / "line.shp", [shapely.LineString(on_map(DOWN))], names=["Strasse"])
    table = file.with_suffix(".dbf")
    table.write_bytes(table.read_bytes().replace(b"Strasse", "Straße ".encode("latin-1")))
    assert file.with_suffix(".cpg").read_text() == "UTF-8"
    assert read_line(file).feature.name == "Straße"
