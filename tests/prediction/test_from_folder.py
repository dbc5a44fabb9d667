"""Predictions from a folder: the same as with sampling, with what was added, and what is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from prediction_cases import folder_of, plane, term_of, tree_of

from skred.campaign import Status, find_campaign, read_campaign
from skred.cli.main import run
from skred.errors import InputError
from skred.inference.added_terms import added_group, added_terms
from skred.inference.gate import Gate
from skred.inference.hierarchical.problem import HierarchicalProblem, hierarchical_problem
from skred.inference.results import save
from skred.inference.sampling import SamplerSettings
from skred.inference.stored import read_stored
from skred.output import write_json
from skred.physics.laws import load_law
from skred.physics.mechanisms.spec import Shape
from skred.prediction.predict import Simulation, predict, prediction_of
from skred.prediction.source import source_of
from skred.prediction.statement import source_sentences
from skred.prediction.track import prediction_track
from skred.prediction.wanted import Wanted

SMALL = Simulation(30, 256)
STRETCH = Shape(1200.0, 1500.0)


@pytest.fixture(scope="module")
def problem() -> HierarchicalProblem:
    return hierarchical_problem(read_campaign(find_campaign("ryggfonn")))


def test_the_same_draws_predict_the_same(problem: HierarchicalProblem, tmp_path: Path) -> None:
    tree = tree_of(problem, "pcm")
    gate = Gate(1.001, 900.0, 800.0, 0, ())
    live = SimpleNamespace(
        law=load_law("pcm"), problem=problem, settings=SamplerSettings(), tree=tree, gate=gate
    )
    sampled, again = tmp_path / "sampled", tmp_path / "again"
    for folder in (sampled, again):
        folder.mkdir()
    wanted = Wanted((("house", 1830.0),))
    first = predict(live, sampled, simulation=SMALL, wanted=wanted)
    for kind, folder in (
        ("prediction", sampled),
        ("calibration", folder_of(tmp_path / "calibrated", tree)),
        ("diagnosis", folder_of(tmp_path / "diagnosed", tree, "verdict.json", "base.nc")),
    ):
        source = source_of(folder)
        assert source.kind == kind and "nothing added" in source.told
        stored = source.stored
        second = predict(stored.calibration, again, simulation=SMALL, wanted=wanted, source=source)
        # What a campaign says of itself is not in these folders' documents.
        told = {key: second["campaign"][key] for key in ("description", "source")}
        assert set(told.values()) == {""} or kind == "prediction"
        assert second["campaign"] == first["campaign"] | told and second["track"] == first["track"]
        for key in ("runout", "places", "at", "reading_errors", "gate"):
            assert json.dumps(second[key]) == json.dumps(first[key]), key
        assert second["from"]["kind"] == kind and second["statement"][0] == source.told
        assert (again / "places.csv").read_bytes() == (sampled / "places.csv").read_bytes()


def test_everything_recorded_comes_back(problem: HierarchicalProblem, tmp_path: Path) -> None:
    """Bounds, stated errors, uncertain releases and speeds there."""
    campaign = problem.campaign
    events = tuple(
        replace(
            event,
            release_s_m=10.0 * k,
            release_sd_m=5.0 if k % 2 else None,
            release_speed_m_s=3.0 if k == 4 else None,
            release_speed_sd_m_s=1.0 if k == 4 else None,
        )
        for k, event in enumerate(campaign.events)
    )
    status, values = campaign.status.copy(), campaign.values.copy()
    upper = np.full_like(values, np.nan)
    stated = campaign.stated_sd.copy()
    kinds = (Status.AT_LEAST, Status.AT_MOST, Status.BETWEEN)
    for k, kind in enumerate(kinds):
        status[k, 0], values[k, 0], stated[k, 0] = kind, 20.0, np.nan
    upper[2, 0] = 30.0
    changed = replace(
        campaign, events=events, status=status, values=values, stated_sd=stated, values_to=upper
    )
    other = replace(problem, campaign=changed)
    found = read_stored(folder_of(tmp_path / "made", tree_of(other, "pcm")) / "posterior.nc").problem
    assert repr(found.campaign.sensors) == repr(changed.sensors)  # NaN differs from itself
    for name in ("status", "stated_sd", "values_to"):
        np.testing.assert_array_equal(getattr(found.campaign, name), getattr(changed, name))
    known = np.isin(status, (Status.OBSERVED, *kinds))
    np.testing.assert_array_equal(found.campaign.values[known], values[known])
    for name, expected in other.releases._asdict().items():
        np.testing.assert_array_equal(getattr(found.releases, name), expected)
    np.testing.assert_array_equal(found.terrain.edge_s_m, other.terrain.edge_s_m)
    assert found.campaign.reference_s_m == campaign.reference_s_m


@pytest.mark.parametrize("elsewhere", [False, True])
def test_drag_added_to_coulomb_friction_is_pcm(
    problem: HierarchicalProblem, tmp_path: Path, elsewhere: bool
) -> None:
    """Two routes to one number, on the campaign's track and on another: drag acts along all of it."""
    term = term_of(problem, "coulomb", "turbulent_drag")
    track = prediction_track(problem, plane(tmp_path)) if elsewhere else prediction_track(problem)
    augmented = prediction_of(
        problem,
        load_law("coulomb"),
        tree_of(problem, "coulomb", [term], [0.003]),
        track,
        Simulation(60, 1024),
        added=[term],
    )
    pcm = prediction_of(problem, load_law("pcm"), tree_of(problem, "pcm"), track, Simulation(60, 1024))
    for name in ("arrival_probability", "runout_probability"):
        np.testing.assert_allclose(augmented[name], pcm[name], atol=0.01)
    np.testing.assert_allclose(augmented["mean_speed"], pcm["mean_speed"], atol=0.5)
    assert json.loads(augmented.attrs["added"])[0]["used"] is True


