"""Priors with other scales, and laws with one mechanism more."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import halfnorm, lognorm

from skred.errors import InputError
from skred.inference.priors import PriorsError, laws_with_priors, read_priors
from skred.physics.laws import load_law
from skred.physics.mechanisms.library import mechanisms


def log_prior(model: Any, name: str, value: float) -> float:
    """Log density of one parameter alone, without the factor of its transform."""
    point = model.initial_point() | {f"{name}_log__": np.log(value)}
    return float(model.compile_logp(vars=[model[name]], jacobian=False)(point))


def test_a_scale_becomes_that_of_the_prior(problem: Any) -> None:
    [law] = laws_with_priors([load_law("voellmy")], {"dry_friction": 0.2, "xi_h": 1000.0})
    model = law.build(problem)
    assert log_prior(model, "dry_friction", 0.3) == pytest.approx(halfnorm(scale=0.2).logpdf(0.3))
    assert log_prior(model, "xi_h", 700.0) == pytest.approx(lognorm(1.0, scale=1000.0).logpdf(700.0))
    assert law.mechanisms[0].strength.prior_scale == 0.2
    assert (
        law.prior_note
        == "Priors were changed: of voellmy the scale of dry_friction 0.2, of xi_h 1000 m2 s-2."
    )
    own, point = load_law("voellmy").build(problem), model.initial_point()
    assert own.compile_logp(vars=own.observed_RVs)(point) == model.compile_logp(vars=model.observed_RVs)(
        point
    )


def test_the_laws_own_scale_is_no_change() -> None:
    law = load_law("pcm")
    assert laws_with_priors([law], {"dry_friction": 0.5}) == [law] == laws_with_priors([law], None)
    assert law.prior_note == ""


def test_each_law_takes_what_it_has() -> None:
    coulomb, constant = laws_with_priors([load_law("coulomb"), load_law("constant")], {"retardation": 2.0})
    assert coulomb.changed_priors == () and constant.changed_priors == (("retardation", 2.0),)


@pytest.mark.parametrize("name", ["mu", "dry_friction_spread", "x" * 500])
def test_unknown_names_are_refused_with_the_known_ones(name: str) -> None:
    with pytest.raises(PriorsError, match="there are: dry_friction, turbulent_drag"):
        laws_with_priors([load_law("pcm")], {name: 1.0})


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf"), 10**400, True, "1", None])
def test_what_is_no_scale_is_refused(value: Any) -> None:
    with pytest.raises(PriorsError, match="a number above 0"):
        laws_with_priors([load_law("pcm")], {"dry_friction": value})


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("dry_friction = 'wide'", "a number above 0"),
        ("[scales]\na = 1", "a number above 0"),
        ("=", "TOML"),
        ("#" * 100_001, "longer than 100000 bytes"),
        ("dry_friction = " + "9" * 6000, "TOML"),
        ("a = " + "[" * 50_000, "TOML"),
    ],
)
def test_a_file_says_what_is_wrong_with_it(text: str, told: str, tmp_path: Path) -> None:
    file = tmp_path / "priors.toml"
    file.write_text("dry_friction = 0.3\nturbulent_drag = 1\n", encoding="utf-8")
    assert read_priors(file) == {"dry_friction": 0.3, "turbulent_drag": 1.0}
    file.write_text(text, encoding="utf-8")
    with pytest.raises(PriorsError, match=told):
        read_priors(file)
    with pytest.raises(PriorsError, match="nowhere"):
        read_priors(tmp_path / "nowhere.toml")


def test_a_prior_without_a_scale_is_told(problem: Any) -> None:
    import pymc as pm

    from skred.inference.priors import rescaled_model

    with pm.Model() as model:
        pm.Gamma("share", 2.0, 3.0)
    with pytest.raises(PriorsError, match="found Gamma"):
        rescaled_model(model, {"share": 1.0})


def test_a_law_and_a_mechanism_are_a_law(problem: Any) -> None:
    joined, pcm = load_law("coulomb") + mechanisms()["turbulent_drag"], load_law("pcm")
    assert joined.id == "coulomb+turbulent_drag" and joined.equation == pcm.equation
    assert joined.parameters == pcm.parameters
    model, same = joined.build(problem), pcm.build(problem)
    point = same.initial_point()
    assert model.compile_logp()(point) == same.compile_logp()(point)


def test_a_joined_law_keeps_the_parameters_of_the_first() -> None:
    law = load_law("voellmy") + mechanisms()["viscous_drag"] + mechanisms()["constant_retardation"]
    rows = law.strength_rows({"dry_friction": 0.2, "xi_h": 2000.0, "viscous_drag": 0.1, "retardation": 1.0})
    assert rows.shape == (1, 4) and rows[0, 2:].tolist() == [0.1, 1.0]
    assert law.parameter_rows(rows)["xi_h"] == pytest.approx(2000.0)


@pytest.mark.parametrize(
    ("mechanism", "told"), [("segment_friction", "cannot be a part"), ("turbulent_drag", "already")]
)
def test_what_cannot_join_is_told(mechanism: str, told: str) -> None:
    with pytest.raises(InputError, match=told):
        load_law("pcm") + mechanisms()[mechanism]
    with pytest.raises(InputError, match="expected a mechanism"):
        load_law("pcm") + mechanism  # type: ignore[operator]
