"""Integral regression with per-event base terms: the energy balance, linear in everything that is asked.

Between the release and a reading, ``U^2 / 2 = g * drop - sum of coefficient * integral of the feature``.
Features are integrals over smooth profiles of the speed, so a wrong law costs nothing but the profile. Summed
from the release, readings have independent errors; differences between consecutive readings with their
errors' correlation are the same regression. Base coefficients and release are each event's own, each
candidate has one strength; all are compared by evidence, the strength and the base mean integrated out
exactly. Integrals instead of derivatives: Schaeffer and McCalla (2017), doi 10.1103/PhysRevE.96.023302.
An unlisted force of no shape in particular was tried and left out: it took nulls for itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from skred.campaign import Campaign
from skred.diagnosis.detect.score_test import placed_mechanisms
from skred.diagnosis.evidence.extension import setting_of
from skred.inference.hierarchical.problem import HierarchicalProblem, hierarchical_problem
from skred.physics.kernel.columns import GRAVITY
from skred.physics.law import Law
from skred.physics.laws import load_law
from skred.physics.mechanisms.placed import PlacedMechanism
from skred.physics.mechanisms.spec import Direction, Setting

from .common import Answer, Stretch, is_dense, weighed
from .linear_mixed import Fits, fit_each, products
from .profiles import (
    Balance,
    Ride,
    cell_of,
    energy_balance,
    forward,
    responses,
    shares_passed,
    smoothed,
    starting_coefficients,
)
from .quick_fit import stretch_of

FloatArray = NDArray[np.float64]
# Tuned on development trials, seeds 5000-5029, 5100-5159 and 5200-5239; see `common`.
LIMITS = {"sparse": 3.4, "dense": 2.3}
TEMPERATURES = {"sparse": 8.0, "dense": 1.5}
MODEL_ERROR = {"sparse": 0.03, "dense": 0.01}
"""Error of integrals over profiles that are not quite right, as a share of U^2."""
_PASSES = 4
_OUTLYING = 4.0
_CHANGE = (0.2, 4.0)
"""Least and largest factor by which a base coefficient may change in one pass."""
_SMOOTH = {"sparse": (400.0, 0.003), "dense": (120.0, 0.1)}
"""Correlation length [m] and size of what readings may bend a profile by, see `profiles.smoothed`."""


@dataclass(frozen=True, eq=False)
class Regression:
    """The regression without candidates, in units of the errors.

    Attributes
    ----------
    problem, law, setting
        What it is of.
    ride : Ride
        Smooth profiles.
    balance : Balance
    weight : (n_events, n) array
        Inverse errors; 0 where nothing is known.
    unit : (n_base,) array
        Base coefficients are in these.
    x : (n_events, n, n_base + 1) array
        Base terms, and the release.
    y : (n_events, n) array
    theta : (n_events, n_base) array
        Fitted base coefficients.
    """

    problem: HierarchicalProblem
    law: Law
    setting: Setting
    ride: Ride
    balance: Balance
    weight: FloatArray
    unit: FloatArray
    x: FloatArray
    y: FloatArray
    theta: FloatArray

    def integrals(self, profiles: FloatArray, response: FloatArray) -> FloatArray:
        """Of response times each profile, from the release to the readings, (n_events, n, n_profiles)."""
        releases, place = self.problem.releases.mean, self.balance.place
        parts = [
            shares_passed(self.problem.terrain, release, at) @ (own[:, None] * profiles.T)
            for release, at, own in zip(releases, place, response, strict=True)
        ]
        return np.array(parts)

    def columns(self, directions: list[Direction]) -> FloatArray:
        """What one unit of each direction adds to U^2 at the readings, (n_events, n, n_directions)."""
        result = np.zeros((*self.balance.place.shape, len(directions)))
        terrain = self.problem.terrain
        groups: dict[tuple[Any, float], list[tuple[int, FloatArray]]] = {}
        for k, direction in enumerate(directions):
            speed = direction.weakening_speed or 8.0
            for column, profile in zip(direction.columns, direction.profiles, strict=True):
                groups.setdefault((column, speed), []).append((k, profile))
            result[:, :, k] += self._other(direction)
        for (column, speed), members in groups.items():
            response = responses(terrain, self.ride.middle, speed)[column]
            found = self.integrals(np.array([profile for _, profile in members]), response)
            np.add.at(result, (..., [k for k, _ in members]), -2.0 * found)  # type: ignore[arg-type]
        return result * self.weight[:, :, None]

    def _other(self, direction: Direction) -> FloatArray:
        """Part of a direction that is no force along the track, (n_events, n)."""
        result = np.zeros(self.balance.place.shape)
        if direction.log_strengths is not None:
            own = direction.log_strengths * self.theta[:, 0] / self.unit[0]
            result += _unweighted(self.x[:, :, 0], self.weight) * own[:, None]
        if direction.release:
            result -= direction.release * 2.0 * _pull_at_release(self.problem, self.law, self.theta)[:, None]
        if direction.log_readings is not None:
            speeds = [j for j, one in enumerate(self.problem.campaign.sensors) if not one.is_runout]
            by = direction.log_readings[speeds]
            square = self.ride.at(self.problem.terrain, self.balance.place)
            result[:, :-1] += 2.0 * by * square[:, :-1]
        return result


def _unweighted(column: FloatArray, weight: FloatArray) -> FloatArray:
    return np.asarray(np.where(weight > 0.0, column / np.maximum(weight, 1e-12), 0.0))


def _pull_at_release(problem: HierarchicalProblem, law: Law, theta: FloatArray) -> FloatArray:
    """Acceleration just below each release [m s-2]."""
    terrain = problem.terrain
    cell = cell_of(terrain, problem.releases.mean)
    at_rest = responses(terrain, np.zeros((1, terrain.n_cells)))
    pull = GRAVITY * terrain.sin_slope[cell]
    for k, mechanism in enumerate(law.mechanisms):
        column, profile = mechanism.term(terrain)
        pull = pull - theta[:, k] * (profile * at_rest[column][0])[cell]
    return np.asarray(np.maximum(pull, 0.0))


def regression(campaign: Campaign, base_law: str) -> Regression:
    """Profiles and base terms, in turns: the profile bends the law, the law carries the profile."""
    problem, law = hierarchical_problem(campaign), load_law(base_law)
    setting = setting_of(problem, law)
    theta = starting_coefficients(problem, law)
    length, share = _SMOOTH["dense" if is_dense(campaign) else "sparse"]
    expected = forward(problem.terrain, law, theta, problem.releases.mean)
    balance = energy_balance(problem, None, law, theta)
    ride = smoothed(problem, balance, expected, length, share)
    balance = energy_balance(problem, ride, law, theta)
    for number in range(_PASSES):
        made = _base_terms(problem, law, setting, ride, balance, theta)
        fits = base_fit(made)
        made = _without_outliers(made, fits)
        fits = base_fit(made)
        found = np.clip(fits.mean[0] + fits.random[0, :, :-1], *_CHANGE)
        theta = found * made.unit
        if number + 1 < _PASSES:
            expected = forward(problem.terrain, law, theta, problem.releases.mean)
            ride = smoothed(problem, balance, expected, length, share)
            balance = energy_balance(problem, ride, law, theta)
    return Regression(problem, law, setting, ride, balance, made.weight, made.unit, made.x, made.y, theta)


def _base_terms(
    problem: HierarchicalProblem, law: Law, setting: Setting, ride: Ride, balance: Balance, theta: FloatArray
) -> Regression:
    """Regression at given profiles; `theta` is where it was before."""
    terrain, n_base = problem.terrain, len(law.mechanisms)
    share = MODEL_ERROR["dense" if is_dense(problem.campaign) else "sparse"]
    sd = np.hypot(balance.sd, share * ride.at(terrain, balance.place))
    weight = np.where(balance.known, 1.0 / sd, 0.0)
    unit = np.median(theta, axis=0)
    empty = np.zeros((*balance.place.shape, n_base + 1))
    made = Regression(problem, law, setting, ride, balance, weight, unit, empty, empty[:, :, 0], theta)
    fall = made.integrals(GRAVITY * terrain.sin_slope[None, :], np.ones_like(ride.middle))[:, :, 0]
    x = empty.copy()
    for k, mechanism in enumerate(law.mechanisms):
        column, profile = mechanism.term(terrain)
        response = responses(terrain, ride.middle)[column]
        x[:, :, k] = -2.0 * unit[k] * made.integrals(profile[None, :], response)[:, :, 0]
    x[:, :, -1] = -2.0 * (_pull_at_release(problem, law, theta) * problem.releases.sd)[:, None]
    y = (balance.square - 2.0 * fall) * weight
    return Regression(problem, law, setting, ride, balance, weight, unit, x * weight[:, :, None], y, theta)


def base_fit(made: Regression) -> Fits:
    """The base terms alone."""
    none = np.zeros((*made.y.shape, 1))
    return fit_each(products(made.x, made.y, none), np.zeros(1), made.x.shape[2] - 1)


def _without_outliers(made: Regression, fits: Fits) -> Regression:
    """Readings far from their event's own fit count less."""
    own = fits.random[0].copy()
    own[:, :-1] += fits.mean[0]
    away = np.abs(made.y - np.einsum("eij,ej->ei", made.x, own))
    factor = np.minimum(1.0, _OUTLYING / np.maximum(away, 1e-9))
    return Regression(
        made.problem, made.law, made.setting, made.ride, made.balance, made.weight * factor, made.unit,
        made.x * factor[:, :, None], made.y * factor, made.theta,
    )  # fmt: skip