def test_what_begins_at_the_first_recording_acts_from_the_top_of_another_track(
    problem: HierarchicalProblem, tmp_path: Path
) -> None:
    """On its own track from there on; where that would be on another one nothing says."""
    whole, law = term_of(problem, "coulomb", "turbulent_drag"), load_law("coulomb")
    later = term_of(problem, "coulomb", "turbulent_drag", Shape(s_from_m=800.0))
    tree = tree_of(problem, "coulomb", [whole], [0.003])
    for track in (prediction_track(problem), prediction_track(problem, plane(tmp_path))):
        one, other = (
            prediction_of(problem, law, tree, track, Simulation(20, 256), added=[term])
            for term in (whole, later)
        )
        same = np.array_equal(one["runout_quantile"], other["runout_quantile"])
        assert same is not track.is_own
        (row,) = json.loads(other.attrs["added"])
        assert (row["used"], row["place_m"], row["begins_m"]) == (True, None, 800.0)
        made = {"from": None, "added": [row], "track": {"is_own": track.is_own}}
        (told,) = source_sentences(made)
        assert ("from s = 800 m on" if track.is_own else "along the whole track") in told
        force = row | {"mechanism": "unlisted", "place_m": [350.0, 1626.0], "begins_m": None}
        (told,) = source_sentences(made | {"added": [force]})
        assert "(s = 350 to 1626 m)" in told and "median of each end" not in told


