"""Predictions: against closed forms and independent draws, and what is written, also when it goes wrong."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.special import ndtr, ndtri

from skred.campaign import CampaignError, find_campaign, read_campaign
from skred.cli.main import run
from skred.errors import InputError
from skred.inference.calibrate import calibrate
from skred.inference.error_model import ERROR_MODELS
from skred.inference.gate import Gate
from skred.inference.hierarchical.event_draws import fronts_of, new_avalanches
from skred.inference.hierarchical.problem import HierarchicalProblem, hierarchical_problem
from skred.inference.recorded_data import recorded_groups
from skred.inference.sampling import SamplerSettings
from skred.physics.kernel.columns import GRAVITY
from skred.physics.laws import load_law
from skred.prediction.document import prediction_document
from skred.prediction.files import AT_TABLE, FILES
from skred.prediction.predict import Simulation, predict, prediction_of
from skred.prediction.probabilities import PARTS, SHARES
from skred.prediction.reading_errors import reading_error
from skred.prediction.track import PredictionTrack, prediction_track
from skred.report.folders import write_reports
from skred.report.prediction.figures import prediction_figure, prediction_table, uncertainty_figure

N_CHAINS, N_DRAWS = 2, 40
GOOD = Gate(1.001, 900.0, 800.0, 0, ())
BAD = replace(GOOD, problems=("r-hat 1.2 exceeds 1.01: more --tune",))
NORMAL = ERROR_MODELS["normal"]
ROBUST = 1.0 + 0.5 * (0.002 + 0.02) * (6.0**2 - 1.0)
"""Variance of the default error model, in stated variances: a few outliers six times as wide."""
CENTRES = {
    "constant": {"retardation": (4.6, 0.05), "retardation_spread": (0.25, 0.15)},
    "pcm": {
        "dry_friction": (0.31, 0.07),
        "turbulent_drag": (0.003, 0.2),
        "dry_friction_spread": (0.22, 0.2),
        "turbulent_drag_spread": (0.7, 0.2),
        "dry_friction_turbulent_drag_correlation": (0.2, 0.1),
    },
}
"""Median and log standard deviation of made-up posteriors."""


def tree_of(problem: HierarchicalProblem, law_id: str, gate: Gate = GOOD, seed: int = 3) -> xr.DataTree:
    """A posterior made up, with what `assemble` writes beside it."""
    rng = np.random.default_rng(5)
    shape = (N_CHAINS, N_DRAWS)
    posterior = xr.Dataset(
        {
            name: (("chain", "draw"), median * np.exp(sd * rng.standard_normal(shape)))
            for name, (median, sd) in CENTRES[law_id].items()
        },
        coords={"chain": range(N_CHAINS), "draw": range(N_DRAWS)},
    )
    tree = xr.DataTree.from_dict({"posterior": posterior})
    tree.attrs = {
        "law": law_id,
        "campaign": problem.campaign.name,
        "campaign_fingerprint": problem.campaign.fingerprint(),
        "smoothing_m": problem.terrain.smoothing_m,
        "settings": "{}",
        "seed": seed,
        "gate": json.dumps(gate.as_dict()),
        "versions": json.dumps({"skred": "0"}),
    }
    return tree


@pytest.fixture(scope="module")
def problem() -> HierarchicalProblem:
    return hierarchical_problem(read_campaign(find_campaign("ryggfonn")))


@pytest.fixture(scope="module")
def prediction(problem: HierarchicalProblem) -> xr.Dataset:
    """PCM on the campaign's own track."""
    return predicted(problem, "pcm", prediction_track(problem))


def predicted(
    problem: HierarchicalProblem, law_id: str, track: PredictionTrack, avalanches: int = 512, seed: int = 3
) -> xr.Dataset:
    tree = tree_of(problem, law_id, seed=seed)
    return prediction_of(problem, load_law(law_id), tree, track, Simulation(60, avalanches))


