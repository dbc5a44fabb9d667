"""``import skred``: quick to import, typed, and the same as the commands."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import arviz as az
import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_allclose, assert_array_equal

import skred
from skred.api.results import Result
from skred.cli.main import run
from skred.errors import InputError

SHORT = {"draws": 50, "tune": 100, "chains": 2}
LAZY = """
import sys
import skred
assert set(skred.__all__) <= set(dir(skred))
assert skred.errors.InputError is skred.InputError
heavy = {"numpy", "pymc", "xarray", "numba", "pandas"} & set(sys.modules)
assert not heavy, heavy
"""


@pytest.fixture(scope="module")
def calibrated() -> Result:
    return skred.calibrate("coulomb", seed=1, priors={"dry_friction": 0.3}, **SHORT)


def test_nothing_heavy_is_imported_before_it_is_used() -> None:
    subprocess.run([sys.executable, "-c", LAZY], check=True, timeout=60)


def test_every_name_is_there_with_its_docstring() -> None:
    for name in skred.__all__:
        assert getattr(skred, name).__doc__, name
    with pytest.raises(AttributeError, match="nonsense"):
        _ = skred.nonsense


def test_a_calibration_is_that_of_the_command(calibrated: Result, tmp_path: Path) -> None:
    (tmp_path / "priors.toml").write_text("dry_friction = 0.3\n", encoding="utf-8")
    words = ["--priors", str(tmp_path / "priors.toml"), "--seed", "1", "--draws", "50", "--tune", "100"]
    run(["calibrate", "coulomb", *words, "--chains", "2", "--out", str(tmp_path / "out"), "--quiet"])
    document = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert document["parameters"] == calibrated.document["parameters"]
    with xr.open_datatree(tmp_path / "out" / "posterior.nc", engine="h5netcdf") as tree:
        assert calibrated.posterior is not None
        assert_array_equal(
            tree["posterior"]["dry_friction"], calibrated.posterior["posterior"]["dry_friction"]
        )
        assert json.loads(tree.attrs["changed_priors"]) == {"dry_friction": 0.3}
    where = calibrated.report(tmp_path / "report").parent
    assert {file.name for file in where.iterdir()} == {f.name for f in (tmp_path / "out").iterdir()}


def test_a_changed_prior_is_told(calibrated: Result) -> None:
    assert calibrated.document["changed_priors"] == {"dry_friction": 0.3}
    assert calibrated.statement[0] == "Priors were changed: of coulomb the scale of dry_friction 0.3."
    assert "the scale of dry_friction 0.3" in calibrated.html()
    assert skred.calibrate("coulomb", **SHORT).document["changed_priors"] == {}


def test_arviz_takes_the_posterior(calibrated: Result) -> None:
    assert list(az.summary(calibrated.posterior).index) == ["dry_friction"]
    assert calibrated.tree("posterior.nc")["along_track"]
    with pytest.raises(FileNotFoundError, match=r"there are: posterior\.nc"):
        calibrated.tree("other.nc")


def test_what_recordings_can_tell(tmp_path: Path) -> None:
    campaign = skred.read_campaign("ryggfonn")
    found = skred.identify("coulomb", campaign, priors={"dry_friction": 0.4})
    assert found.posterior is None and found.document["changed_priors"] == {"dry_friction": 0.4}
    assert found.statement[0].startswith("Priors were changed")
    assert (found.report(tmp_path / "out") / "identify.json").is_file()


@pytest.mark.slow
def test_a_comparison_of_a_law_with_one_that_has_more(tmp_path: Path) -> None:
    laws = ["coulomb", skred.laws()["constant"] + skred.mechanisms()["turbulent_drag"]]
    found = skred.compare(laws, draws=500, tune=500, priors={"retardation": 2.0})
    assert found.posterior is not None
    assert set(found.posterior.children) == {"coulomb", "constant+turbulent_drag"}
    assert "of constant+turbulent_drag the scale of retardation 2 m s-2" in found.statement[0]
    page = found.report(tmp_path / "out")
    assert "Priors were changed" in page.read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_prediction() -> None:
    found = skred.predict("constant", draws=500, tune=500)
    assert found.posterior is not None and found.document["gate"]["passed"]
    assert found.tree("prediction.nc").attrs["law"] == "constant"


@pytest.mark.slow
@pytest.mark.timeout(1500)
@pytest.mark.filterwarnings("ignore:Estimated shape parameter of Pareto")  # of one avalanche, rightly
def test_a_diagnosis_tells_of_its_priors_and_arviz_takes_both_laws(tmp_path: Path) -> None:
    found = skred.diagnose("coulomb", quick=True, priors={"dry_friction": 0.4})
    assert found.document["changed_priors"] == {"dry_friction": 0.4}
    assert "Priors were changed" in found.report(tmp_path / "out").read_text(encoding="utf-8")
    for tree in (found.posterior, found.tree("augmented.nc")):
        assert np.isfinite(az.loo(tree).elpd)
        assert set(az.loo_pit(tree).data_vars) == {"LC", "CD", "b", "runout"}


@pytest.mark.slow
def test_nuts_is_warned_of() -> None:
    with pytest.warns(UserWarning, match="kinks"):
        skred.calibrate("constant", sampler="nuts", **SHORT)


def test_what_cannot_be_used_is_told() -> None:
    for wrong in (
        lambda: skred.calibrate("nonsense"),
        lambda: skred.calibrate("pcm", "nowhere"),
        lambda: skred.calibrate("pcm", priors={"mu": 1.0}),
        lambda: skred.calibrate("pcm", errors="normal"),
    ):
        with pytest.raises(InputError):
            wrong()


@pytest.mark.slow
def test_readings_of_fronts_are_those_of_the_kernel_and_have_gradients() -> None:
    import pytensor
    import pytensor.tensor as pt

    from skred.inference.pooled.problem import pooled_problem

    problem = pooled_problem(skred.read_campaign("ryggfonn"))
    law = skred.laws()["voellmy"]
    found = skred.front_readings(law, dry_friction=np.array([0.2, 0.3]), xi_h=3000.0).eval()
    rows = law.strength_rows({"dry_friction": [0.2, 0.3], "xi_h": [3000.0, 3000.0]})
    assert_allclose(found, problem.simulate(law.mechanisms, rows)[:, 0], rtol=1e-12)
    mu = pt.dscalar()
    slope = pytensor.function([mu], pytensor.grad(skred.front_readings("coulomb", dry_friction=mu)[0, 0], mu))
    assert slope(0.4) < 0.0
    drag = pt.constant([3000.0, 3000.0])
    mixed = skred.front_readings(law, dry_friction=mu, xi_h=drag).eval({mu: 0.2})
    assert_allclose(mixed, found[[0, 0]], rtol=1e-12)
