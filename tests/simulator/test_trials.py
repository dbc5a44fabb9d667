"""Trials: what a seed gives can be read, is what was asked for, and does not give itself away."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from skred.campaign import Status, read_campaign, write_campaign
from skred.errors import InputError
from skred.simulator.detectability import FINAL_NODES, fit
from skred.simulator.draw import SHARES, draw_trial
from skred.simulator.fitting import Setting, Target
from skred.simulator.listed import INSTRUMENT, LISTED
from skred.simulator.observe import NASTY
from skred.simulator.readings import Sensors
from skred.simulator.terrain import draw_ground
from skred.simulator.unlisted import UNLISTED

ROOT = Path(__file__).resolve().parents[2]
HIDEABLE = [*LISTED, *UNLISTED]


@pytest.mark.slow
@pytest.mark.parametrize("name", HIDEABLE)
def test_everything_can_be_hidden(name: str, tmp_path: Path) -> None:
    kind = "dense" if HIDEABLE.index(name) % 2 else "sparse"
    trial = draw_trial(40 + HIDEABLE.index(name), kind=kind, hidden=name, snr=4.0)  # type: ignore[arg-type]
    write_campaign(trial.campaign, tmp_path / "campaign")
    assert read_campaign(tmp_path / "campaign").fingerprint() == trial.campaign.fingerprint()
    truth = json.loads(json.dumps(trial.truth, allow_nan=False))
    assert [mechanism["id"] for mechanism in truth["mechanisms"]] == [name]
    group = "unlisted" if name in UNLISTED else "instrument" if name in INSTRUMENT else "listed"
    assert truth["hidden"] == group
    # three speeds far below tell little of a release
    assert (0.0 if name == "release_offset" else 2.0) <= truth["snr"] < 6.0
    text = "".join(path.read_text(encoding="utf-8") for path in (tmp_path / "campaign").iterdir())
    assert name not in text and name.split("_")[0] not in trial.campaign.name


@pytest.mark.parametrize("kind", ["sparse", "dense"])
@pytest.mark.parametrize("hidden", ["nothing", "nasty"])
def test_nulls(kind: str, hidden: str) -> None:
    found = set()
    for seed in range(6):
        trial = draw_trial(seed, kind=kind, hidden=hidden)  # type: ignore[arg-type]
        assert trial.truth["mechanisms"] == [] and trial.truth["snr"] == 0.0
        found.add(trial.truth["nasty"])
        n_speeds, n_events = trial.campaign.n_sensors - 1, trial.campaign.n_events
        low, high, few, many = (3, 3, 18, 30) if kind == "sparse" else (30, 45, 12, 20)
        assert low <= n_speeds <= high and few <= n_events <= many
    assert found == {None} if hidden == "nothing" else found <= set(NASTY)


def test_plain_nulls_have_the_stated_errors() -> None:
    """Readings less exact values over the stated standard deviation: white, unit variance."""
    z = []
    for seed in range(30):
        trial = draw_trial(seed, hidden="nothing")
        exact = np.array(trial.truth["exact_readings"])
        relative = np.array([sensor.relative_sd for sensor in trial.campaign.sensors])
        absolute = np.array([sensor.absolute_sd for sensor in trial.campaign.sensors])
        use = (trial.campaign.status == Status.OBSERVED) & (exact > 5.0)
        z.append(((trial.campaign.values - exact) / np.hypot(relative * exact, absolute))[use])
    all_z = np.concatenate(z)
    assert len(all_z) > 3000
    assert abs(all_z.mean()) < 0.06 and abs(all_z.std() - 1.0) < 0.05


def test_two_at_once() -> None:
    truth = draw_trial(8, kind="dense", hidden="two", snr=6.0).truth
    assert len({mechanism["id"] for mechanism in truth["mechanisms"]}) == 2
    assert len(truth["snr_alone"]) == 2 and 3.0 < truth["snr"] < 9.0


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["sparse", "dense"])
def test_masked_effects_leave_no_mean_residual(kind: str) -> None:
    truth = draw_trial(21, kind=kind, hidden="masked", snr=5.0).truth  # type: ignore[arg-type]
    assert truth["masked"] and truth["largest_mean_residual_se"] < 1.2
    assert truth["snr"] > 2.0


def test_a_seed_is_a_trial() -> None:
    first, again, other = (draw_trial(seed, kind="dense") for seed in (5, 5, 6))
    assert first.campaign.fingerprint() == again.campaign.fingerprint() and first.truth == again.truth
    assert first.campaign.fingerprint() != other.campaign.fingerprint()
    assert sum(SHARES.values()) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"hidden": "gnomes"}, "gnomes"),
        ({"base": "x"}, "base law"),
        ({"hidden": "centrifugal", "base": "pcm"}, "pcm"),
    ],
)
def test_what_cannot_be_hidden_is_refused(options: dict[str, str], message: str) -> None:
    with pytest.raises(InputError, match=message):
        draw_trial(1, **options)  # type: ignore[arg-type]


def test_integration_over_events_against_a_grid() -> None:
    """One parameter, exact readings: the deviance of a given population by brute force."""
    from scipy.optimize import minimize

    from skred.simulator import fitting

    rng = np.random.default_rng(4)
    ground, n = draw_ground(rng, "parabolic"), 12
    places = np.array([500.0, 700.0])
    setting = Setting(
        ground, "constant", Sensors(places, places), np.full(n, 100.0), 0.0, np.array([0.08, 0.08, 0.0]),
        np.array([0.5, 0.5, 10.0]), np.ones((n, 3), dtype=bool), np.array([3.0]),
    )  # fmt: skip
    theta = np.log(3.0) + 0.13 * rng.standard_normal((n, 1))
    target: Target = fitting.target_of(setting, theta, None)
    grid = np.linspace(-1.0, 1.0, 4001) + np.log(3.0)
    nodes = np.tile(grid, n)[:, None]
    r = np.nan_to_num(fitting.residuals(setting, target, nodes, None))
    likelihood = np.exp(-0.5 * np.sum(r**2, axis=1)).reshape(n, -1)

    def deviance(x: np.ndarray) -> float:
        population = fitting.Population(x[:1], np.exp(-2.0 * x[1:, None]))
        density = np.exp(-0.5 * ((grid - x[0]) / np.exp(x[1])) ** 2) / np.exp(x[1])
        total = np.log(likelihood @ density * (grid[1] - grid[0]))
        # _log_normal_density leaves out log(2 pi) / 2 of prior and proposal alike
        return float(-2.0 * np.sum(total - 0.5 * np.log(2 * np.pi))) + fitting.penalty(setting, population)

    best = minimize(deviance, [np.log(3.0), np.log(0.13)], method="Nelder-Mead").fun
    assert fit(setting, target, None, theta, FINAL_NODES).deviance == pytest.approx(best, abs=0.3)


@pytest.mark.slow
def test_each_mechanism_in_turn_sparse_and_dense(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "benchmarks.development_set", "--each", "--n", "4"]
    subprocess.run(
        [*command, "--seed", "1000", "--out", str(tmp_path)], cwd=ROOT, check=True, capture_output=True
    )
    truths = [json.loads((tmp_path / "truth" / f"trial-000{k}.json").read_text()) for k in (1, 2, 3, 4)]
    assert [one["kind"] for one in truths] == ["sparse", "dense"] * 2
    ids = [one["mechanisms"][0]["id"] for one in truths]
    assert ids == [name for name in list(LISTED)[:2] for _ in range(2)]


@pytest.mark.slow
def test_the_development_set_resumes(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "benchmarks.development_set", "--seed", "1000"]
    command += ["--hidden", "nothing", "--out", str(tmp_path)]
    first = subprocess.run(
        [*command, "--n", "2"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout
    again = subprocess.run(
        [*command, "--n", "3"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout
    assert first.count("trial-") == 2 and again.count("trial-") == 1
    for name in ("trial-0001", "trial-0003"):
        read_campaign(tmp_path / name / "campaign")
        assert json.loads((tmp_path / "truth" / f"{name}.json").read_text())["hidden"] == "nothing"
        request = json.loads((tmp_path / name / "request.json").read_text())
        assert list(request) == ["base_model"]