def concave(folder: Path, name: str = "track.csv") -> Path:
    """A parabola whose mean slope from the first point falls all the way."""
    x = np.linspace(0.0, 1500.0, 301)
    z = 900.0 - 1.1 * x + 0.0004 * x**2
    file = folder / name
    rows = [f"{a:.4f},{b:.6f}" for a, b in zip(x, z, strict=True)]
    file.write_text("\n".join(["x_m,z_m", *rows]) + "\n")
    return file


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory, problem: HierarchicalProblem) -> Any:
    """Constant retardation on the parabola, and what is known of it."""
    track = prediction_track(problem, concave(tmp_path_factory.mktemp("plain")))
    data = predicted(problem, "constant", track, avalanches=1024)
    posterior = tree_of(problem, "constant")["posterior"]
    chosen = np.unique(np.linspace(0, N_CHAINS * N_DRAWS - 1, 60).astype(int))
    mean = np.log(posterior["retardation"].values.ravel()[chosen])
    sd = posterior["retardation_spread"].values.ravel()[chosen]
    steps = track.terrain.sin_slope * np.diff(track.terrain.edge_s_m)
    fall = np.interp(data["s"], track.terrain.edge_s_m, [0.0, *steps.cumsum()])
    return SimpleNamespace(data=data, track=track, mean=mean, sd=sd, fall=fall)


def below(plain: Any, retardation: np.ndarray) -> np.ndarray:
    """P(b < value) by population, (n_populations, ...)."""
    shape = (-1, *([1] * np.ndim(retardation)))
    with np.errstate(divide="ignore"):
        return ndtr(
            (np.log(np.maximum(retardation, 0.0)) - plain.mean.reshape(shape)) / plain.sd.reshape(shape)
        )


def assert_banded(data: xr.Dataset, name: str, by_population: np.ndarray, atol: float) -> None:
    low, high = np.quantile(by_population, [0.05, 0.95], axis=0)
    for found, expected in ((name, by_population.mean(axis=0)), (f"{name}_low", low), (f"{name}_high", high)):
        np.testing.assert_allclose(data[found], expected, atol=atol)


def test_exceedance_of_speed_in_closed_form(plain: Any) -> None:
    """Constant retardation: U^2/2 = g fall - b s, whatever the shape of the track."""
    s, u = plain.data["s"].values[1:, None], plain.data["speed"].values
    expected = below(plain, (GRAVITY * plain.fall[1:, None] - 0.5 * u**2) / s)
    assert_banded(plain.data.isel(s=slice(1, None)), "speed_probability", expected, atol=0.004)
    assert (plain.data["speed_probability"][0] == 0.0).all()


def test_exceedance_of_runout_in_closed_form(plain: Any) -> None:
    """A front passes s where b s < g fall: on this track the ratio only falls."""
    ratio = GRAVITY * plain.fall[1:] / plain.data["s"].values[1:]
    assert (np.diff(ratio) < 0.0).all()
    expected = below(plain, ratio)
    assert_banded(plain.data.isel(s=slice(1, None)), "runout_probability", expected, atol=0.004)
    assert_banded(plain.data.isel(s=slice(1, None)), "arrival_probability", expected, atol=0.004)


def test_quantiles_in_closed_form(plain: Any) -> None:
    s, top = plain.data["s"].values, plain.track.length_m
    ratio = GRAVITY * plain.fall[1:] / s[1:]
    for k, share in enumerate(SHARES):
        slow = np.exp(plain.mean + plain.sd * ndtri(share))
        stops = np.interp(-slow, -ratio, s[1:])
        tolerance = 4.0 if share >= 0.1 else 25.0
        np.testing.assert_allclose(
            [plain.data["runout_quantile_low"][k], plain.data["runout_quantile_high"][k]],
            np.minimum(np.quantile(stops, [0.05, 0.95]), top),
            atol=tolerance,
        )
        at = 40
        speeds = np.sqrt(np.maximum(2.0 * (GRAVITY * plain.fall[at] - slow * s[at]), 0.0))
        low, high = (float(plain.data[f"speed_quantile_{end}"][at, k]) for end in ("low", "high"))
        np.testing.assert_allclose([low, high], np.quantile(speeds, [0.05, 0.95]), atol=0.3)


