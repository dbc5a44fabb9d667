"""Wrong arguments are told by their names, before anything is sampled."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import skred
from skred.errors import InputError


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
    ],
)
def test_predict(options: dict[str, Any], told: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=told):
        skred.predict(**options)


@pytest.mark.parametrize("name", [3, None, []])
def test_read_campaign(name: Any) -> None:
    with pytest.raises(InputError, match="campaign: expected a folder"):
        skred.read_campaign(name)
