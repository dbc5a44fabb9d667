"""``skred track``: files whole or not at all, AvaFrame's folder, what other commands make of the table."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from map_cases import on_map, plane, shapely, write_dem, write_line, write_shapes

from skred.cli.main import run
from skred.extras import REQUIREMENTS
from skred.prediction.track import read_track
from skred.tracks.files import track_files

ROOT = Path(__file__).resolve().parents[2]
DOWN = [(100.0, 100.0), (500.0, 400.0), (900.0, 400.0)]
WRITTEN = ["track.csv", "track.json", "track.png"]


@pytest.fixture
def maps(tmp_path: Path) -> list[str]:
    """Options for a terrain model and a line on it."""
    (tmp_path / "maps").mkdir()
    dem = write_dem(tmp_path / "maps" / "dem.tif", plane)
    line = write_line(tmp_path / "maps" / "line.gpkg", DOWN)
    return ["track", "--dem", str(dem), "--line", str(line)]


def names(folder: Path) -> list[str]:
    return sorted(one.name for one in folder.iterdir())


def test_table_document_and_figure_are_written(
    maps: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "new" / "folder" / "track.csv"
    assert run([*maps, "--out", str(out), "--extend", "50"]) == 0
    assert names(out.parent) == WRITTEN
    told = " ".join(capsys.readouterr().out.split())
    assert (
        "fall 503.0 503.0 m" in told and "Extended along the fall line by 50 m" in told and str(out) in told
    )
    document = json.loads((out.parent / "track.json").read_text())
    track = read_track(out)
    assert (
        track.x_m.tolist() == document["profile"]["x_m"] and track.z_m.tolist() == document["profile"]["z_m"]
    )
    np.testing.assert_allclose(track.s_m, document["profile"]["s_m"], atol=1e-3)


def test_the_figure_is_made_again(
    maps: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "tracks" / "path.csv"
    assert run([*maps, "--out", str(out), "--quiet"]) == 0
    figure = out.with_suffix(".png")
    before, table = figure.read_bytes(), out.read_bytes()
    figure.unlink()
    assert run(["report", str(out.parent)]) == 0
    assert figure.read_bytes() == before and out.read_bytes() == table
    assert str(figure) in capsys.readouterr().out.replace("\n", "")
    out.with_suffix(".json").write_text('{"format": 1, "profile": []}')
    assert run(["report", str(out.parent)]) == 2
    assert "path.json: no track that can be drawn" in capsys.readouterr().err
    out.with_suffix(".json").write_text('{"format": 7}')
    assert run(["report", str(out.parent)]) == 2
    assert "another version of skred" in capsys.readouterr().err


def test_the_table_is_a_campaigns_track(maps: list[str], tmp_path: Path) -> None:
    folder = tmp_path / "campaign"
    assert run([*maps, "--out", str(folder / "track.csv"), "--quiet"]) == 0
    (folder / "campaign.toml").write_text(
        'format = 1\nname = "x"\ndescription = ""\nsource = ""\norigin = "simulated"\n'
    )
    (folder / "sensors.csv").write_text(
        "sensor,quantity,s_from_m,s_to_m,relative_sd,absolute_sd\nv,front_velocity,500,500,0.1,1\n"
    )
    (folder / "events.csv").write_text("event,release_s_m\na,10\n")
    (folder / "recordings.csv").write_text("event,sensor,value,status\na,v,20,observed\n")
    assert run(["validate", str(folder), "--quiet"]) == 0


def test_json_has_everything_but_the_points(
    maps: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([*maps, "--out", str(tmp_path / "track.csv"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    kept = json.loads((tmp_path / "track.json").read_text())
    assert told == {name: value for name, value in kept.items() if name != "profile"}


@pytest.mark.parametrize("there", WRITTEN)
def test_nothing_is_replaced_without_force(
    maps: list[str], tmp_path: Path, there: str, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out" / "track.csv"
    out.parent.mkdir()
    (out.parent / there).write_text("mine")
    assert run([*maps, "--out", str(out)]) == 2
    assert f"{there}: is there already" in capsys.readouterr().err and names(out.parent) == [there]
    assert (out.parent / there).read_text() == "mine"


def test_force_replaces_an_earlier_track(maps: list[str], tmp_path: Path) -> None:
    out = tmp_path / "out" / "track.csv"
    words = [*maps, "--out", str(out), "--quiet"]
    assert run([*words, "--step", "50"]) == 0
    before = [(out.parent / name).read_bytes() for name in WRITTEN]
    assert run([*words, "--force"]) == 0
    assert names(out.parent) == WRITTEN
    after = [(out.parent / name).read_bytes() for name in WRITTEN]
    assert all(one != other for one, other in zip(before, after, strict=True))


@pytest.mark.parametrize("linked", [False, True])
def test_force_never_replaces_the_line(
    maps: list[str], tmp_path: Path, linked: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    """`--out mine.csv` also writes mine.json: here the line itself, or a link to it."""
    shape = shapely.LineString(on_map([(100.0, 100.0), (500.0, 400.0)]))
    line = write_shapes(tmp_path / "line.geojson", [shape], RFC7946="NO")
    mine = tmp_path / "mine.json"
    if linked:
        mine.symlink_to(line)
    else:
        line = line.rename(mine)
    before = line.read_bytes()
    words = [*maps[:3], "--line", str(line), "--out", str(tmp_path / "mine.csv")]
    assert run([*words, "--force"]) == 2
    told = capsys.readouterr().err
    assert "mine.json: is not the document of a track" in told and "choose another --out" in told
    assert line.read_bytes() == before and not (tmp_path / "mine.csv").exists()
    mine.unlink()


@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError("full"), ZeroDivisionError()])
def test_nothing_half_written_is_left(tmp_path: Path, error: BaseException) -> None:
    out = tmp_path / "new" / "track.csv"
    with pytest.raises(type(error)), track_files(out) as file:
        file.write_text("half")
        raise error
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--out", "track.txt"], "expected the name of a table, ending in .csv"),
        (["--out", "t.csv", "--line", "nowhere.shp"], "nowhere.shp: there is no such file"),
        (["--out", "t.csv", "--extend", "-5"], "extend"),
        (["--out", "t.csv", "--step", "0"], "step"),
    ],
)
def test_bad_options_leave_nothing(
    maps: list[str],
    tmp_path: Path,
    options: list[str],
    said: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    words = maps if "--line" not in options else maps[:3]
    assert run([*words, *options]) == 2
    captured = capsys.readouterr()
    assert said in captured.err + captured.out and list((tmp_path / "here").iterdir()) == []


def test_terrain_and_line_are_asked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["track", "--out", str(tmp_path / "t.csv")]) == 2
    assert (
        "expected --dem with a terrain model and --line with a line, or --avaframe" in capsys.readouterr().err
    )


@pytest.fixture
def inputs(tmp_path: Path) -> Path:
    """An AvaFrame folder: a grid without a reference system, lines, release areas and a release point."""
    folder = tmp_path / "avaPlane" / "Inputs"
    for name in ("LINES", "REL", "POINTS"):
        (folder / name).mkdir(parents=True)
    write_dem(folder / "avaPlane.asc", plane)
    write_line(folder / "LINES" / "pathAB.shp", [(100.0, 500.0), (900.0, 500.0)], names=["main"])
    corners = [
        [(150, 450), (300, 450), (300, 550), (150, 550)],
        [(600, 700), (650, 700), (650, 750), (600, 750)],
    ]
    areas = [shapely.Polygon(on_map(points)) for points in corners]
    write_shapes(folder / "REL" / "relArea.shp", areas, names=["rel1", "beside"])
    write_shapes(folder / "REL" / "relPoint.shp", [shapely.Point(*on_map([(400.0, 530.0)])[0])])
    return folder


def released(document: dict[str, Any]) -> dict[str, list[float | None]]:
    return {one["name"]: [one["s_from_m"], one["s_to_m"], one["distance_m"]] for one in document["releases"]}


@pytest.mark.parametrize("given", ["Inputs", "avaPlane"])
def test_an_avaframe_folder_is_taken_as_it_is(
    inputs: Path, tmp_path: Path, given: str, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = inputs if given == "Inputs" else inputs.parent
    out = tmp_path / "track.csv"
    assert run(["track", "--avaframe", str(folder), "--out", str(out), "--smoothing", "0"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    along = float(np.hypot(1.0, 0.5))
    assert "avaPlane.asc has no reference system: taken to be in that of the line" in told
    assert f"Release relArea.shp (rel1): s = {50 * along:.0f} to {200 * along:.0f} m; its lower end" in told
    assert (
        f"--release {200 * along:.0f}" in told and "(beside): the track does not cross it, 200 m away" in told
    )
    found = released(json.loads(out.with_suffix(".json").read_text()))
    assert found["rel1"] == pytest.approx([50 * along, 200 * along, 0.0], abs=1e-3)
    assert found[""] == pytest.approx([300 * along, 300 * along, 30.0], abs=1e-3)
    assert found["beside"] == [None, None, pytest.approx(200.0)]


def test_an_avaframe_folder_that_is_not_clear_is_told(
    inputs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["track", "--avaframe", str(inputs), "--out", str(tmp_path / "track.csv")]
    second = write_line(inputs / "LINES" / "other.shp", DOWN)
    assert run(words) == 2
    told = capsys.readouterr().err
    assert "2 times a shapefile in LINES or PROFILE; choose one" in told and f"\n  --line {second}" in told
    assert run([*words, "--line", str(second), "--quiet"]) == 0
    (inputs / "avaPlane.asc").unlink()
    assert run([*words, "--line", str(second), "--force"]) == 2
    assert "no terrain model (.asc or .tif); put one there, or give it by --dem" in capsys.readouterr().err


def test_names_of_a_file_do_not_steer_the_terminal(
    inputs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    area = shapely.Polygon(on_map([(150, 450), (300, 450), (300, 550), (150, 550)]))
    write_shapes(inputs / "REL" / "relArea.shp", [area], names=["\x1b[31mred"])
    write_line(inputs / "LINES" / "pathAB.shp", [(100.0, 500.0), (900.0, 500.0)], names=["\x1b[2J"])
    assert run(["track", "--avaframe", str(inputs), "--out", str(tmp_path / "track.csv")]) == 0
    told = capsys.readouterr()
    assert "\x1b[31m" not in told.out + told.err and "\x1b[2J" not in told.out + told.err


def test_the_example_of_the_page_runs(tmp_path: Path) -> None:
    """As docs/tracks.md says; the numbers it names come from there."""
    script = [sys.executable, str(ROOT / "scripts" / "example_track.py"), str(tmp_path)]
    subprocess.run(script, check=True, capture_output=True)
    maps = ["--dem", str(tmp_path / "dem.tif"), "--line", str(tmp_path / "line.geojson")]
    out = tmp_path / "track.csv"
    assert run(["track", *maps, "--extend", "300", "--out", str(out), "--quiet"]) == 0
    document = json.loads(out.with_suffix(".json").read_text())
    steepest = [document["smoothing"][state]["steepest_deg"] for state in ("sampled", "as_read")]
    page = (ROOT / "docs" / "tracks.md").read_text(encoding="utf-8")
    assert "of {:.0f} degrees is {:.0f} degrees after both".format(*steepest) in page
    assert f"{document['smoothing']['with_the_commands_m']:.1f} m by default" in page
    quoted = " ".join(f'"{one}"' for one in REQUIREMENTS["gis"])
    assert f"python -m pip install {quoted}\n" in page


BLOCKED = """
import sys
class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("rasterio", "pyogrio", "shapely", "pyproj"):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Blocker())
from skred.cli.main import main
main(sys.argv[1:])
"""


def blocked(*words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run a command where the extra is not installed."""
    environment = {**os.environ, "NO_COLOR": "1", "COLUMNS": "200"}
    command = [sys.executable, "-c", BLOCKED, *words]
    return subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, check=False)


