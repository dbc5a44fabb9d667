"""Parameters in the views of draws: none is dropped in silence, and what is told is what is shown."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import dashboard_cases  # noqa: F401  (skips where the extra is not installed)
import numpy as np
import pytest
import xarray as xr

from skred.dashboard.answer import answer, entries
from skred.dashboard.reading import Given, read_given
from skred.dashboard.view import Asked

LONG = f"{'a' * 40}{{}}{'b' * 40}"
"""A name of which the middle is not shown."""


def drawn(*names: str, prior: int | None = None) -> dict[str, xr.Dataset]:
    """Groups with draws of scalars, and a prior of the first of them."""
    rng = np.random.default_rng(4)
    posterior = xr.Dataset({name: (("chain", "draw"), rng.normal(size=(2, 60))) for name in names})
    return {"posterior": posterior, "prior": posterior[list(names)[:prior]]}


def made(found: Given, key: str, *wanted: str, can_choose: bool = True) -> dict[str, Any]:
    (entry,) = [one for one in entries(found) if one.key == key]
    return answer(entry, found, Asked(wanted, can_choose=can_choose))


def told(html: str) -> tuple[int, int, int]:
    """What a view says of its parameters: shown, all, at most."""
    said = re.search(r"(\d+) of (\d+) parameters are shown.*at most (\d+)", html, flags=re.S)
    assert said is not None, html[:300]
    shown, there, most = map(int, said.groups())
    assert html.count(" checked>") == shown
    return shown, there, most


@pytest.mark.parametrize(
    ("view", "expected", "n_figures"),
    [
        ("pair-r1", (6, 30, 6), 15), ("trace-r1", (12, 30, 12), 12), ("rank-r1", (12, 30, 12), 12),
        ("prior-r1", (12, 30, 12), 12), ("forest", (24, 30, 24), 24),
    ],
)  # fmt: skip
def test_what_is_told_is_what_is_shown(
    view: str, expected: tuple[int, int, int], n_figures: int, tree_file: Callable[..., Path]
) -> None:
    found = read_given([tree_file("many", **drawn(*(f"p{k}" for k in range(30))))])
    one = made(found, view)
    assert told(one["html"]) == expected and len(one["items"]) == n_figures
    in_file = made(found, view, can_choose=False)
    assert f"{expected[0]} of 30 parameters are shown; the served dashboard" in in_file["html"]


def test_pairs_of_seven_parameters_say_that_six_are_shown(tree_file: Callable[..., Path]) -> None:
    found = read_given([tree_file("seven", **drawn(*(f"p{k}" for k in range(7))))])
    assert told(made(found, "pair-r1")["html"]) == (6, 7, 6)
    chosen = made(found, "pair-r1", "p5", "p6", "no such")
    assert "p6 against p5" in chosen["html"] and told(chosen["html"]) == (2, 7, 6)


def test_the_forest_shows_those_that_are_asked_for(tree_file: Callable[..., Path]) -> None:
    found = read_given([tree_file("many", **drawn(*(f"p{k}" for k in range(30))))])
    one = made(found, "forest", "p28")
    assert "<h3>p28</h3>" in one["html"] and len(one["items"]) == 1


def test_prior_and_posterior_count_what_both_have(tree_file: Callable[..., Path]) -> None:
    names = [f"p{k:02}" for k in range(20)]
    found = read_given([tree_file("half", **drawn(*names, prior=14))])
    one = made(found, "prior-r1")
    assert told(one["html"]) == (12, 14, 12) and len(one["items"]) == 12


def test_labels_that_shorten_alike_stand_apart(tree_file: Callable[..., Path]) -> None:
    """One label of two parameters was two bars of one run: bokeh draws no such axis (E-1019)."""
    both = read_given(
        [tree_file("a", **drawn(LONG.format(1), LONG.format(2))), tree_file("b", **drawn(LONG.format(2)))]
    )
    first, second = both.runs[0].all_labels
    assert second == f"{first} (no. 2)"
    one = made(both, "forest")
    assert len(one["items"]) == 2
    (entry,) = [one for one in entries(both) if one.key == "forest"]
    runs = [panel.figure.y_range.factors for panel in entry.view.make(None, both, Asked())]
    assert sorted(runs, key=len) == [["1"], ["2", "1"]]  # the second name is in both files