def log_factors(made: Regression) -> tuple[list[PlacedMechanism], FloatArray]:
    """Log Bayes factor of every candidate of every shape.

    By a prior of one scale, as the limits were tuned by: a baseline stays what it was.
    """
    todo = placed_mechanisms(made.setting)
    n_base = made.x.shape[2] - 1
    of = products(made.x, made.y, made.columns([one.direction for one in todo]))
    scales = np.array([one.added.scale for one in todo])
    fits, null = fit_each(of, scales, n_base), base_fit(made)
    found = fits.log_evidence - null.log_evidence[0]
    signed = np.array([not one.added.either_sign for one in todo])
    found = found + np.where(signed, fits.log_positive, 0.0)
    return todo, found


class IntegralRegression:
    """Energy balance over smooth profiles; all candidates by evidence."""

    id = "integral_regression"

    def answer(self, campaign: Campaign, base_law: str) -> Answer:
        """Compare all candidates."""
        made = regression(campaign, base_law)
        todo, found = log_factors(made)
        ids = [one.mechanism.id for one in todo]
        factors: dict[str, float] = {}
        stretches: dict[str, Stretch | None] = {}
        for name in dict.fromkeys(ids):
            own = np.array([k for k, one in enumerate(ids) if one == name])
            factors[name] = float(logsumexp(found[own]) - np.log(len(own)))
            shape = todo[own[np.argmax(found[own])]].shape
            stretches[name] = stretch_of(shape)
        kind = "dense" if is_dense(campaign) else "sparse"
        return weighed(factors, base_law, LIMITS[kind], TEMPERATURES[kind], stretches)
