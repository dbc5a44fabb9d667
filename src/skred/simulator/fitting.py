"""Modes of the events' latent parameters, and a population that suits them: where integration begins.

Damped Gauss-Newton steps for all events at once, with expectation-maximisation of the population for the
linearised readings in between. A weak prior keeps the population where avalanches are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skred.arrays import BoolArray, FloatArray
from skred.simulator.effects import Hidden
from skred.simulator.readings import PARAMETERS, Sensors, read
from skred.simulator.terrain import Ground

STEP_LOG = 4e-3
"""Step of a difference in the log of a parameter: wide, because a speed just above a stop is steep."""
STEP_M = 2.0
STOP_SCALE_M = 20.0
LONGEST_MOVE = 0.5
"""Of a latent parameter in one step."""
INNER_STEPS = 15
PRIOR_MEAN_SD = 1.0
"""Of the population's mean log about the log of what is usual."""
PRIOR_SPREAD, PRIOR_EVENTS = 0.13, 2.0
"""The spread that is expected, and the number of events that this expectation is usually worth."""


@dataclass(frozen=True, eq=False)
class Setting:
    """What is known of the recordings before they are read.

    Attributes
    ----------
    ground, base, sensors
        Track, base law, speed sensors.
    releases_m, release_sd_m : (n_events,) array and float, m
        Noted release points, and their standard deviation.
    relative_sd, absolute_sd : (n_sensors,) array
        Errors of the readings; the runout is last.
    recorded : (n_events, n_sensors) bool array
        False where the reading is missing.
    usual : (n_parameters,) array
        Base parameters about which the population is expected.
    prior_events : float
        The number of events that what is expected of the population's spread is worth.
    """

    ground: Ground
    base: str
    sensors: Sensors
    releases_m: FloatArray
    release_sd_m: float
    relative_sd: FloatArray
    absolute_sd: FloatArray
    recorded: BoolArray
    usual: FloatArray
    prior_events: float = PRIOR_EVENTS

    @property
    def n_parameters(self) -> int:
        """Number of base parameters."""
        return len(PARAMETERS[self.base])


@dataclass(frozen=True, eq=False)
class Target:
    """Readings to be fitted, which speed sensors were reached, and standard deviations."""

    values: FloatArray
    reached: BoolArray
    sd: FloatArray


@dataclass(frozen=True, eq=False)
class Population:
    """Normal distribution of the latent parameters: logs of base parameters, then the scaled release.

    Attributes
    ----------
    mean : (n_latent,) array
        0 for the release.
    precision : (n_latent, n_latent) array
        1 for the release.
    """

    mean: FloatArray
    precision: FloatArray


@dataclass(frozen=True, eq=False)
class Modes:
    """Where each event's latent parameters are most probable.

    Attributes
    ----------
    theta : (n_events, n_latent) array
        The modes.
    information : (n_events, n_latent, n_latent) array
        Of the readings there.
    population : Population
        What suits them.
    """

    theta: FloatArray
    information: FloatArray
    population: Population


def predict(setting: Setting, theta: FloatArray, hidden: Hidden | None) -> tuple[FloatArray, BoolArray]:
    """Readings of fronts with these latent parameters, and whether each sensor was reached.

    `theta` may hold several rows for each event, all of the first event's first.
    """
    k, each = setting.n_parameters, len(theta) // len(setting.releases_m)
    parameters, releases = np.exp(theta[:, :k]), np.repeat(setting.releases_m, each)
    if theta.shape[1] > k:
        releases = releases + theta[:, k] * setting.release_sd_m
    terms, factor, sensors = None, np.ones(len(setting.absolute_sd)), setting.sensors
    if hidden is not None:
        parameters[:, 0] *= np.repeat(np.exp(hidden.friction), each)
        releases = releases + hidden.release_m
        terms, factor = np.repeat(hidden.terms, each, axis=0), hidden.factor
        sensors = sensors.moved(hidden.shift_m)
    found = read(setting.ground, setting.base, parameters, np.maximum(releases, 1.0), sensors, terms)
    return found.values * factor, found.reached


def target_of(setting: Setting, theta: FloatArray, hidden: Hidden | None) -> Target:
    """Exact readings of the truth with their standard deviations."""
    values, reached = predict(setting, theta, hidden)
    return Target(values, reached, np.hypot(setting.relative_sd * values, setting.absolute_sd))


def residuals(setting: Setting, target: Target, theta: FloatArray, hidden: Hidden | None) -> FloatArray:
    """Reading less prediction over the standard deviation, NaN where there is none.

    A sensor that was not reached counts where the runout is missing, softly.
    """
    each = len(theta) // len(setting.releases_m)
    values = predict(setting, theta, hidden)[0]
    wanted, sd = (np.repeat(table, each, axis=0) for table in (target.values, target.sd))
    reached, recorded = (np.repeat(table, each, axis=0) for table in (target.reached, setting.recorded))
    found: FloatArray = (wanted - values) / sd
    beyond = np.maximum(values[:, -1:] - setting.sensors.s_to_m, 0.0) / STOP_SCALE_M
    unreached = np.where(recorded[:, -1:], np.nan, -beyond)
    found[:, :-1] = np.where(reached[:, :-1], found[:, :-1], unreached)
    return np.where(recorded, found, np.nan)


