"""Every law of the pack, and the registry that finds it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skred.errors import InputError
from skred.inference.sampling import sample_prior
from skred.physics.kernel.columns import GRAVITY
from skred.physics.laws import GROUP, UnknownLawError, law_ids, load_law

LAWS = ("coulomb", "pcm", "constant", "voellmy")


@pytest.fixture(params=LAWS)
def law(request: pytest.FixtureRequest) -> Any:
    return load_law(request.param)


def test_all_are_registered() -> None:
    assert set(LAWS) <= set(law_ids())
    for entry in entry_points(group=GROUP):
        assert entry.load().id == entry.name


@pytest.mark.parametrize("name", ["", "PCM", "bingham", "pcm "])
def test_an_unknown_law_is_told_with_those_there_are(name: str) -> None:
    with pytest.raises(UnknownLawError, match="there are: .*coulomb.*pcm") as caught:
        load_law(name)
    assert repr(name) in str(caught.value)


def test_free_variables_are_the_laws_parameters(law: Any, model_of: Callable[[str], Any]) -> None:
    model = model_of(law.id)
    assert [variable.name for variable in model.free_RVs] == law.parameter_names
    assert [variable.name for variable in model.observed_RVs] == ["recordings"]


def test_dims(law: Any, model_of: Callable[[str], Any], problem: Any) -> None:
    model = model_of(law.id)
    assert set(model.coords) == {"event", "sensor"}
    assert tuple(model.coords["event"]) == problem.campaign.event_ids
    assert tuple(model.coords["sensor"]) == problem.campaign.sensor_ids
    assert model.named_vars_to_dims["recordings"] == ("event",)
    assert not set(model.coords) & set(model.named_vars)


@pytest.mark.slow
def test_density_is_finite_at_the_initial_point_and_is_the_problems(
    law: Any, model_of: Callable[[str], Any], problem: Any
) -> None:
    model = model_of(law.id)
    point = model.initial_point()
    terms = model.compile_logp(vars=model["recordings"], sum=False)(point)[0]
    assert np.isfinite(terms).all() and np.isfinite(model.compile_logp()(point))
    values = {name: np.exp(point[f"{name}_log__"]) for name in law.parameter_names}
    assert_allclose(terms, problem.log_density(law.mechanisms, law.strength_rows(values))[0], rtol=1e-9)


def test_prior_draws_are_positive_and_move_fronts(
    law: Any, model_of: Callable[[str], Any], problem: Any
) -> None:
    prior = sample_prior(model_of(law.id), law, 0, draws=500)
    assert set(prior.data_vars) == set(law.parameter_names)
    for name in law.parameter_names:
        assert prior[name].values.min() > 0 and np.isfinite(prior[name].values).all()
    rows = law.strength_rows({name: prior[name].values for name in law.parameter_names})
    assert rows.shape == (500, len(law.mechanisms))
    runouts = problem.simulate(law.mechanisms, rows)[:, 0, -1]
    recorded = problem.values[:, -1]
    # Vague: the prior puts fronts above, among and beyond the recorded runouts.
    assert np.mean(runouts < np.nanmin(recorded)) > 0.02
    assert np.mean((runouts > np.nanmin(recorded)) & (runouts < np.nanmax(recorded))) > 0.02
    assert np.mean(runouts > np.nanmax(recorded)) > 0.02


def test_equation_and_documentation(law: Any) -> None:
    assert law.equation.startswith("dU^2/(2 ds) = g sin(phi) - ")
    assert law.equation.count(" - ") == len(law.mechanisms) and "--" not in law.equation
    for parameter in law.parameters:
        assert parameter.unit and parameter.symbol
    assert law.title and law.reference


@pytest.mark.parametrize(
    ("law_id", "equation"),
    [
        ("coulomb", "dU^2/(2 ds) = g sin(phi) - mu max(0, g cos(phi) + kappa U^2)"),
        ("pcm", "dU^2/(2 ds) = g sin(phi) - mu max(0, g cos(phi) + kappa U^2) - D U^2"),
        ("constant", "dU^2/(2 ds) = g sin(phi) - b"),
        ("voellmy", "dU^2/(2 ds) = g sin(phi) - mu g cos(phi) - D U^2, D = g / (xi h)"),
    ],
)
def test_equations(law_id: str, equation: str) -> None:
    assert load_law(law_id).equation == equation


def test_voellmys_drag_is_g_over_xi_h() -> None:
    law = load_law("voellmy")
    assert_allclose(law.strength_rows({"dry_friction": [0.2], "xi_h": [2000.0]}), [[0.2, GRAVITY / 2000.0]])


def test_an_inverse_that_is_none_is_refused() -> None:
    law = load_law("voellmy")
    with pytest.raises(ValueError, match="inverse"):
        replace(law, inverse=lambda mu, drag: (mu, drag))
    found = law.parameter_rows(np.array([[0.2, 0.005], [0.3, 0.01]]))
    assert_allclose(found["dry_friction"], [0.2, 0.3])
    assert_allclose(found["xi_h"], [GRAVITY / 0.005, GRAVITY / 0.01])


def test_a_packs_law_that_is_none_is_an_input_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A package that breaks as it is imported is named, and its error told in one line."""
    (tmp_path / "broken_pack.py").write_text("raise ValueError('inverse does not undo strengths')\n")
    about = tmp_path / "broken_pack-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: broken-pack\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[skred.laws]\nmine = broken_pack:LAW\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(InputError, match="broken_pack:LAW cannot be loaded.*inverse does not undo"):
        load_law("mine")