def test_uncertainty_parts_against_fine_quadrature(plain: Any, problem: HierarchicalProblem) -> None:
    nodes = ndtri((np.arange(4000) + 0.5) / 4000)
    b = np.exp(plain.mean[:, None] + plain.sd[:, None] * nodes)
    s, data = plain.data["s"].values, plain.data
    for at in (20, 40, 55):
        square = 2.0 * (GRAVITY * plain.fall[at] - b * s[at])
        comes = square > 0.0
        speed = np.sqrt(np.where(comes, square, 0.0))
        number = comes.sum(axis=1)
        mean = speed.sum(axis=1) / number
        within = (speed**2).sum(axis=1) / number - mean**2
        overall = np.average(mean, weights=number)
        expected = {
            "parameter": np.sqrt(np.average((mean - overall) ** 2, weights=number)),
            "event": np.sqrt(np.average(within, weights=number)),
            "residual": np.sqrt(ROBUST * (0.1**2 * (speed**2).sum() / number.sum() + 1.0)),
        }
        assert float(data["mean_speed"][at]) == pytest.approx(overall, rel=0.01)
        for part, value in expected.items():
            assert float(data[f"speed_sd_{part}"][at]) == pytest.approx(value, rel=0.04), (at, part)


def test_new_avalanches_of_the_calibration_arrive_as_often(
    problem: HierarchicalProblem, prediction: xr.Dataset
) -> None:
    """Two routes to one number: the event draws of a calibration's own predictive group."""
    law = load_law("pcm")
    posterior = tree_of(problem, "pcm")["posterior"]
    samples = {p.name: np.tile(posterior[p.name].values.ravel(), 15) for p in problem.parameters(law)}
    fronts = fronts_of(problem, law, new_avalanches(problem, law, samples, np.random.default_rng(1)))
    reference = fronts.reshape(-1, fronts.shape[-1])
    at = prediction.sel(s=[1650.0, 1810.0, 1910.0])
    np.testing.assert_allclose(at["arrival_probability"], (reference[:, :3] > 0.0).mean(axis=0), atol=0.02)
    faster = at["speed_probability"].sel(speed=20.0)
    np.testing.assert_allclose(faster, (reference[:, :3] > 20.0).mean(axis=0), atol=0.02)
    beyond = (reference[:, 3] > 1940.0).mean()
    assert float(prediction["runout_probability"].sel(s=1940.0)) == pytest.approx(beyond, abs=0.02)


def test_probabilities_fall_with_speed_and_place(prediction: xr.Dataset) -> None:
    for end in ("", "_low", "_high"):
        assert (prediction[f"speed_probability{end}"].diff("speed") <= 1e-12).all()
        assert (prediction[f"runout_probability{end}"].diff("s") <= 1e-12).all()
        assert (prediction[f"speed_quantile{end}"].diff("share") >= 0.0).all()
        assert (prediction[f"runout_quantile{end}"].diff("share") >= 0.0).all()
    arrival, lowest = prediction["arrival_probability"], prediction["speed_probability"].isel(speed=0)
    assert (lowest <= arrival + 1e-12).all()


def test_bands_contain_the_mean(prediction: xr.Dataset) -> None:
    """Where it is not so rare that nearly all populations lie on one side of it."""
    for name in ("speed_probability", "runout_probability", "arrival_probability"):
        value = prediction[name]
        usual = (value > 0.02) & (value < 0.98)
        inside = (prediction[f"{name}_low"] <= value) & (value <= prediction[f"{name}_high"])
        assert inside.where(usual, True).all() and int(usual.sum()) > 20


