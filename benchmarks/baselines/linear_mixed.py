"""The linear mixed model: each event its own base coefficients from a population, one common addition.

``y_i = X_i theta_i + Z_i delta_i + C_i c + e_i`` in units of the errors, ``theta_i ~ N(mean, T)``,
``delta_i ~ N(0, 1)`` (the release), ``c`` normal. Everything is done with cross products, for many additions
at a time, each with a population of its own: spreads fixed without it would hide or feign it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

FloatArray = NDArray[np.float64]
SPREAD, PRIOR_EVENTS = 0.13, 2.0
"""Relative spread of base coefficients across events beforehand, and how many events that is worth."""
_MEAN_SD = 1.5
_ROUNDS = 40


class Products(NamedTuple):
    """Cross products of whitened columns; q counts base coefficients and the release.

    Attributes
    ----------
    xx : (n_events, q, q) array
    xy : (n_events, q) array
    xc : (n_events, q, n_added) array
    cc : (n_events, n_added) array
        Each addition's own only.
    cy : (n_events, n_added) array
    """

    xx: FloatArray
    xy: FloatArray
    xc: FloatArray
    cc: FloatArray
    cy: FloatArray


class Fits(NamedTuple):
    """One fit for each addition alone.

    Attributes
    ----------
    log_evidence : (n,) array
        Base mean and strength integrated out, the population's covariance at its most probable.
    strength, sd : (n,) arrays
        Of the addition, without regard to its sign.
    log_positive : (n,) array
        Log of twice the probability that it is positive.
    mean : (n, p) array
    covariance : (n, p, p) array
    random : (n, n_events, q) array
        Deviations of the events' coefficients from the mean, and their releases'.
    """

    log_evidence: FloatArray
    strength: FloatArray
    sd: FloatArray
    log_positive: FloatArray
    mean: FloatArray
    covariance: FloatArray
    random: FloatArray


def products(x: FloatArray, y: FloatArray, c: FloatArray) -> Products:
    """Cross products of columns in units of the errors: (n_events, n, q), (n_events, n), (n_events, n, k)."""
    return Products(
        np.einsum("eij,eik->ejk", x, x),
        np.einsum("eij,ei->ej", x, y),
        np.einsum("eij,eik->ejk", x, c, optimize=True),
        np.einsum("eik,eik->ek", c, c),
        np.einsum("eik,ei->ek", c, y, optimize=True),
    )


def _log_prior(covariance: FloatArray) -> FloatArray:
    """Log density of populations as PRIOR_EVENTS more events would have it, (n,)."""
    inverse = np.linalg.inv(covariance)
    log_det = np.linalg.slogdet(covariance)[1]
    trace = SPREAD**2 * np.einsum("kii->k", inverse)
    return np.asarray(-0.5 * PRIOR_EVENTS * (log_det + trace))


def fit_each(of: Products, scales: FloatArray, n_base: int, n_rounds: int = _ROUNDS) -> Fits:
    """Fit each addition alone, by expectation-maximisation over populations.

    Parameters
    ----------
    scales : (n_added,) array
        Prior standard deviation of each strength; 0 for none at all.
    n_base : int
        Base coefficients, in units in which they are near 1.
    """
    n, n_events = len(scales), len(of.xx)
    covariance = np.tile(4.0 * SPREAD**2 * np.eye(n_base), (n, 1, 1))
    prior = np.zeros((n, n_base + 1, n_base + 1))
    prior[:, :n_base, :n_base] = np.eye(n_base) / _MEAN_SD**2
    prior[:, -1, -1] = np.maximum(scales, 1e-9) ** -2.0
    for _ in range(n_rounds - 1):
        solved = _solve(of, covariance, prior)
        own = solved.random[:, :, :n_base]
        moment = np.einsum("kei,kej->kij", own, own) + solved.cover[:, :, :n_base, :n_base].sum(axis=1)
        covariance = (moment + PRIOR_EVENTS * SPREAD**2 * np.eye(n_base)) / (n_events + PRIOR_EVENTS)
    solved = _solve(of, covariance, prior)
    coefficients = solved.coefficients
    sd = np.sqrt(np.linalg.inv(solved.total)[:, -1, -1])
    explained = np.einsum("ej,kej->k", of.xy, solved.pulled, optimize=True)
    explained += np.einsum("kl,kl->k", solved.right, coefficients)
    height = 0.5 * explained + 0.5 * np.linalg.slogdet(solved.cover)[1].sum(axis=1)
    height -= 0.5 * n_events * np.linalg.slogdet(covariance)[1]
    height += 0.5 * np.linalg.slogdet(prior)[1] - 0.5 * np.linalg.slogdet(solved.total)[1]
    height += _log_prior(covariance)
    log_positive = np.log(2.0) + log_ndtr(coefficients[:, -1] / sd)
    return Fits(
        height, coefficients[:, -1], sd, log_positive, coefficients[:, :-1], covariance, solved.random
    )


class _Solved(NamedTuple):
    """The model at given populations; the first axis is the addition's."""

    cover: FloatArray
    total: FloatArray
    right: FloatArray
    coefficients: FloatArray
    pulled: FloatArray
    random: FloatArray


def _solve(of: Products, covariance: FloatArray, prior: FloatArray) -> _Solved:
    """Shared coefficients (base mean, then the addition's) and the events' own, at given populations."""
    n, n_base, _ = covariance.shape
    n_events, q = of.xy.shape
    precision = np.tile(np.eye(q), (n, 1, 1))
    precision[:, :n_base, :n_base] = np.linalg.inv(covariance)
    cover = np.linalg.inv(of.xx[None] + precision[:, None])
    base = np.broadcast_to(of.xx[None, :, :, :n_base], (n, n_events, q, n_base))
    shared = np.concatenate([base, np.moveaxis(of.xc, 2, 0)[..., None]], axis=3)
    left = np.einsum("keij,kejl->keil", cover, shared, optimize=True)
    total = prior - np.einsum("kejl,kejm->klm", shared, left, optimize=True)
    crossed = of.xc[:, :n_base].sum(axis=0).T
    total[:, :n_base, :n_base] += of.xx[:, :n_base, :n_base].sum(axis=0)
    total[:, :n_base, -1] += crossed
    total[:, -1, :n_base] += crossed
    total[:, -1, -1] += of.cc.sum(axis=0)
    right = -np.einsum("kejl,ej->kl", left, of.xy, optimize=True)
    right[:, :n_base] += of.xy[:, :n_base].sum(axis=0) + 1.0 / _MEAN_SD**2
    right[:, -1] += of.cy.sum(axis=0)
    coefficients = np.linalg.solve(total, right[:, :, None])[:, :, 0]
    pulled = np.einsum("keij,ej->kei", cover, of.xy, optimize=True)
    random = pulled - np.einsum("keil,kl->kei", left, coefficients, optimize=True)
    return _Solved(cover, total, right, coefficients, pulled, random)