@pytest.mark.slow
def test_what_is_bound_to_a_place_stays_on_its_track(
    problem: HierarchicalProblem, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    term = term_of(problem, "coulomb", "segment_friction", STRETCH)
    tree = tree_of(problem, "coulomb", [term], [3.0])
    folder = folder_of(tmp_path / "diagnosed", tree, "verdict.json", "augmented.nc")
    own, base = tmp_path / "own", tmp_path / "base"
    words = ["predict", "--quiet", "--at", "house=1900"]
    plain = folder_of(tmp_path / "plain", tree_of(problem, "coulomb"))
    assert run([*words, "--from", str(folder), "--out", str(own)]) == 0
    assert run([*words, "--from", str(plain), "--out", str(base)]) == 0
    with_it, without = (json.loads((one / "prediction.json").read_text()) for one in (own, base))
    assert with_it["at"][0]["reached"]["value"] < without["at"][0]["reached"]["value"] - 0.1
    assert with_it["added"][0]["used"] and "s = 1200 to 1500 m" in with_it["statement"][1]
    # On another track it is left out, which is said before any number.
    there = ["--track", str(plane(tmp_path)), "--at", "house=900"]
    left, same = tmp_path / "left", tmp_path / "same"
    for out, source in ((left, folder), (same, plain)):
        assert run(["predict", "--from", str(source), "--out", str(out), "--quiet", *there]) == 0
    one, two = (json.loads((out / "prediction.json").read_text()) for out in (left, same))
    assert one["at"] == two["at"] and one["runout"] == two["runout"]
    assert "Left out" in one["statement"][1] and "does not transfer" in one["statement"][1]
    assert "Left out" in (left / "report.html").read_text(encoding="utf-8")
    capsys.readouterr()
    words = ["predict", "--from", str(folder), "--out", str(left), "--force", *there]
    assert run(words) == 0
    said = capsys.readouterr().out
    assert said.index("Left out: ") < said.index("runout exceeded by") and said.count("Left out: ") == 1


def test_faults_of_instruments_move_no_front(problem: HierarchicalProblem) -> None:
    sensor = problem.campaign.sensors[0].id
    bias = term_of(problem, "coulomb", "sensor_bias", Shape(sensor=sensor))
    offset = term_of(problem, "coulomb", "release_offset")
    law = load_law("coulomb")
    tree = tree_of(problem, "coulomb", [bias, offset], [0.3, 40.0])
    recorded, given = prediction_track(problem), prediction_track(problem, None, 40.0)
    plain = prediction_of(problem, law, tree_of(problem, "coulomb"), given, SMALL)
    for track in (recorded, given):
        found = prediction_of(problem, law, tree, track, SMALL, added=[bias, offset])
        used = [row["used"] for row in json.loads(found.attrs["added"])]
        assert used == [False, track is recorded]
        # Recorded at 0 m and 40 m too high is a release at 40 m.
        np.testing.assert_allclose(found["runout_quantile"], plain["runout_quantile"], atol=1e-6)


@pytest.mark.parametrize("elsewhere", [False, True])
def test_friction_that_depends_on_a_property_goes_with_the_avalanches(
    problem: HierarchicalProblem, tmp_path: Path, elsewhere: bool
) -> None:
    """As the mean over what the recorded avalanches have, one by one."""
    term = term_of(problem, "coulomb", "covariate_friction", Shape(covariate="made_up"))
    shifts = term.direction.log_strengths
    assert shifts is not None
    law, track = load_law("coulomb"), prediction_track(problem)
    if elsewhere:
        track = prediction_track(problem, plane(tmp_path), 20.0)
    tree = tree_of(problem, "coulomb", [term], [0.3])
    found = prediction_of(problem, law, tree, track, Simulation(20, 4096), added=[term])
    expected = []
    for shift in shifts:
        one = tree_of(problem, "coulomb")
        posterior = one["posterior"].to_dataset()
        posterior["dry_friction"] = posterior["dry_friction"] * np.exp(0.3 * shift)
        one["posterior"] = posterior
        expected.append(prediction_of(problem, law, one, track, Simulation(20, 256))["arrival_probability"])
    np.testing.assert_allclose(found["arrival_probability"], np.mean(expected, axis=0), atol=0.02)


def test_terms_survive_a_file(problem: HierarchicalProblem, tmp_path: Path) -> None:
    terms = [
        term_of(problem, "coulomb", "segment_friction", STRETCH),
        term_of(problem, "coulomb", "covariate_friction", Shape(covariate="made_up")),
        term_of(problem, "coulomb", "release_offset"),
    ]
    save(xr.DataTree.from_dict({"added": added_group(terms)}), tmp_path / "terms.nc")
    with xr.open_datatree(tmp_path / "terms.nc", engine="h5netcdf") as tree:
        found = added_terms(tree)
    for one, other in zip(found, terms, strict=True):
        for name in ("name", "mechanism", "title", "group", "bound_to", "shape", "transfers"):
            assert getattr(one, name) == getattr(other, name)
        assert one.direction.columns == other.direction.columns
        assert one.direction.release == other.direction.release
        np.testing.assert_array_equal(one.direction.profiles, other.direction.profiles)


def test_folders_that_are_no_source(problem: HierarchicalProblem, tmp_path: Path) -> None:
    tree = tree_of(problem, "coulomb")
    with pytest.raises(InputError, match="no such folder"):
        source_of(tmp_path / "nowhere")
    with pytest.raises(InputError, match=r"expected a folder written by skred"):
        source_of(tmp_path)
    compared = tmp_path / "compared"
    compared.mkdir()
    write_json(compared / "compare.json", {"format": 1})
    with pytest.raises(InputError, match="one of them inside"):
        source_of(compared)
    unexplained = folder_of(tmp_path / "unexplained", tree, "verdict.json", "base.nc")
    write_json(unexplained / "verdict.json", {"format": 1, "verdict": "unexplained"})
    with pytest.raises(InputError, match="no draws of it"):
        source_of(unexplained)
    new = folder_of(tmp_path / "new", tree)
    write_json(new / "summary.json", {"format": 2})
    with pytest.raises(InputError, match="another version"):
        source_of(new)
    (new / "summary.json").write_text("{")
    with pytest.raises(InputError, match="not a JSON document"):
        source_of(new)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"format": 1}, "another version"),
        ({"likelihood": "pooled"}, "--likelihood hierarchical"),
        ({"equation": "a = b"}, "another equation"),
        ({"law": "no_such_law"}, "no_such_law"),
        ({"gate": "{}"}, "older version"),
    ],
)
def test_draws_that_cannot_be_used(
    problem: HierarchicalProblem, tmp_path: Path, changes: dict[str, object], expected: str
) -> None:
    tree = tree_of(problem, "coulomb")
    tree.attrs |= changes
    with pytest.raises(InputError, match=expected):
        source_of(folder_of(tmp_path / "made", tree))


def test_files_that_are_not_netcdf(tmp_path: Path) -> None:
    write_json(tmp_path / "summary.json", {"format": 1})
    with pytest.raises(InputError, match="not there"):
        source_of(tmp_path)
    (tmp_path / "posterior.nc").write_bytes(b"\x80\x04 a pickle")
    with pytest.raises(InputError, match="not a netCDF file"):
        source_of(tmp_path)


@pytest.mark.parametrize(
    "words", [["ryggfonn"], ["--base-model", "pcm"], ["--errors", "normal"], ["--seed", "3"]]
)
def test_nothing_is_calibrated_beside_a_folder(
    words: list[str], problem: HierarchicalProblem, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = folder_of(tmp_path / "made", tree_of(problem, "coulomb"))
    assert run(["predict", *words, "--from", str(folder), "--out", str(tmp_path / "out")]) == 2
    assert "the calibration is made already" in " ".join(capsys.readouterr().err.split())
