"""The unlisted force: a profile along the track, of no shape in particular, inside the equation of motion.

A normal process for the missing retardation per unit mass, independent of speed, in proportion to U^2, or to
the difference of U^2 from its typical value, which shows only in what is unusual about each front; of several
correlation lengths; its amplitude is what listed mechanisms do. It is the way out of the
list, and it says where: missing forces estimated inside the equation, not in the residuals (Hooker, 2009,
doi 10.1111/j.1541-0420.2008.01172.x), with base strengths, events' deviations and releases having their
share first (orthogonal model error: Sargsyan, Huan and Najm, 2019, doi
10.1615/Int.J.UncertaintyQuantification.2019027384).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skred.diagnosis.curves import Base, Curve, Fit, refit
from skred.diagnosis.extension import Extension, extended
from skred.diagnosis.mixed import efficient_scores, mean_prior
from skred.diagnosis.modes import Population, look_around
from skred.physics.columns import Column
from skred.physics.mechanisms.spec import Direction, Setting
from skred.physics.mechanisms.stretches import OPPOSED_SHARE, is_opposed
from skred.physics.terrain import Terrain

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Kind:
    """One prior of the profile.

    Attributes
    ----------
    column : Column
        CONSTANT or QUADRATIC: how it goes with speed.
    opposed : bool
        Whether it is nil at the typical speed.
    unit : str
    amplitude : float
        Standard deviation of the profile.
    length_m : float
        Correlation length.
    share : float
        Prior probability among the kinds.
    """

    column: Column
    opposed: bool
    unit: str
    amplitude: float
    length_m: float
    share: float

    @property
    def enters(self) -> tuple[Column, bool]:
        """How it goes with speed: kinds that go alike have the same directions."""
        return self.column, self.opposed


KINDS = tuple(
    Kind(column, opposed, unit, amplitude, length, share / 2.0)
    for column, opposed, unit, amplitude, share in (
        (Column.CONSTANT, False, "m s-2", 0.8, 0.5 * (1.0 - OPPOSED_SHARE)),
        (Column.QUADRATIC, False, "m-1", 1.5e-3, 0.5 * (1.0 - OPPOSED_SHARE)),
        # U^2 varies by a third or so between fronts: the same work, then, as without opposition.
        (Column.QUADRATIC, True, "m-1", 4.5e-3, OPPOSED_SHARE),
    )
    for length in (80.0, 250.0)
)
_MOST_KNOTS, _LEAST_STEP_M = 16, 30.0
_ROUNDS = 6
_SHARES = (1.0, 0.4, 0.15, 0.05)
_SETTLED = 0.05


@dataclass(frozen=True, eq=False)
class Profile:
    """A fitted profile of one kind.

    Attributes
    ----------
    kind : Kind
    knots_m : (n,) array
        Between which it is linear; 0 outside.
    mean : (n,) array
        At the knots, in the kind's unit; positive retards.
    covariance : (n, n) array
    log_bayes_factor : float
        Against no such force.
    gain : float
        Gain in log evidence at the mean itself, before the price of its freedom.
    fit : Fit
        Population and events with the mean in.
    """

    kind: Kind
    knots_m: FloatArray
    mean: FloatArray
    covariance: FloatArray
    log_bayes_factor: float
    gain: float
    fit: Fit


def knots(setting: Setting) -> FloatArray:
    """Places of the knots [m]: the recorded part of the track."""
    first, last = setting.recorded_m
    n = int(np.clip(round((last - first) / _LEAST_STEP_M), 4, _MOST_KNOTS))
    return np.linspace(first, min(last, setting.terrain.length_m), n)


def hats(terrain: Terrain, at: FloatArray) -> FloatArray:
    """Piecewise linear basis, (n_knots, n_cells): 1 at its own knot, 0 at all others and outside."""
    middle = 0.5 * (terrain.edge_s_m[1:] + terrain.edge_s_m[:-1])
    inside = (middle >= at[0]) & (middle <= at[-1])
    rows = [np.interp(middle, at, unit) * inside for unit in np.eye(len(at))]
    return np.array(rows)


def combined(setting: Setting, kind: Kind, at: FloatArray, values: FloatArray) -> Direction:
    """The profile as one direction, of strength 1."""
    return entering(setting, kind.enters, values @ hats(setting.terrain, at))


def entering(setting: Setting, enters: tuple[Column, bool], profile: FloatArray) -> Direction:
    """A profile over the cells, (n_cells,), in the equation of motion."""
    column, opposed = enters
    if not opposed:
        return Direction((column,), profile[None, :])
    return Direction((column, Column.CONSTANT), np.array([profile, -profile * setting.front_square]))


def alike(kind: Kind, curve: Curve) -> bool:
    """Whether a listed mechanism goes with speed as a kind of the unlisted force does."""
    return kind.column in curve.direction.columns and kind.opposed == is_opposed(curve.shape)


def fit_profile(base: Base, kind: Kind, near: Curve | None = None) -> Profile:
    """Fit the profile by Gauss-Newton steps around the events' modes; its evidence with nodes at the top.

    Parameters
    ----------
    near : Curve, optional
        A listed mechanism in the kind's column: where to begin, instead of at no force. Far from what was
        recorded, robust errors see outliers and no direction to go.
    """
    at = knots(base.setting)
    basis = hats(base.setting.terrain, at)
    directions = [entering(base.setting, kind.enters, row) for row in basis]
    wide = extended(base.problem, base.law, [*base.directions, *directions])
    n_before = len(base.directions)
    distance = (at[:, None] - at[None, :]) / kind.length_m
    prior = kind.amplitude**2 * (np.exp(-0.5 * distance**2) + 1e-6 * np.eye(len(at)))
    precision = np.linalg.inv(prior)
    values, population, points = np.zeros(len(at)), base.population, base.fit.points
    information = np.zeros_like(prior)
    # Nothing like everything else, so that what is left of integration errors is the same there.
    nothing = fit = _fit_at(base, kind, at, values, (population, points))
    if near is not None:
        values, fit = _begin(base, kind, at, near)
        population, points = fit.found.population(len(base.law.mechanisms)), fit.points
    height = fit.found.log_evidence - 0.5 * float(values @ precision @ values)
    score, information = _scores(base, wide, n_before, values, population, points)
    for _ in range(_ROUNDS):
        step = np.linalg.solve(information + precision, score - precision @ values)
        for share in _SHARES:
            new = values + share * step
            tried = _fit_at(base, kind, at, new, (population, points))
            gained = tried.found.log_evidence - 0.5 * float(new @ precision @ new) - height
            if gained > 0.0:
                break
        else:
            break
        values, fit, height = new, tried, height + gained
        population, points = fit.found.population(len(base.law.mechanisms)), fit.points
        score, information = _scores(base, wide, n_before, values, population, points)
        if gained < _SETTLED:
            break
    gain = fit.found.log_evidence - nothing.found.log_evidence
    _, log_det = np.linalg.slogdet(np.eye(len(at)) + prior @ information)
    cover = np.linalg.inv(information + precision)
    factor = gain - 0.5 * float(values @ precision @ values) - 0.5 * float(log_det)
    return Profile(kind, at, values, 0.5 * (cover + cover.T), max(factor, -0.5 * float(log_det)), gain, fit)


def _begin(base: Base, kind: Kind, at: FloatArray, near: Curve) -> tuple[FloatArray, Fit]:
    """A listed mechanism's own profile at its best strength, at the knots, and the fit with it in."""
    top = int(np.argmax(near.log_evidence))
    edge = np.asarray(base.setting.terrain.edge_s_m)
    profile = near.direction.profiles[near.direction.columns.index(kind.column)]
    cells = hats(base.setting.terrain, at) * np.diff(edge)
    values = near.strengths[top] * (cells @ profile) / np.maximum(cells.sum(axis=1), 1e-9)
    fit = near.fits[top]
    start = (fit.found.population(len(base.law.mechanisms)), fit.points)
    return values, _fit_at(base, kind, at, values, start)


def _fit_at(
    base: Base, kind: Kind, at: FloatArray, values: FloatArray, start: tuple[Population, FloatArray]
) -> Fit:
    """Population and events with the profile in."""
    direction = combined(base.setting, kind, at, values)
    extension = extended(base.problem, base.law, [*base.directions, direction])
    strengths = np.append(base.strengths, 1.0)[None, :]
    return refit(extension, base.rows, strengths, start, base.log_scale)[0]


def _scores(
    base: Base,
    wide: Extension,
    n_before: int,
    values: FloatArray,
    population: Population,
    points: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Efficient score and information of the knots' values at what they are."""
    strengths = np.concatenate([base.strengths, values])
    around = look_around(wide, base.rows, points, strengths)
    found = efficient_scores(around, base.rows, population, mean_prior(base.law))
    return found.score[0, n_before:], found.information[0, n_before:, n_before:]


def log_evidence_of(profiles: Sequence[Profile]) -> float:
    """Log Bayes factor of the unlisted force over its kinds."""
    factors = [profile.log_bayes_factor for profile in profiles]
    shares = np.array([profile.kind.share for profile in profiles])
    return float(np.logaddexp.reduce(np.array(factors) + np.log(shares / shares.sum())))
