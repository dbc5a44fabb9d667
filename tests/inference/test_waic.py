"""WAIC against published numbers, on posteriors that can be drawn from exactly."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_allclose
from scipy.optimize import minimize
from scipy.stats import norm

from skred.inference.waic import Waic, waic

# Rubin's eight schools: estimated effects and their standard errors.
EFFECT = np.array([28.0, 8, -3, 7, -1, 1, 18, 12])
ERROR = np.array([15.0, 10, 16, 11, 9, 11, 10, 18])
N_DRAWS = 100_000


def labelled(log_likelihood: np.ndarray) -> xr.DataArray:
    """Draws by events as four chains."""
    return xr.DataArray(
        log_likelihood.reshape(4, -1, log_likelihood.shape[-1]), dims=("chain", "draw", "event"), name="y"
    )


def eight_schools(pooling: str) -> np.ndarray:
    """Independent posterior draws of the eight effects under a flat prior on (mu, tau)."""
    rng = np.random.default_rng(20140)
    if pooling == "none":
        return rng.normal(EFFECT, ERROR, (N_DRAWS, 8))
    if pooling == "complete":
        variance = 1 / np.sum(ERROR**-2)
        return rng.normal(variance * np.sum(EFFECT / ERROR**2), np.sqrt(variance), (N_DRAWS, 1)) * np.ones(8)
    tau = np.linspace(0.005, 200, 20_000)
    total = ERROR**2 + tau[:, None] ** 2
    mu_variance = 1 / np.sum(1 / total, axis=1)
    mu_mean = mu_variance * np.sum(EFFECT / total, axis=1)
    log_weight = 0.5 * np.log(mu_variance) - 0.5 * np.sum(
        np.log(total) + (EFFECT - mu_mean[:, None]) ** 2 / total, axis=1
    )
    weight = np.exp(log_weight - log_weight.max())
    drawn = rng.choice(len(tau), N_DRAWS, p=weight / weight.sum())
    mu = rng.normal(mu_mean[drawn], np.sqrt(mu_variance[drawn]))[:, None]
    share = tau[drawn][:, None] ** 2 / total[drawn]
    return rng.normal(share * EFFECT + (1 - share) * mu, np.sqrt(share) * ERROR)


def schools_waic(pooling: str) -> Waic:
    return waic(labelled(norm.logpdf(EFFECT, eight_schools(pooling), ERROR)))


# Gelman, Hwang and Vehtari (2014), table of the eight schools: -2 lppd, p_WAIC2 and WAIC. The
# printed digit is 0.05; their posterior and ours are simulated, which is worth another 0.1.
@pytest.mark.parametrize(
    ("pooling", "deviance", "p_waic", "information_criterion"),
    [("none", 60.2, 4.0, 68.2), ("complete", 59.8, 0.7, 61.2), ("hierarchical", 59.2, 1.3, 61.8)],
)
def test_eight_schools_as_published(
    pooling: str, deviance: float, p_waic: float, information_criterion: float
) -> None:
    result = schools_waic(pooling)
    found = [-2 * result.lppd, result.p_waic, -2 * result.elpd_waic]
    assert_allclose(found, [deviance, p_waic, information_criterion], atol=0.15)
    assert result.unreliable == (pooling == "none")


def test_eight_schools_in_closed_form() -> None:
    # Without pooling every log likelihood is -chi2(1)/2 plus a constant: its variance is 1/2.
    result = schools_waic("none")
    assert_allclose(result.lppd, -0.5 * np.sum(np.log(4 * np.pi * ERROR**2)), atol=0.02)
    assert_allclose(result.p_waic_pointwise, 0.5, atol=0.02)
    # Complete pooling: mu ~ N(m, V), the variance of a square of a normal.
    result = schools_waic("complete")
    variance = 1 / np.sum(ERROR**-2)
    residual = EFFECT - variance * np.sum(EFFECT / ERROR**2)
    expected = (4 * residual**2 * variance + 2 * variance**2) / (4 * ERROR**4)
    assert_allclose(result.p_waic_pointwise, expected, rtol=0.02)


def test_stopping_distances_as_published() -> None:
    """McElreath (2020), Statistical Rethinking, section 7.4: WAIC 423.3, se 17.8 from 1000 draws.

    The posterior there is the quadratic approximation of a line through R's ``cars``; 1000 draws
    leave a Monte Carlo error of 0.34 in WAIC and 0.17 in its se.
    """
    speed = np.repeat(
        [4.0, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 22, 23, 24, 25],
        [2, 2, 1, 1, 3, 2, 4, 4, 4, 3, 2, 3, 4, 3, 5, 1, 1, 4, 1],
    )
    distance = np.array(
        "2 10 4 22 16 10 18 26 34 17 28 14 20 24 28 26 34 34 46 26 36 60 80 20 26 54 32 40 32 40 50 42 56 76"
        " 84 36 46 68 32 48 52 56 64 66 54 70 92 93 120 85".split(),
        dtype=float,
    )

    def negative_log_posterior(parameter: np.ndarray) -> float:
        a, b, sigma = parameter
        log_prior = norm.logpdf(a, 0, 100) + norm.logpdf(b, 0, 10) - sigma
        return float(-log_prior - norm.logpdf(distance, a + b * speed, sigma).sum())

    mode = minimize(negative_log_posterior, [-17.0, 4.0, 14.0], method="Nelder-Mead", tol=1e-7).x
    steps = np.diag([0.05, 0.005, 0.01])

    def curvature(p: np.ndarray, q: np.ndarray) -> float:
        corners = [(i * j, mode + i * p + j * q) for i in (-1, 1) for j in (-1, 1)]
        return sum(sign * negative_log_posterior(at) for sign, at in corners) / (4 * p.sum() * q.sum())

    hessian = [[curvature(p, q) for q in steps] for p in steps]
    draw = np.random.default_rng(7).multivariate_normal(mode, np.linalg.inv(hessian), N_DRAWS // 2)
    result = waic(labelled(norm.logpdf(distance, draw[:, :1] + draw[:, 1:2] * speed, draw[:, 2:])))
    assert_allclose(-2 * result.elpd_waic, 423.3, atol=0.7)
    assert_allclose(2 * result.se, 17.8, atol=0.4)


def test_reads_a_tree_and_says_what_is_wrong() -> None:
    array = labelled(np.random.default_rng(1).normal(-3, 0.1, (400, 5)))
    tree = xr.DataTree.from_dict({"log_likelihood": array.to_dataset()})
    assert waic(tree).elpd_waic == waic(array).elpd_waic == pytest.approx(float(waic(array).pointwise.sum()))
    assert waic(array).n_draws == 400
    two = xr.DataTree.from_dict({"log_likelihood": array.to_dataset().assign(other=array)})
    assert waic(two, variable="other").elpd_waic == waic(array).elpd_waic
    with pytest.raises(ValueError, match="name one"):
        waic(two)
    with pytest.raises(ValueError, match="no group log_likelihood"):
        waic(xr.DataTree())
    with pytest.raises(ValueError, match="expected dims"):
        waic(array.isel(event=0))
    with pytest.raises(ValueError, match=r"event number \[2\]"):
        waic(_spoil(array))


def _spoil(array: xr.DataArray) -> xr.DataArray:
    spoiled = array.copy()
    spoiled[{"event": 2, "draw": 3, "chain": 0}] = -np.inf
    return spoiled