def test_parts_add_up_to_the_total(prediction: xr.Dataset) -> None:
    for what in ("speed", "runout", "long_runout"):
        total = sum(prediction[f"{what}_sd_{part}"] ** 2 for part in PARTS)
        np.testing.assert_allclose(prediction[f"{what}_sd_total"] ** 2, total, rtol=1e-9)
    assert float(prediction["long_runout_sd_event"]) < float(prediction["runout_sd_event"])


def test_more_avalanches_of_each_population_leave_the_bands(
    problem: HierarchicalProblem, prediction: xr.Dataset
) -> None:
    more = predicted(problem, "pcm", prediction_track(problem), avalanches=2048)
    for name in ("runout_probability", "speed_probability"):
        for end in ("", "_low", "_high"):
            common = np.intersect1d(prediction["speed"], more["speed"])
            pair = [d[f"{name}{end}"].sel(speed=common) if name.startswith("speed") else d[f"{name}{end}"]
                    for d in (prediction, more)]  # fmt: skip
            np.testing.assert_allclose(*pair, atol=0.02)
    noise = json.loads(more.attrs["simulation"])
    assert noise["largest_error_of_a_probability"] < 0.01
    assert noise["share_of_band_variance"] < 0.05


def test_seeds_reproduce(problem: HierarchicalProblem, prediction: xr.Dataset) -> None:
    track = prediction_track(problem)
    assert predicted(problem, "pcm", track).identical(prediction)
    other = predicted(problem, "pcm", track, seed=4)
    assert not np.array_equal(other["runout_quantile"], prediction["runout_quantile"])


def test_several_uncertain_releases(problem: HierarchicalProblem) -> None:
    """Half of the avalanches start further down, and are not seen above."""
    events = tuple(
        replace(event, release_s_m=700.0 * (k % 2), release_sd_m=5.0)
        for k, event in enumerate(problem.campaign.events)
    )
    changed = replace(problem, campaign=replace(problem.campaign, events=events))
    track = prediction_track(changed)
    assert "0 to 700 m, known to 5 m" in track.release_text
    data = predicted(changed, "constant", track)
    apart = [predicted(problem, "constant", prediction_track(problem, None, s)) for s in (0.0, 700.0)]
    assert float(apart[1]["arrival_probability"].sel(s=400.0)) == 0.0
    for name in ("arrival_probability", "runout_probability"):
        for s in (400.0, 800.0, 1940.0):
            expected = np.mean([float(one[name].sel(s=s)) for one in apart])
            assert float(data[name].sel(s=s)) == pytest.approx(expected, abs=0.02), (name, s)


def test_nothing_moves(problem: HierarchicalProblem, tmp_path: Path) -> None:
    """Friction that holds every front at the release: probabilities of 0, no NaN, and it is said."""
    file = tmp_path / "flat.csv"
    file.write_text("x_m,z_m\n0,2\n500,1\n1000,0\n")
    track = prediction_track(problem, file)
    data = predicted(problem, "constant", track)
    assert (data["speed_probability"] == 0.0).all() and (data["arrival_probability"] == 0.0).all()
    assert (data["runout_quantile"] == 0.0).all()
    assert all(np.isfinite(v).all() for name, v in data.items() if not name.startswith(("mean_", "speed_sd")))
    document = prediction_document(made(problem, "constant"), track, data)
    assert any(">99.9 % do not start" in line for line in document["statement"])
    tree = xr.DataTree.from_dict({"/": data, **recorded_groups(problem)})
    prediction_figure(document, tree)
    uncertainty_figure(document, tree)


def made(problem: HierarchicalProblem, law_id: str, gate: Gate = GOOD) -> Any:
    tree = tree_of(problem, law_id, gate)
    return SimpleNamespace(
        law=load_law(law_id), problem=problem, settings=SamplerSettings(seed=3), tree=tree, gate=gate
    )