def _linearised(
    setting: Setting, target: Target, theta: FloatArray, hidden: Hidden | None
) -> tuple[FloatArray, FloatArray]:
    """Residuals (zero for none) and their derivatives by the latent parameters."""
    n_latent = theta.shape[1]
    steps = np.full(n_latent, STEP_LOG)
    if n_latent > setting.n_parameters:
        steps[-1] = STEP_M / setting.release_sd_m
    moved = np.concatenate([np.zeros((1, n_latent)), np.diag(steps)])
    nodes = (theta[:, None, :] + moved).reshape(-1, n_latent)
    found = np.nan_to_num(residuals(setting, target, nodes, hidden)).reshape(len(theta), n_latent + 1, -1)
    jacobian = (found[:, 1:] - found[:, :1]) / steps[:, None]
    return found[:, 0], np.swapaxes(jacobian, 1, 2)


def first_population(setting: Setting, n_latent: int) -> Population:
    """What is expected before anything is read."""
    precision, mean = np.eye(n_latent), np.zeros(n_latent)
    k = setting.n_parameters
    precision[:k, :k] /= PRIOR_SPREAD**2
    mean[:k] = np.log(setting.usual)
    return Population(mean, precision)


def updated(
    setting: Setting, population: Population, means: FloatArray, covariances: FloatArray
) -> Population:
    """Most probable population given each event's posterior mean and covariance."""
    k, n = setting.n_parameters, len(means)
    precision = population.precision[:k, :k]
    prior = np.eye(k) / PRIOR_MEAN_SD**2
    usual = np.log(setting.usual)
    centre = np.linalg.solve(n * precision + prior, precision @ means[:, :k].sum(axis=0) + prior @ usual)
    away = means[:, :k] - centre
    scatter = np.sum(away[:, :, None] * away[:, None, :] + covariances[:, :k, :k], axis=0)
    worth = setting.prior_events
    covariance = (scatter + worth * PRIOR_SPREAD**2 * np.eye(k)) / (n + worth)
    mean, full = population.mean.copy(), population.precision.copy()
    mean[:k], full[:k, :k] = centre, np.linalg.inv(covariance)
    return Population(mean, full)


def penalty(setting: Setting, population: Population) -> float:
    """Minus twice the log of the weak prior of the population."""
    k = setting.n_parameters
    precision = population.precision[:k, :k]
    off = (population.mean[:k] - np.log(setting.usual)) / PRIOR_MEAN_SD
    log_det = -np.linalg.slogdet(precision)[1]
    spread = log_det + PRIOR_SPREAD**2 * np.trace(precision)
    return float(off @ off + setting.prior_events * spread)


def _maximise(
    setting: Setting, theta: FloatArray, slope: FloatArray, information: FloatArray, population: Population
) -> Population:
    """Expectation-maximisation of the population with the readings linearised at `theta`."""
    for _ in range(INNER_STEPS):
        posterior = np.linalg.inv(information + population.precision)
        gradient = slope + (theta - population.mean) @ population.precision
        move = np.einsum("eij,ej->ei", posterior, gradient)
        population = updated(setting, population, theta - move.clip(-LONGEST_MOVE, LONGEST_MOVE), posterior)
    return population


def find_modes(
    setting: Setting, target: Target, hidden: Hidden | None, start: FloatArray, steps: int = 10
) -> Modes:
    """Find each event's mode and the population.

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
    steps : int
        Most Gauss-Newton steps.
    """
    theta, eye = start.copy(), np.eye(start.shape[1])
    population = first_population(setting, start.shape[1])
    damping = np.full(len(theta), 1e-3)
    r, jac = _linearised(setting, target, theta, hidden)
    for _ in range(steps):
        information, slope = np.einsum("eso,esp->eop", jac, jac), np.einsum("eso,es->eo", jac, r)
        population = _maximise(setting, theta, slope, information, population)
        hessian = information + population.precision
        scale = np.einsum("eoo->eo", hessian)[:, :, None] * eye
        gradient = slope + (theta - population.mean) @ population.precision
        move = np.linalg.solve(hessian + damping[:, None, None] * scale, -gradient[:, :, None])[:, :, 0]
        trial = theta + move.clip(-LONGEST_MOVE, LONGEST_MOVE)
        r_trial, jac_trial = _linearised(setting, target, trial, hidden)
        better = _objective(r_trial, trial, population) <= _objective(r, theta, population) + 1e-9
        theta = np.where(better[:, None], trial, theta)
        r, jac = np.where(better[:, None], r_trial, r), np.where(better[:, None, None], jac_trial, jac)
        damping = np.where(better, np.maximum(damping * 0.2, 1e-6), np.minimum(damping * 8.0, 1e4))
        if better.all() and np.max(np.abs(move)) < 1e-3:
            break
    return Modes(theta, np.einsum("eso,esp->eop", jac, jac), population)


def _objective(r: FloatArray, theta: FloatArray, population: Population) -> FloatArray:
    """What an event's mode minimises."""
    away = theta - population.mean
    penalties = np.einsum("eo,op,ep->e", away, population.precision, away)
    value: FloatArray = np.einsum("es,es->e", r, r) + penalties
    return value