def test_without_the_extra_the_command_that_installs_it_is_told(maps: list[str], tmp_path: Path) -> None:
    done = blocked(*maps, "--out", str(tmp_path / "track.csv"), cwd=tmp_path)
    quoted = " ".join(f'"{one}"' for one in REQUIREMENTS["gis"])
    assert done.returncode == 2 and "Traceback" not in done.stderr
    assert f"\n  python -m pip install {quoted}\n" in done.stderr
    assert "\n  python -m uv sync --extra gis\n" in done.stderr
    assert names(tmp_path) == ["maps"]


@pytest.mark.parametrize("words", [["track", "--help"], ["validate", "ryggfonn"], ["predict", "--help"]])
def test_without_the_extra_all_else_works(words: list[str], tmp_path: Path) -> None:
    done = blocked(*words, cwd=tmp_path)
    assert done.returncode == 0 and done.stderr == ""


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys; from skred.cli.main import run\n"
        "run(['track', '--help'])\n"
        "heavy = 'rasterio', 'pyogrio', 'shapely', 'pyproj', 'numpy', 'scipy', 'matplotlib', 'pymc'\n"
        "print([module for module in heavy if module in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip().endswith("[]")


def test_an_extra_is_what_the_message_installs() -> None:
    import tomllib

    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for extra, requirements in REQUIREMENTS.items():
        assert sorted(project["optional-dependencies"][extra]) == sorted(requirements)