def test_runout_that_reaches_the_end_is_at_least_that(problem: HierarchicalProblem, tmp_path: Path) -> None:
    file = tmp_path / "steep.csv"
    file.write_text("x_m,z_m\n0,1000\n300,700\n600,400\n900,100\n")
    track = prediction_track(problem, file, 20.0)
    data = predicted(problem, "constant", track)
    document = prediction_document(made(problem, "constant"), track, data)
    end = document["runout"]["end_of_track"]
    assert end["value"] > 0.9 and end["s_m"] == track.length_m
    assert all(row["at_least"] for row in document["runout"]["exceeded_by"])
    said = " ".join(document["statement"])
    assert "to the end of the track" in said and "their runout is at least that" in said
    assert "s = 20 m" in said and "assumes" in said and "not per year" in said


def test_errors_of_readings(problem: HierarchicalProblem) -> None:
    velocity = reading_error(problem.campaign, NORMAL, runout=False)
    assert velocity[:2] == (0.1, 1.0)
    assert float(velocity.variance(400.0)) == pytest.approx(0.01 * 400.0 + 1.0)
    runout = reading_error(problem.campaign, NORMAL, runout=True)
    assert runout[:2] == (0.0, pytest.approx(14.42))  # the median of what the recordings state
    none = replace(problem.campaign, stated_sd=np.full_like(problem.campaign.stated_sd, np.nan))
    assert reading_error(none, NORMAL, runout=True)[:2] == (0.0, 12.0)


@pytest.mark.parametrize("name", ERROR_MODELS)
def test_error_of_a_reading_is_the_error_model_s(problem: HierarchicalProblem, name: str) -> None:
    model, is_velocity = ERROR_MODELS[name], np.array([True])
    drawn = model.draw(np.zeros((200_000, 1)), np.full(1, 3.0), is_velocity, np.random.default_rng(4))
    error = reading_error(problem.campaign, model, runout=False)
    assert float(error.variance(800.0)) == pytest.approx(drawn.var(), rel=0.1 if name == "student" else 0.02)


def test_files(problem: HierarchicalProblem, tmp_path: Path) -> None:
    document = predict(made(problem, "pcm"), tmp_path, simulation=Simulation(30, 64))
    assert {file.name for file in tmp_path.iterdir()} == {*FILES, "posterior.nc"}
    band = ["probability", "low", "high"]
    parts = [f"sd_{part}_m_s" for part in ("parameter", "event", "residual", "total")]
    columns = {
        "exceedance.csv": ["s_m", "x_m", "z_m", "speed_m_s", *band],
        "runout.csv": ["s_m", "x_m", "z_m", *band],
        "uncertainty.csv": ["s_m", "arrival_probability", "mean_speed_m_s", *parts],
    }
    for name, expected in columns.items():
        with (tmp_path / name).open(newline="") as file:
            rows = list(csv.DictReader(file))
        assert list(rows[0]) == expected
        assert all(float(value) >= 0.0 for row in rows for value in row.values() if value)
    written = json.loads((tmp_path / "prediction.json").read_text())
    assert written["valid"] and written["gate"]["passed"] and written["track"]["reference_s_m"] == 1940.0
    assert [place["name"] for place in written["places"]] == ["LC", "CD", "b", "reference"]
    with xr.open_datatree(tmp_path / "prediction.nc", engine="h5netcdf") as tree:
        data = tree.to_dataset().load()
    assert data["speed_probability"].dims == ("s", "speed")
    assert data["mean_speed"].attrs["units"] == "m s-1" and data["x"].attrs["units"] == "m"
    for name in ("campaign_fingerprint", "seed", "versions", "settings", "law", "gate", "release"):
        assert name in data.attrs
    assert prediction_table(document).row_count == 3 + 8 * 4
    figures = write_reports(tmp_path)
    drawn = {file.name: file.read_bytes() for file in figures}
    names = {f"{name}.{kind}" for name in ("prediction", "uncertainty", "places") for kind in ("png", "svg")}
    assert set(drawn) == {*names, "report.html"}
    for file in figures:
        file.unlink()
    assert run(["report", str(tmp_path)]) == 0
    assert {name: (tmp_path / name).read_bytes() for name in drawn} == drawn


