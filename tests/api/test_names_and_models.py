"""Laws and mechanisms by name, how they show themselves, and a law's model."""

from __future__ import annotations

import copy
from operator import methodcaller
from typing import Any

import numpy as np
import pytest

import skred
from skred.api.problems import problem_of

as_a_notebook = methodcaller("_repr_html_")


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda: skred.laws()["coulom"], "^no law named 'coulom'; there are: .*coulomb"),
        (lambda: skred.mechanisms()["drag"], "^no mechanism named 'drag'; there are: .*turbulent_drag"),
        (lambda: skred.calibrate("coulom"), "^no law named 'coulom'; there are: .*coulomb"),
        (lambda: skred.laws()["pcm"] + "viscous_drag", "expected a mechanism, .* found 'viscous_drag'"),
        (lambda: skred.laws()["pcm"] + skred.laws()["pcm"], "expected a mechanism, .* found <Law pcm"),
        (lambda: skred.laws()["pcm"] + skred.mechanisms()["segment_drag"], "cannot be a part of a law"),
        (lambda: skred.laws()["pcm"] + skred.mechanisms()["turbulent_drag"], "has 'turbulent_drag' already"),
    ],
)
def test_what_cannot_be_used_is_one_error(call: Any, told: str) -> None:
    with pytest.raises(skred.InputError, match=told):
        call()


def test_a_mapping_stays_one() -> None:
    laws = skred.laws()
    assert laws.get("nonsense") is None and "nonsense" not in laws
    with pytest.raises(KeyError):
        _ = laws["nonsense"]
    other = copy.copy(laws)
    assert other == laws and repr(other) == repr(laws)


def test_everything_shows_itself_in_one_line() -> None:
    campaign = skred.read_campaign("ryggfonn")
    shown = {
        repr(skred.laws()["pcm"]): "dry_friction mu [1], turbulent_drag D [m-1]",
        repr(skred.laws()): "laws: constant, coulomb",
        repr(skred.mechanisms()): "mechanisms: centrifugal",
        repr(skred.mechanisms()["viscous_drag"]): "[s-1]",
        repr(campaign): "ryggfonn: 22 events, 4 sensors (LC, CD, b, runout), track of 2364 m",
    }
    for text, part in shown.items():
        assert part in text and "\n" not in text and "0x" not in text and len(text) < 300
    assert "<td>mu</td>" in as_a_notebook(skred.laws()["pcm"])
    assert "<td>pcm</td>" in as_a_notebook(skred.laws())


@pytest.mark.parametrize("likelihood", ["pooled", "hierarchical"])
def test_the_model_is_that_of_the_problem(likelihood: Any) -> None:
    law = skred.laws()["pcm"]
    model = skred.model("pcm", likelihood=likelihood, priors={"dry_friction": 0.3})
    problem = problem_of("ryggfonn", likelihood, None, None)
    names = [parameter.name for parameter in problem.parameters(law)]
    assert {one.name for one in model.free_RVs} == set(names)
    assert [one.name for one in model.observed_RVs] == ["recordings"]
    assert np.isfinite(model.compile_logp()(model.initial_point()))


def test_the_model_refuses_what_calibrate_refuses() -> None:
    with pytest.raises(skred.InputError, match="likelihood: expected one of"):
        skred.model("pcm", likelihood="nope")  # type: ignore[arg-type]
