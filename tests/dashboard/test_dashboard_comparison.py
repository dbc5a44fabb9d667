"""Runs are compared where that means something, and it is told where it does not."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import dashboard_cases  # noqa: F401  (skips where the extra is not installed)
import numpy as np
import xarray as xr

from skred.dashboard.answer import answer, entries
from skred.dashboard.reading import read_given

TreeFile = Callable[..., Path]


def of_normal(seed: int, *, readings: Any, spread: float = 1.0, name: str = "y") -> dict[str, xr.Dataset]:
    """Groups of a normal model of some readings."""
    rng = np.random.default_rng(seed)
    readings = np.asarray(readings, dtype=float)
    mean = readings.mean() + rng.normal(0.0, 0.3, size=(2, 200))
    density = -0.5 * ((readings - mean[..., None]) / spread) ** 2 - np.log(spread * np.sqrt(2.0 * np.pi))
    return {
        "posterior": xr.Dataset({"mean": (("chain", "draw"), mean)}),
        "log_likelihood": xr.Dataset({name: (("chain", "draw", "place"), density)}),
        "observed_data": xr.Dataset({name: ("place", readings)}),
    }


def compared(*files: Path) -> str:
    found = read_given(files)
    (entry,) = [one for one in entries(found) if one.key == "comparison"]
    return str(answer(entry, found)["html"])


def test_a_run_with_large_pareto_k_is_warned_of(tree_file: TreeFile) -> None:
    readings = np.random.default_rng(1).normal(size=20)
    readings[7] = 30.0  # what one density cannot leave out by importance sampling
    narrow = tree_file("narrow", **of_normal(2, readings=readings, spread=0.2))
    wide = tree_file("wide", **of_normal(3, readings=readings, spread=9.0))
    warned = [bool(one.loo.warning) for one in read_given([narrow, wide]).runs]
    assert warned == [True, False]
    html = compared(narrow, wide)
    assert html.count("Pareto k above") == 1
    assert 'narrow<span class="bad"> (Pareto k above' in html


def test_the_note_says_what_elpd_sums_and_what_arviz_doubts(tree_file: TreeFile) -> None:
    readings = np.random.default_rng(1).normal(size=20)
    files = [tree_file(f"f{k}", **of_normal(k, readings=readings)) for k in range(2)]
    html = compared(*files)
    assert "summed over the events" in html and "N &lt; 100" in html


def test_files_of_other_observations_are_not_compared_and_it_is_told(tree_file: TreeFile) -> None:
    rng = np.random.default_rng(1)
    low, high = rng.normal(0.0, 1.0, 20), rng.normal(500.0, 1.0, 20)
    files = [
        tree_file("low", **of_normal(2, readings=low)),
        tree_file("again", **of_normal(3, readings=low)),
        tree_file("high", **of_normal(4, readings=high)),
    ]
    html = compared(*files)
    assert "arviz.compare, 2 runs" in html and "3: high" not in html
    assert "run 3, high: no other run has the same observations" in html
    assert "arviz.compare" not in compared(files[0], files[2])


def test_what_does_not_say_what_was_observed_is_not_compared(tree_file: TreeFile) -> None:
    readings = np.random.default_rng(1).normal(size=20)
    files = []
    for number in range(2):
        groups = of_normal(number, readings=readings)
        del groups["observed_data"]
        files.append(tree_file(f"f{number}", **groups))
    html = compared(*files)
    assert "No two of the runs" in html and html.count("does not say what was observed") == 2


def test_observations_are_those_of_the_likelihood(tree_file: TreeFile) -> None:
    """Two models of one outcome, one of which was given a covariate as data, can be compared."""
    readings = np.random.default_rng(1).normal(size=20)
    more = of_normal(2, readings=readings)
    more["observed_data"]["x"] = ("place", np.arange(20.0))
    html = compared(tree_file("one", **of_normal(3, readings=readings)), tree_file("two", **more))
    assert "arviz.compare, 2 runs" in html and "Not compared" not in html


def test_another_likelihood_is_told(given: Any) -> None:
    (entry,) = [one for one in entries(given) if one.key == "comparison"]
    html = answer(entry, given)["html"]
    assert "hierarchical (coulomb, hierarchical): runs of the same observations have another" in html
