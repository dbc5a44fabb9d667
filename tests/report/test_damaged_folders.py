"""Damaged folders of results are told by file; a fault of skred on good ones stays one; nothing leads out."""

import json
import shutil

import numpy as np
import pytest
import xarray as xr
from diagnosis_report_cases import write_documents
from report_cases import as_saved, calibration, comparison, ryggfonn

from skred.cli.main import run
from skred.inference.results import save
from skred.output import UNFINISHED, write_json
from skred.physics.laws import load_law
from skred.report.folders import ReportError, write_reports

HUGE = 10**400
pytestmark = pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of what is no number


@pytest.fixture(autouse=True)
def coarse_figures(monkeypatch):
    monkeypatch.setattr("skred.report.shared.style.DPI", 40)


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    """A calibration that nothing was done to."""
    folder, law, problem = tmp_path_factory.mktemp("good"), load_law("pcm"), ryggfonn()
    save(as_saved(calibration(problem, law), law, problem), folder / "posterior.nc")
    write_json(folder / "summary.json", {"format": 1})
    return folder


def contents(folder):
    return {file.relative_to(folder): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


def refused(folder, file, capsys):
    """Told by its file and with what to do, and nothing has changed."""
    before = contents(folder)
    assert run(["report", str(folder)]) == 2
    told = capsys.readouterr().err
    assert told.startswith("error: ") and str(folder / file) in told
    assert "run the command that wrote it again" in told
    assert contents(folder) == before
    return told


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("settings", "fast"),
        ("report", {"format": 1, "mechanisms": "many"}),
        ("refits", HUGE),
        ("seconds", float("nan")),
        ("seconds", -float("inf")),
        ("seconds", [[{"deep": HUGE}]]),
    ],
    ids=str,
)
def test_a_damaged_document_is_told(key, value, tmp_path, capsys):
    write_documents("cannot", tmp_path)
    document = json.loads((tmp_path / "verdict.json").read_text())
    (tmp_path / "verdict.json").write_text(json.dumps(document | {key: value}))
    refused(tmp_path, "verdict.json", capsys)


@pytest.mark.parametrize("document", [{"valid": False}, {"valid": False, "added": [3]}, {"valid": None}])
def test_a_prediction_without_its_keys_is_told(document, tmp_path, capsys):
    write_json(tmp_path / "prediction.json", {"format": 1} | document)
    refused(tmp_path, "prediction.json", capsys)


def without(name):
    return lambda tree: tree.drop_nodes(name)


def no_status(tree):
    tree["constant_data"] = xr.DataTree(tree["constant_data"].to_dataset().drop_vars("status"))
    return tree


def no_law(tree):
    del tree.attrs["law"]
    return tree


def endless(tree):
    for name in tree["posterior"].data_vars:
        tree["posterior"][name][:] = np.inf
    return tree


@pytest.mark.parametrize(
    "damage", [without("constant_data"), without("posterior"), no_status, no_law, endless]
)
def test_damaged_draws_are_told(damage, good, tmp_path, capsys):
    shutil.copy(good / "summary.json", tmp_path)
    with xr.open_datatree(good / "posterior.nc", engine="h5netcdf") as tree:
        damage(tree.load()).to_netcdf(tmp_path / "posterior.nc", engine="h5netcdf")
    refused(tmp_path, "posterior.nc", capsys)


def faulty(*_):
    raise TypeError("ours")


def test_a_fault_of_skred_stays_one(tmp_path, capsys, monkeypatch):
    write_documents("cannot", tmp_path)
    write_reports(tmp_path)
    monkeypatch.setattr("skred.report.diagnosis.report.render_diagnosis", faulty)
    assert run(["report", str(tmp_path)]) == 3
    assert "a fault of skred, not of the input (TypeError: ours)" in capsys.readouterr().err
    changed = json.loads((tmp_path / "verdict.json").read_text()) | {"seconds": 1.0}
    write_json(tmp_path / "verdict.json", changed)
    told = refused(tmp_path, "verdict.json", capsys)
    assert "TypeError: ours" in told and "If nobody has changed it, that is a fault of skred" in told


def test_a_fault_is_one_on_what_a_run_has_just_written(tmp_path, monkeypatch):
    folder = tmp_path / UNFINISHED
    folder.mkdir()
    write_documents("cannot", folder)
    monkeypatch.setattr("skred.report.diagnosis.report.render_diagnosis", faulty)
    with pytest.raises(TypeError, match="ours"):
        write_reports(folder)


def test_a_full_disk_is_no_damage(tmp_path, monkeypatch):
    write_documents("cannot", tmp_path)

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("skred.report.diagnosis.report.render_diagnosis", full)
    with pytest.raises(OSError, match="No space"):
        write_reports(tmp_path)


@pytest.mark.parametrize("link", ["pcm", "pooled"])
def test_a_link_leads_nowhere_else(link, good, tmp_path):
    folder, target = tmp_path / "results", tmp_path / "target"
    shutil.copytree(good, target / "pcm")
    shutil.copy(good / "posterior.nc", target)
    for name in ("events.png", "pcm/events.png"):
        (target / name).write_bytes(b"of another")
    document = {"format": 1, "models": [], "pooled": {"models": [{"id": "pcm"}]}}
    folder.mkdir()
    write_json(folder / "compare.json", comparison() if link == "pcm" else document)
    (folder / link).symlink_to("../target", target_is_directory=True)
    before = contents(target)
    with pytest.raises(ReportError, match=rf"results/{link}(/pcm)?: a link, not a folder of results"):
        write_reports(folder)
    assert contents(target) == before and not list(folder.glob("*.png"))


def test_the_folder_itself_may_be_a_link(tmp_path):
    (tmp_path / "real").mkdir()
    write_documents("cannot", tmp_path / "real")
    (tmp_path / "link").symlink_to("real", target_is_directory=True)
    assert tmp_path / "link" / "report.html" in write_reports(tmp_path / "link")


def test_a_folder_in_the_way_is_told_before_anything_is_replaced(tmp_path, capsys):
    write_documents("cannot", tmp_path)
    (tmp_path / "report.html").mkdir()
    before = contents(tmp_path)
    assert run(["report", str(tmp_path)]) == 2
    assert "report.html: a folder is where this file is to go" in capsys.readouterr().err
    assert contents(tmp_path) == before
