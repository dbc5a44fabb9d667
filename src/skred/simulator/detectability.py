"""Signal-to-noise of a hidden effect: how much better the true model fits, everything refitted in both.

The deviance of a model is minus twice the log likelihood of the population, each event's latent parameters
integrated out, at the exact readings of the truth (which stand for the expectation over noise) and the
population that suits them best. The difference of the deviances without and with the effect is the square of
the signal-to-noise: twice the expected log likelihood ratio.

Integrals are by importance sampling with quasi-random nodes: around each event's mode, narrow and wide, over
the population, and in a second round about the posterior that the first round found.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.special import logsumexp, ndtri
from scipy.stats import qmc

from skred.arrays import FloatArray
from skred.simulator.effects import Hidden
from skred.simulator.fitting import (
    Population,
    Setting,
    Target,
    find_modes,
    penalty,
    residuals,
    target_of,
    updated,
)

NODES, FINAL_NODES = 128, 384
"""For each event: while a strength is sought, and for what is recorded."""
FIRST_ROUND = ((0.15, 1.0), (0.15, 2.5), (0.2, 1.2))
"""Share of the nodes and factor of the standard deviation: about the mode, about it, over the population."""
SECOND_ROUND = ((0.3, 1.2), (0.2, 2.0))
"""The same about the mean and covariance that the first round found."""
POPULATION_STEPS = 40
_FREE = 0.2
"""Events that what is expected of a population's spread is worth where recordings alone are to tell it."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A model fitted to exact readings.

    Attributes
    ----------
    theta : (n_events, n_latent) array
        Posterior means of the logs of the base parameters, and of the release's scaled deviation.
    deviance : float
        Minus twice the log likelihood.
    residuals : (n_events, n_sensors) array
        Reading less prediction at `theta` over the standard deviation; NaN where there is none.
    """

    theta: FloatArray
    deviance: float
    residuals: FloatArray


@dataclass(frozen=True, eq=False)
class Detectability:
    """Signal-to-noise, and the base model's fit to the truth."""

    snr: float
    base_fit: Fit

    def mean_residuals(self) -> FloatArray:
        """Mean residual of each sensor over its standard error; NaN where none is read."""
        r = self.base_fit.residuals
        counts = np.sum(np.isfinite(r), axis=0)
        total = np.nansum(r, axis=0)
        return np.where(counts > 0, total / np.sqrt(np.maximum(counts, 1)), np.nan)


@cache
def _normals(n_latent: int, n_nodes: int) -> FloatArray:
    """Quasi-random standard normal numbers, the same for every event and model."""
    uniform = qmc.Sobol(n_latent, scramble=True, rng=np.random.default_rng(7)).random_base2(
        int(np.ceil(np.log2(n_nodes)))
    )
    normals: FloatArray = ndtri(np.clip(uniform, 1e-9, 1.0 - 1e-9))
    return normals


def _log_normal_density(x: FloatArray, mean: FloatArray, precision: FloatArray) -> FloatArray:
    """Log density of normal distributions; event first, nodes second, constants left out."""
    away = x - mean
    quadratic = np.einsum("eni,eij,enj->en", away, precision, away)
    value: FloatArray = 0.5 * (np.linalg.slogdet(precision)[1][:, None] - quadratic)
    return value


@dataclass(frozen=True, eq=False)
class _Cloud:
    """Nodes of each event drawn from a normal distribution of its own."""

    share: float
    centre: FloatArray
    precision: FloatArray
    nodes: FloatArray

    def log_density(self, nodes: FloatArray) -> FloatArray:
        """Log density there, times the share."""
        return np.asarray(np.log(self.share) + _log_normal_density(nodes, self.centre, self.precision))


def _cloud(share: float, centre: FloatArray, covariance: FloatArray, first: int, n_nodes: int) -> _Cloud:
    """A share of `n_nodes` nodes about (n_events, n_latent) centres; `first` counts those there are."""
    normals = _normals(centre.shape[1], n_nodes)[first : first + round(share * n_nodes)]
    root = np.linalg.cholesky(covariance)
    nodes = centre[:, None, :] + np.einsum("eij,nj->eni", root, normals)
    return _Cloud(share, centre[:, None, :], np.linalg.inv(covariance), nodes)


