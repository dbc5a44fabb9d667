"""Reports made anew from the documents in a folder, by the same code as the command that wrote them."""

import json
import shutil

import pytest
import xarray as xr
from diagnosis_report_cases import documents, write_documents
from hierarchical_cases import hierarchical_calibration, hierarchical_comparison, hierarchical_ryggfonn
from page_checks import check_page
from report_cases import as_saved, calibration, comparison, ryggfonn
from test_report_html import Page

from skred.cli.main import run
from skred.inference.results import save
from skred.output import write_json
from skred.parallel.processes import helpers
from skred.physics.laws import load_law
from skred.report.diagnosis.places import places_figure, places_of
from skred.report.folders import ReportError, write_reports


@pytest.fixture(autouse=True)
def coarse_figures(monkeypatch):
    monkeypatch.setattr("skred.report.shared.style.DPI", 40)


def contents(folder):
    return {file.relative_to(folder): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


def deleted(folder):
    """Everything that is made from documents is taken away."""
    for file in [*folder.rglob("*.png"), *folder.rglob("*.html")]:
        file.unlink()


def write_comparison(folder, document, made, problem, where=""):
    write_json(folder / "compare.json", document)
    for model in (document["pooled"] if where else document)["models"]:
        place = folder / where / model["id"]
        place.mkdir(parents=True)
        law = load_law(model["id"])
        save(as_saved(made(problem, law), law, problem), place / "posterior.nc")


def test_figures_drawn_in_a_worker_are_the_same(tmp_path, monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    write_documents("cannot", tmp_path)
    with helpers("skred.report.diagnosis.page"):
        write_reports(tmp_path)
    shared = contents(tmp_path)
    deleted(tmp_path)
    write_reports(tmp_path)
    # The resolution is that of this process's test, or the worker's own.
    of_page = {name for name in shared if name.suffix == ".html"}
    assert of_page and all(shared[name] == contents(tmp_path)[name] for name in of_page)
    assert shared.keys() == contents(tmp_path).keys()


SLOW = [pytest.param(kind, marks=pytest.mark.slow) for kind in ("tie", "unexplained")]


@pytest.mark.parametrize("kind", ["cannot", *SLOW])
def test_a_diagnosis_is_reported_the_same_again(kind, tmp_path, capsys):
    write_documents(kind, tmp_path)
    written = write_reports(tmp_path)
    before = contents(tmp_path)
    assert {file.name for file in written} >= {"report.html", "where.png"}
    assert documents(kind)[0]["statement"] in Page((tmp_path / "report.html").read_text()).text
    deleted(tmp_path)
    assert run(["report", str(tmp_path)]) == 0
    assert contents(tmp_path) == before
    assert [line for line in capsys.readouterr().out.splitlines() if line] == [str(one) for one in written]


@pytest.mark.slow
def test_a_comparison_is_reported_the_same_again(tmp_path):
    write_comparison(tmp_path, comparison(), calibration, ryggfonn())
    write_reports(tmp_path)
    before = contents(tmp_path)
    names = {str(name) for name in before}
    assert {"report.html", "comparison_elpd.png", "pcm/trace.png", "pcm/along_track.png"} <= names
    assert Page((tmp_path / "report.html").read_text()).tags.count("svg") > 2 * 10
    deleted(tmp_path)
    assert run(["report", str(tmp_path), "--quiet"]) == 0
    assert contents(tmp_path) == before


@pytest.mark.slow
def test_a_hierarchical_comparison_has_figures_of_both(tmp_path):
    document = hierarchical_comparison()
    write_comparison(tmp_path, document, hierarchical_calibration, hierarchical_ryggfonn())
    write_comparison(tmp_path, document, calibration, ryggfonn(), "pooled")
    names = {str(file.relative_to(tmp_path)) for file in write_reports(tmp_path)}
    assert {"pcm/population.png", "pooled/pcm/predictive.png", "likelihoods.png"} <= names


@pytest.mark.parametrize("name", ["../elsewhere", "", ".", None, 3])
def test_a_law_leads_nowhere_else(name, tmp_path):
    document = comparison()
    document["models"][0]["id"] = name
    write_json(tmp_path / "compare.json", document)
    with pytest.raises(ReportError, match="no name of a law"):
        write_reports(tmp_path)


def test_a_calibration_gets_its_figures_and_no_others(tmp_path):
    law, problem = load_law("pcm"), ryggfonn()
    save(as_saved(calibration(problem, law), law, problem), tmp_path / "posterior.nc")
    write_json(tmp_path / "summary.json", {"format": 1})
    for name in ("population.png", "notes.png"):
        (tmp_path / name).write_bytes(b"earlier")
    names = {file.name for file in write_reports(tmp_path)} - {"report.html"}
    assert names == {"trace.png", "joint.png", "marginals.png", "predictive.png", "along_track.png"}
    assert len(check_page((tmp_path / "report.html").read_text()).all("figure")) == len(names)
    assert {file.name for file in tmp_path.glob("*.png")} == {*names, "notes.png"}


def test_what_is_no_folder_of_results_is_told(tmp_path, capsys):
    for folder in (tmp_path, tmp_path / "nowhere"):
        assert run(["report", str(folder)]) == 2
        assert str(folder) in capsys.readouterr().err


@pytest.mark.parametrize("broken", ["text", "old", "older", "new", "no curves", "old curves", "no netCDF"])
def test_what_this_version_cannot_read_is_told_and_left_alone(broken, tmp_path, capsys):
    write_documents("cannot", tmp_path)
    (tmp_path / "report.html").write_text("earlier")
    file, curves = tmp_path / "verdict.json", tmp_path / "diagnosis.nc"
    document = json.loads(file.read_text())
    if broken == "text":
        file.write_text("{")
    elif broken == "old":
        write_json(file, {key: value for key, value in document.items() if key != "report"})
    elif broken == "older":
        write_json(file, ["what was this?"])
    elif broken == "new":
        write_json(file, document | {"format": 2})
    elif broken == "no curves":
        curves.unlink()
    elif broken == "old curves":
        save(xr.DataTree(), curves)
    else:
        curves.write_bytes(b"no netCDF")
    before = contents(tmp_path)
    assert run(["report", str(tmp_path)]) == 2
    told = capsys.readouterr().err
    assert told.startswith("error: ") and ("another version" in told or "not" in told)
    assert contents(tmp_path) == before


@pytest.mark.slow
def test_a_figure_that_fails_leaves_everything_as_it_was(tmp_path):
    write_documents("tie", tmp_path)
    write_reports(tmp_path)
    before = contents(tmp_path)
    document, tree = documents("tie")
    shutil.copy(tmp_path / "verdict.json", tmp_path / "kept.json")
    without = tree.copy()
    without["held_out"] = xr.DataTree(tree["held_out"].to_dataset().drop_vars("low"))
    save(without, tmp_path / "diagnosis.nc")
    with pytest.raises(ReportError, match=r"diagnosis\.nc: not as skred writes it \(KeyError.*low"):
        write_reports(tmp_path)
    after = contents(tmp_path)
    assert {name for name in before if before[name] != after[name]} == {
        (tmp_path / "diagnosis.nc").relative_to(tmp_path)
    }
    assert document["verdict"] == json.loads((tmp_path / "kept.json").read_text())["verdict"]


@pytest.mark.parametrize("kind", ["physics", "instrument"])
def test_mechanisms_of_other_packages_are_drawn_where_they_act(kind):
    """Whatever their names: what has a place or a sensor of speed is drawn there."""
    document, tree = documents("tie")
    other = {"obstacle": "snow_fence", "sensor_bias": "icy_radar"}
    renamed = json.loads(
        json.dumps(document).replace("obstacle", "snow_fence").replace("sensor_bias", "icy_radar")
    )
    renamed["report"]["mechanisms"]["snow_fence"]["kind"] = kind
    shapes = tree["shapes"].to_dataset()
    names = [other.get(name, name) for name in map(str, shapes["mechanism"].values)]
    changed = tree.copy()
    changed["shapes"] = xr.DataTree(shapes.assign(mechanism=("shape", names)))
    places = places_of(changed, 0)
    assert {"snow_fence", "icy_radar"} <= set(places) and "turbulent_drag" not in places
    assert all(one.first_m <= one.last_m for shown in places.values() for one in shown)
    titles = [axes.get_title(loc="left") for axes in places_figure(renamed, changed, 0).axes]
    assert "an obstacle" in titles[list(places).index("snow_fence")].replace("snow_fence", "obstacle")
