"""Wrong arguments are told by their names, before anything is sampled."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytensor.tensor as pt
import pytest

import skred
from skred.api import arguments
from skred.api.problems import chosen_laws
from skred.api.sampling import settings_of
from skred.errors import InputError

HUGE = 10**5000  # has not even a text


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"law": None}, "law: expected an id or a law"),
        ({"law": []}, "law: expected an id or a law"),
        ({"law": 3}, "law: expected an id or a law"),
        ({"campaign": 3}, "campaign: expected a folder, a name or a campaign"),
        ({"likelihood": "nope"}, "likelihood: expected one of pooled, hierarchical"),
        ({"likelihood": "hierarchical", "errors": "nope"}, "errors: expected one of"),
        ({"draws": 0}, "draws: expected a whole number from 4"),
        ({"draws": 10.5}, "draws: expected a whole number"),
        ({"draws": "many"}, "draws: expected a whole number"),
        ({"tune": 0}, "tune: expected a whole number from 1"),
        ({"chains": 1}, "chains: expected a whole number from 2"),
        ({"chains": True}, "chains: expected a whole number"),
        ({"sampler": "nope"}, "sampler: expected one of metropolis, nuts, smc"),
        ({"smoothing_m": -1}, "smoothing_m: expected a number from 0 to 1000"),
        ({"smoothing_m": "x"}, "smoothing_m: expected a number"),
        ({"priors": 3}, "priors: expected a mapping"),
        ({"priors": [("dry_friction", 1)]}, "priors: expected a mapping"),
        ({"seed": -1}, "seed: expected a whole number from 0"),
        ({"seed": "a"}, "seed: expected a whole number"),
        ({"draws": np.array([500, 600])}, "draws: expected a whole number"),
        ({"draws": HUGE}, "draws: expected a whole number"),
        ({"smoothing_m": HUGE}, "smoothing_m: expected a number from 0 to 1000"),
        ({"priors": {"dry_friction": HUGE}}, "priors.'dry_friction'.: expected a number"),
        ({"priors": {"dry_friction": "much"}}, "priors.'dry_friction'.: expected a number, found 'much'"),
        ({"priors": {"dry_friction": -1.0}}, "'dry_friction': expected a scale, a number above 0"),
    ],
)
def test_calibrate(options: dict[str, Any], told: str) -> None:
    with pytest.raises(InputError, match=told):
        skred.calibrate(**{"law": "pcm", **options})


@pytest.mark.parametrize("laws", ["pcm", [], None, 3])
def test_compare(laws: Any) -> None:
    with pytest.raises(InputError, match="laws: expected"):
        skred.compare(laws)


@pytest.mark.parametrize(
    "options",
    [{"max_mechanisms": 0}, {"max_mechanisms": 3}, {"outer_folds": -1}, {"lock": -1}, {"seed": 0.5}],
)
def test_diagnose(options: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=f"{next(iter(options))}: expected a whole number"):
        skred.diagnose("pcm", **options)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"from_folder": 3}, "from_folder: expected a path"),
        ({"track": 3}, "track: expected a path"),
        ({"at": [("a", 3)]}, "at: expected a mapping from names"),
        ({"at": {3: 3}}, "at: expected a mapping from names"),
        ({"at": {"a": "x"}}, "expected a number, found 'x'"),
        ({"at": {"a": float("nan")}}, "expected a number"),
        ({"per_year": "x"}, "per_year: expected 2 numbers"),
        ({"per_year": (1, 2, 3)}, "per_year: expected 2 numbers"),
        ({"per_year": 0}, "expected above 0"),
        ({"release_s_m": "a"}, "release_s_m: expected a place"),
        ({"release_s_m": [1, 2]}, "release_s_m: expected 2 numbers"),
        ({"density_kg_m3": 200}, "density_kg_m3: expected 2 numbers"),
        ({"density_kg_m3": (1,)}, "density_kg_m3: expected 2 numbers"),
        ({"speeds_m_s": 3}, "speeds_m_s: expected numbers"),
        ({"speeds_m_s": ["a"]}, "speeds_m_s: expected a number"),
        ({"return_periods_years": 30, "per_year": 1}, "return_periods_years: expected numbers"),
        ({"draws": 1}, "draws: expected a whole number"),
        ({"release_s_m": []}, "release_s_m: expected a place, or pairs"),
        ({"law": ""}, "law: expected an id or a law"),
        ({"campaign": ""}, "campaign: expected a folder, a name or a campaign"),
        ({"from_folder": ""}, "from_folder: expected a path"),
        ({"track": ""}, "track: expected a path"),
        ({"per_year": np.array(-0.1)}, "expected above 0"),
        ({"per_year": np.array([[0.1, 0.0]])}, "per_year: expected a number"),
        ({"release_s_m": np.array(np.nan)}, "release_s_m: expected a number"),
        ({"speeds_m_s": np.array(30.0)}, "speeds_m_s: expected numbers"),
        ({"speeds_m_s": [HUGE]}, "speeds_m_s: expected a number"),
    ],
)
def test_predict(options: dict[str, Any], told: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=told):
        skred.predict(**options)


@pytest.mark.parametrize("name", [3, None, []])
def test_read_campaign(name: Any) -> None:
    with pytest.raises(InputError, match="campaign: expected a folder"):
        skred.read_campaign(name)


@pytest.mark.parametrize("value", [np.float32(0.25), np.float64(0.25), np.array(0.25), 0.25])
def test_numbers_may_be_of_numpy(value: Any) -> None:
    assert arguments.number("x", value) == 0.25 and type(arguments.number("x", value)) is float
    [law] = chosen_laws(["pcm"], {"dry_friction": value})
    assert dict(law.changed_priors) == {"dry_friction": 0.25}
    settings = settings_of("pooled", np.int64(500), np.int32(600), np.int8(4), np.uint8(1))
    assert {type(one) for one in (settings.draws, settings.tune, settings.chains, settings.seed)} == {int}


@pytest.mark.parametrize("smoothing_m", [-5, "a", np.inf, pytest.param(HUGE, id="huge")])
def test_front_readings(smoothing_m: Any) -> None:
    with pytest.raises(InputError, match="smoothing_m: expected a number from 0 to 1000"):
        skred.front_readings("pcm", smoothing_m=smoothing_m, dry_friction=0.2, turbulent_drag=0.003)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"dry_friction": -0.2}, "dry_friction: expected numbers of at least 0, found -0.2"),
        ({"dry_friction": "0.2"}, "dry_friction: expected a number, or several in one row, found '0.2'"),
        ({"dry_friction": None}, "dry_friction: expected a number"),
        ({"dry_friction": True}, "dry_friction: expected a number"),
        ({"dry_friction": []}, "dry_friction: expected a number"),
        (
            {"dry_friction": [0.2, np.nan]},
            "dry_friction: expected a number, or several in one row, all finite",
        ),
        ({"dry_friction": [[0.2]]}, "dry_friction: .* an array of the shape"),
        ({"dry_friction": [[0.2], [1, 2]]}, "dry_friction: .* rows of different lengths"),
        (
            {"dry_friction": [0.2, 0.3], "xi_h": [1, 2, 3]},
            "xi_h: expected one number or 2, as dry_friction has",
        ),
        ({"dry_friction": pt.dmatrix()}, "dry_friction: .* 2 dimensions"),
        ({"dry_friction": pt.constant(-1.0)}, "dry_friction: expected numbers of at least 0"),
        ({"xi_h": 0.0}, "dry_friction, xi_h: these make the coefficient turbulent_drag of 'voellmy' inf"),
        ({"xi_h": 0.0, "dry_friction": pt.dscalar()}, "these make the coefficient turbulent_drag"),
        ({"xi": 3.0}, "xi: no parameter of 'voellmy'; there are: dry_friction, xi_h"),
        ({"release_s_m": -1.0}, "release_s_m: expected numbers of at least 0"),
        ({"release_s_m": [1.0, 1e9]}, "release_s_m: expected places on the track"),
    ],
)
def test_constants_of_fronts(given: dict[str, Any], told: str) -> None:
    with pytest.raises(InputError, match=told):
        skred.front_readings("voellmy", **{"dry_friction": 0.2, "xi_h": 3000.0, **given})


def test_a_parameter_that_is_missing() -> None:
    with pytest.raises(InputError, match="xi_h: expected a number or several, found none; parameters of"):
        skred.front_readings("voellmy", dry_friction=0.2)


def test_the_same_law_is_taken_once() -> None:
    pcm = skred.laws()["pcm"]
    for given in (["pcm", pcm], [pcm, "pcm"], ["pcm", "pcm"], [pcm, pcm]):
        assert [law.id for law in chosen_laws(given, None)] == ["pcm"]


def test_two_laws_of_one_name_are_refused() -> None:
    other = replace(skred.laws()["pcm"], title="something else")
    with pytest.raises(InputError, match="laws: two different ones are named 'pcm'"):
        chosen_laws(["pcm", other], None)


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda: skred.calibrate("pcm", errors="robust"), "errors: only with likelihood='hierarchical'"),
        (lambda: skred.predict(at={"a": 1e9}), r"at a=1e\+09: expected a place on the track"),
        (lambda: skred.predict(speeds_m_s=[-1]), "speeds_m_s -1: expected a number"),
        (lambda: skred.predict(density_kg_m3=(300, 100)), "density_kg_m3 300,100: expected"),
        (lambda: skred.predict(return_periods_years=[9]), "return_periods_years: needs per_year"),
        (lambda: skred.predict(release_s_m=1e9), "release_s_m 1e.09: expected a place on the track"),
        (lambda: skred.predict(from_folder="nowhere"), "from_folder nowhere: no such folder"),
        (lambda: skred.diagnose(outer_folds=1), "outer_folds 1: "),
        (lambda: skred.diagnose(lock=9999), "lock 9999: "),
    ],
)
def test_what_is_refused_further_down_is_told_by_name_too(call: Any, told: str) -> None:
    with pytest.raises(InputError, match=f"^{told}") as caught:
        call()
    assert "--" not in str(caught.value)


def test_a_file_that_is_named_like_an_option_keeps_its_name() -> None:
    with pytest.raises(InputError, match=r"^from_folder /tmp/--out/--at: no such folder"):
        skred.predict(from_folder="/tmp/--out/--at")


@pytest.mark.parametrize(
    "given",
    [{"law": "pcm"}, {"draws": 50}, {"draws": 1000}, {"tune": 50}, {"chains": 2}, {"seed": 0}, {"seed": 1}],
)
def test_beside_a_calibration_nothing_is_ignored(given: dict[str, Any], tmp_path: Path) -> None:
    with pytest.raises(InputError, match=f"made already; leave out {next(iter(given))}"):
        skred.predict(from_folder=tmp_path, **given)