class _Integral:
    """Nodes of every event with their log likelihood, and the integrals they give."""

    def __init__(self, setting: Setting, target: Target, hidden: Hidden | None, n_nodes: int) -> None:
        self.problem = setting, target, hidden
        self.n_nodes = n_nodes
        self.clouds: list[_Cloud] = []
        self.log_likelihood: list[FloatArray] = []

    def add(self, share: float, centre: FloatArray, covariance: FloatArray) -> None:
        """Add a share of the nodes, normal about the centres."""
        there = sum(cloud.nodes.shape[1] for cloud in self.clouds)
        cloud = _cloud(share, centre, covariance, there, self.n_nodes)
        setting, target, hidden = self.problem
        r = np.nan_to_num(residuals(setting, target, cloud.nodes.reshape(-1, centre.shape[1]), hidden))
        self.clouds.append(cloud)
        self.log_likelihood.append(-0.5 * np.sum(r**2, axis=1).reshape(cloud.nodes.shape[:2]))

    def maximise(self, population: Population) -> tuple[Population, FloatArray, FloatArray, FloatArray]:
        """Best population, and each event's log likelihood, posterior mean and covariance under it."""
        nodes = np.concatenate([cloud.nodes for cloud in self.clouds], axis=1)
        density = np.array([cloud.log_density(nodes) for cloud in self.clouds])
        total_share = sum(cloud.share for cloud in self.clouds)
        log_density = np.asarray(logsumexp(density, axis=0)) - np.log(total_share)
        log_likelihood = np.concatenate(self.log_likelihood, axis=1)
        for _ in range(POPULATION_STEPS):
            _, mean, covariance = _integrate(nodes, log_likelihood, log_density, population)
            population = updated(self.problem[0], population, mean, covariance)
        return population, *_integrate(nodes, log_likelihood, log_density, population)


def _integrate(
    nodes: FloatArray, log_likelihood: FloatArray, log_density: FloatArray, population: Population
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Log likelihood, posterior mean and covariance of each event."""
    precision = np.broadcast_to(population.precision, (len(nodes), *population.precision.shape))
    log_prior = _log_normal_density(nodes, population.mean[None, None, :], precision)
    log_weight = log_likelihood + log_prior - log_density
    log_total = np.asarray(logsumexp(log_weight, axis=1))
    weight = np.exp(log_weight - log_total[:, None])
    mean = np.einsum("en,eni->ei", weight, nodes)
    away = nodes - mean[:, None, :]
    covariance = np.einsum("en,eni,enj->eij", weight, away, away)
    return log_total - np.log(nodes.shape[1]), mean, covariance


def fit(
    setting: Setting,
    target: Target,
    hidden: Hidden | None,
    start: FloatArray,
    n_nodes: int = NODES,
) -> Fit:
    """Fit a model to readings and integrate over the events' latent parameters.

    Parameters
    ----------
    setting : Setting
        The recordings' design.
    target : Target
        The readings.
    hidden : Hidden or None
        What the model knows of the hidden effect.
    start : (n_events, n_latent) array
        First guess.
    n_nodes : int
        Nodes for each event.
    """
    modes = find_modes(setting, target, hidden, start)
    population, at = modes.population, modes.theta
    integral = _Integral(setting, target, hidden, n_nodes)
    local = np.linalg.inv(modes.information + population.precision)
    wide = np.broadcast_to(np.linalg.inv(population.precision), local.shape)
    for k, (share, factor) in enumerate(FIRST_ROUND):
        centre = np.broadcast_to(population.mean, at.shape) if k == 2 else at
        integral.add(share, centre, factor**2 * (wide if k == 2 else local))
    population, _, at, covariance = integral.maximise(population)
    covariance = covariance + 0.3 * local + 0.003 * wide
    for share, factor in SECOND_ROUND:
        integral.add(share, at, factor**2 * covariance)
    population, total, mean, _ = integral.maximise(population)
    deviance = -2.0 * float(np.sum(total)) + penalty(setting, population)
    return Fit(mean, deviance, residuals(setting, target, mean, hidden))


def detectability(
    setting: Setting,
    theta: FloatArray,
    hidden: Hidden,
    start: FloatArray | None = None,
    n_nodes: int = NODES,
) -> Detectability:
    """Signal-to-noise of what is hidden.

    Parameters
    ----------
    setting : Setting
        The recordings' design.
    theta : (n_events, n_latent) array
        The events' true latent parameters.
    hidden : Hidden
        What is hidden.
    start : (n_events, n_latent) array, optional
        First guess for the base model.
    n_nodes : int
        Nodes for each event.
    """
    target = target_of(setting, theta, hidden)
    true_fit = fit(setting, target, hidden, theta, n_nodes)
    base_fit = fit(setting, target, None, theta if start is None else start, n_nodes)
    return Detectability(float(np.sqrt(max(base_fit.deviance - true_fit.deviance, 0.0))), base_fit)


def over_noise(
    setting: Setting, theta: FloatArray, hidden: Hidden, rng: np.random.Generator, n: int
) -> FloatArray:
    """Differences of the deviances without and with what is hidden, for readings with errors, (n,).

    Their mean is the square of the signal-to-noise without two shortcuts of `detectability`, which do little
    where an effect moves readings and much where it makes fronts more alike: there errors hide that, and
    exact readings have none; and a population may be as narrow as recordings have it, where what is
    expected of its spread would keep the base law from that.

    Parameters
    ----------
    setting, theta, hidden :
        As `detectability`.
    rng : numpy.random.Generator
        Where errors come from.
    n : int
        How many sets of readings.
    """
    exact, free = target_of(setting, theta, hidden), replace(setting, prior_events=_FREE)
    gained = np.empty(n)
    for k in range(n):
        target = replace(exact, values=exact.values + exact.sd * rng.standard_normal(exact.sd.shape))
        with_it, without = (fit(free, target, known, theta) for known in (hidden, None))
        gained[k] = without.deviance - with_it.deviance
    return gained
