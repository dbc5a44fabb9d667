"""Places of readings in their predictions without their avalanche, against closed forms and against ArviZ."""

from __future__ import annotations

import arviz_stats as az
import numpy as np
import pytest
import xarray as xr
from scipy.special import ndtr
from scipy.stats import kstest

from skred.model_selection.loo_pit import loo_pit

N, CHAINS, DRAWS = 12, 2, 4000


def tree(y: np.ndarray, names: tuple[str, ...] = ("CD",)) -> xr.DataTree:
    """Readings y of a normal distribution with unknown mean (flat prior) and standard deviation one."""
    rng = np.random.default_rng(3)
    mean = rng.normal(y.mean(), 1.0 / np.sqrt(N), (CHAINS, DRAWS))
    events = [f"e{k}" for k in range(N)]
    coords = {"chain": range(CHAINS), "draw": range(DRAWS), "event": events}
    log_likelihood = -0.5 * (y - mean[..., None]) ** 2 - 0.5 * np.log(2 * np.pi)
    readings = mean[..., None] + rng.standard_normal((CHAINS, DRAWS, N))
    of_sensor = {name: f"event_{name}" for name in names}
    by_sensor = {dim: events for dim in of_sensor.values()}
    predicted = {name: (("chain", "draw", dim), readings) for name, dim in of_sensor.items()}
    observed = {name: (dim, y, {"long_name": f"{name} & co"}) for name, dim in of_sensor.items()}
    return xr.DataTree.from_dict(
        {
            "posterior": xr.Dataset(
                {"mean": (("chain", "draw"), mean)}, coords={k: coords[k] for k in ("chain", "draw")}
            ),
            "log_likelihood": xr.Dataset(
                {"recordings": (("chain", "draw", "event"), log_likelihood)}, coords=coords
            ),
            "posterior_predictive": xr.Dataset(
                predicted, coords={**{k: coords[k] for k in ("chain", "draw")}, **by_sensor}
            ),
            "observed_data": xr.Dataset(observed, coords=by_sensor),
        }
    )


def places(of: xr.DataTree) -> list[dict]:
    loo = az.loo(of, var_name="recordings", pointwise=True)
    return loo_pit(of, loo.log_weights)


def test_against_the_closed_form() -> None:
    """Without its own reading, y is normal around the mean of the others."""
    y = np.random.default_rng(7).standard_normal(N)
    (found,) = places(tree(y))
    others = (y.sum() - y) / (N - 1)
    expected = ndtr((y - others) / np.sqrt(1.0 + 1.0 / (N - 1)))
    assert found["below"] == pytest.approx(expected, abs=0.03)
    assert found["below"] == pytest.approx(found["up_to"]), "no two readings are alike"
    assert found["sensor"] == "CD & co" and found["events"] == [f"e{k}" for k in range(N)]
    assert kstest(found["below"], "uniform").pvalue > 0.01


def test_left_out_means_left_out() -> None:
    """The place of an outlier is farther out without it: with it, it would draw the prediction."""
    y = np.zeros(N)
    y[0] = 2.2
    (found,) = places(tree(y))
    with_it = ndtr((y[0] - y.mean()) / np.sqrt(1.0 + 1.0 / N))
    assert found["below"][0] > with_it


def test_fronts_that_may_not_come_have_a_range() -> None:
    y = np.random.default_rng(5).standard_normal(N)
    of = tree(y)
    # What is below 0 reads 0.
    for group in ("posterior_predictive", "observed_data"):
        of[group]["CD"] = of[group]["CD"].clip(min=0.0)
    (found,) = places(of)
    zero = of["observed_data"]["CD"].values == 0.0
    below, up_to = np.array(found["below"]), np.array(found["up_to"])
    assert np.all(below[zero] == 0.0) and np.all(up_to[zero] > 0.3)
    assert below[~zero] == pytest.approx(up_to[~zero])


def test_sensors_without_predictions_are_left_out_and_thinned_draws_are_taken() -> None:
    y = np.random.default_rng(1).standard_normal(N)
    of = tree(y, ("CD", "LC"))
    whole = places(of)
    thinned = of["posterior_predictive"].to_dataset().isel(draw=slice(None, None, 2)).drop_vars("LC")
    of["posterior_predictive"] = xr.DataTree(thinned)
    (found,) = places(of)
    assert found["below"] == pytest.approx(whole[0]["below"], abs=0.05)