def test_another_track(problem: HierarchicalProblem, tmp_path: Path) -> None:
    track = prediction_track(problem, concave(tmp_path, "other.csv"))
    out = tmp_path / "out"
    out.mkdir()
    document = predict(made(problem, "constant"), out, track, simulation=Simulation(30, 64))
    assert {file.name for file in out.iterdir()} == {*FILES, "posterior.nc"} - {AT_TABLE}
    assert document["places"] == [] and document["track"]["name"] == "other.csv"
    assert any("because no --release was given" in line for line in document["statement"])
    assert track.terrain.smoothing_m == problem.terrain.smoothing_m


def test_a_failed_gate_claims_nothing_and_leaves_nothing_older(
    problem: HierarchicalProblem, tmp_path: Path
) -> None:
    for name in FILES:
        (tmp_path / name).write_text("older")
    document = predict(made(problem, "pcm", BAD), tmp_path)
    assert {file.name for file in tmp_path.iterdir()} == {"posterior.nc", "prediction.json"}
    written = json.loads((tmp_path / "prediction.json").read_text())
    assert not written["valid"] and written["runout"] is None and written["places"] is None
    assert len(document["statement"]) == 1 and "r-hat 1.2" in document["statement"][0]
    assert prediction_table(document).row_count == 1


def test_a_calibration_of_few_draws(problem: HierarchicalProblem, tmp_path: Path) -> None:
    """From sampling to files, with a sampler that cannot have converged."""
    lines: list[str] = []
    settings = SamplerSettings(draws=20, tune=50, chains=2, seed=1)
    calibration = calibrate(problem, load_law("constant"), settings)
    document = predict(calibration, tmp_path, tell=lines.append)
    assert not document["gate"]["passed"] and not document["valid"]
    assert any("the chains did not converge" in line for line in lines)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("x_m,z_m\n0,100\n10,90\n5,80\n20,70\n", ["row 4", "x_m"]),
        ("x_m,z_m\n0,100\n10,ninety\n20,80\n", ["row 3", "z_m", "ninety"]),
        ("x_m,height\n0,100\n10,90\n20,80\n", ["height"]),
        ("x_m,z_m\n0,100\n10,90\n", ["at least 3"]),
        ("x_m,z_m\n0,100\n10,110\n20,120\n", ["row 4", "z_m", "downhill"]),
        ("x_m,z_m,width_m\n0,100,5\n10,90,-5\n20,80,5\n", ["row 3", "width_m"]),
        ("", ["empty"]),
    ],
)
def test_bad_tracks(problem: HierarchicalProblem, tmp_path: Path, text: str, expected: list[str]) -> None:
    file = tmp_path / "bad.csv"
    file.write_text(text)
    with pytest.raises(CampaignError) as error:
        prediction_track(problem, file)
    for word in ("bad.csv", *expected):
        assert word in str(error.value)


def test_no_such_track(problem: HierarchicalProblem, tmp_path: Path) -> None:
    for file in (tmp_path / "none.csv", tmp_path, Path("\0")):
        with pytest.raises(CampaignError):
            prediction_track(problem, file)
    long = tmp_path / "long.csv"
    long.write_text("x_m,z_m\n0,100\n1e6,90\n1e8,80\n")
    with pytest.raises(InputError, match="cells"):
        prediction_track(problem, long)


@pytest.mark.parametrize("release", [-1.0, 1e6, float("nan"), 2363.7])
def test_a_release_lies_on_the_track(problem: HierarchicalProblem, release: float) -> None:
    with pytest.raises(InputError, match="--release"):
        prediction_track(problem, None, release)
    assert prediction_track(problem, None, 30.0).releases.mean.tolist() == [30.0]


@pytest.mark.parametrize("number", [2, 100, 2**16])
def test_a_power_of_two(problem: HierarchicalProblem, number: int) -> None:
    with pytest.raises(ValueError, match="power of 2"):
        predicted(problem, "constant", prediction_track(problem), avalanches=number)
