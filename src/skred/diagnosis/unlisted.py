"""The unlisted force: a profile along the track, of no shape in particular, inside the equation of motion.

A normal process for the missing retardation per unit mass, independent of speed, in proportion to U^2, or to
the difference of U^2 from its typical value, which shows only in what is unusual about each front; of several
correlation lengths, and amplitudes about what listed mechanisms do; everywhere, or about one place. It is the
way out of the list, and it says where: missing forces estimated inside the equation, not in the residuals
(Hooker, 2009, doi 10.1111/j.1541-0420.2008.01172.x), with base strengths, events' deviations and releases
having their share first (orthogonal model error: Sargsyan, Huan and Najm, 2019, doi
10.1615/Int.J.UncertaintyQuantification.2019027384).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skred.diagnosis.curves import Base, Curve, Fit, refit
from skred.diagnosis.extension import extended
from skred.diagnosis.mixed import efficient_scores, mean_prior
from skred.diagnosis.modes import Population, look_around
from skred.physics.columns import Column
from skred.physics.mechanisms.spec import Direction, Setting
from skred.physics.mechanisms.stretches import OPPOSED_SHARE, is_opposed
from skred.physics.terrain import Terrain

FloatArray = NDArray[np.float64]
Start = tuple[FloatArray, tuple[Population, FloatArray]]


@dataclass(frozen=True)
class Kind:
    """One way in which the profile goes with speed.

    Attributes
    ----------
    column : Column
        CONSTANT or QUADRATIC.
    opposed : bool
        Whether it is nil at the typical speed.
    unit : str
    amplitude : float
        Typical standard deviation of the profile; `PRIORS` are relative to it.
    share : float
        Prior probability among the kinds.
    equation : str
        Its term, f the profile and U_0 the typical speed.
    """

    column: Column
    opposed: bool
    unit: str
    amplitude: float
    share: float
    equation: str


@dataclass(frozen=True)
class Prior:
    """How strong and how smooth the profile is, and where.

    Attributes
    ----------
    amplitude : float
        Its standard deviation.
    length_m : float
        Its correlation length [m].
    centre_m : float or None
        About which place it acts; None is everywhere.
    """

    amplitude: float
    length_m: float
    centre_m: float | None = None

    def cover(self, at: FloatArray) -> FloatArray:
        """Covariance of the profile at places (n,), (n, n)."""
        distance = (at[:, None] - at[None, :]) / self.length_m
        alike = np.exp(-0.5 * distance**2)
        if self.centre_m is not None:
            near = np.exp(-0.5 * ((at - self.centre_m) / NEAR_M) ** 2)
            alike *= near[:, None] * near[None, :]
        found: FloatArray = self.amplitude**2 * (alike + 1e-6 * np.eye(len(at)))
        return found


KINDS = (
    Kind(Column.CONSTANT, False, "m s-2", 0.8, 0.5 * (1.0 - OPPOSED_SHARE), "-f(s)"),
    Kind(Column.QUADRATIC, False, "m-1", 1.5e-3, 0.5 * (1.0 - OPPOSED_SHARE), "-f(s) U^2"),
    # U^2 varies by a third or so between fronts: the same work, then, as without opposition.
    Kind(Column.QUADRATIC, True, "m-1", 4.5e-3, OPPOSED_SHARE, "-f(s) (U^2 - U_0^2)"),
)
AMPLITUDES, LENGTHS_M = (1.0 / 3.0, 1.0, 3.0), (40.0, 120.0, 400.0)
"""Amplitudes in typical ones, and correlation lengths, all of equal prior probability. With one amplitude, a
profile pays for each of its freedoms what the amplitude is off by; a listed mechanism pays that once."""
NEAR_M, _CENTRES_M = 120.0, 150.0
"""Standard deviation of the window of a profile that is local, and the distance of the windows' centres."""
MOST_KNOTS, _LEAST_STEP_M = 32, 30.0
_ROUNDS, _PRIORS_TRIED, _SURE = 6, 12, 1.0
_SHARES = (1.0, 0.4, 0.15, 0.05)
_SETTLED = 0.05


@dataclass(frozen=True, eq=False)
class Profile:
    """A fitted profile of one kind.

    Attributes
    ----------
    kind : Kind
    prior : Prior
        The most probable one, under which it is fitted.
    knots_m : (n,) array
        Between which it is linear; 0 outside.
    mean : (n,) array
        At the knots, in the kind's unit; positive retards.
    covariance : (n, n) array
    log_bayes_factor : float
        Against no such force, over all priors.
    gain : float
        Gain in log evidence at the mean itself, before the price of its freedom.
    fit : Fit
        Population and events with the mean in.
    """

    kind: Kind
    prior: Prior
    knots_m: FloatArray
    mean: FloatArray
    covariance: FloatArray
    log_bayes_factor: float
    gain: float
    fit: Fit


def priors_of(kind: Kind, at: FloatArray) -> dict[Prior, float]:
    """All priors of a kind's profile with knots at places, and the log of each one's prior probability.

    Everywhere or local with equal probability, as listed forces are; each equally shared.
    """
    n = max(round((at[-1] - at[0]) / _CENTRES_M), 1)
    centres = at[0] + (np.arange(n) + 0.5) * (at[-1] - at[0]) / n
    sizes = [(kind.amplitude * part, length) for part in AMPLITUDES for length in LENGTHS_M]
    everywhere = [Prior(*size) for size in sizes]
    local = [Prior(*size, float(centre)) for size in sizes if size[1] <= NEAR_M for centre in centres]
    return {one: -math.log(2.0 * len(group)) for group in (everywhere, local) for one in group}


def knots(setting: Setting) -> FloatArray:
    """Places of the knots [m]: the recorded part of the track."""
    first, last = setting.recorded_m
    n = int(np.clip(round((last - first) / _LEAST_STEP_M), 4, MOST_KNOTS))
    return np.linspace(first, min(last, setting.terrain.length_m), n)


def hats(terrain: Terrain, at: FloatArray) -> FloatArray:
    """Piecewise linear basis, (n_knots, n_cells): 1 at its own knot, 0 at all others and outside."""
    middle = 0.5 * (terrain.edge_s_m[1:] + terrain.edge_s_m[:-1])
    inside = (middle >= at[0]) & (middle <= at[-1])
    rows = [np.interp(middle, at, unit) * inside for unit in np.eye(len(at))]
    return np.array(rows)


def combined(setting: Setting, kind: Kind, at: FloatArray, values: FloatArray) -> Direction:
    """The profile as one direction, of strength 1."""
    return entering(setting, kind, values @ hats(setting.terrain, at))


def entering(setting: Setting, kind: Kind, profile: FloatArray) -> Direction:
    """A profile over the cells, (n_cells,), in the equation of motion."""
    if not kind.opposed:
        return Direction((kind.column,), profile[None, :])
    return Direction((kind.column, Column.CONSTANT), np.array([profile, -profile * setting.front_square]))


def alike(kind: Kind, curve: Curve) -> bool:
    """Whether a listed mechanism goes with speed as a kind of the unlisted force does."""
    return kind.column in curve.direction.columns and kind.opposed == is_opposed(curve.shape)


@dataclass(frozen=True, eq=False)
class _Peak:
    """A profile's values, the fit with it in, and the likelihood's slope and curvature there."""

    values: FloatArray
    fit: Fit
    score: FloatArray
    information: FloatArray


def fit_profile(
    base: Base, kind: Kind, near: Start | None = None, first: Prior | None = None, most: int = _PRIORS_TRIED
) -> Profile:
    """Fit the profile by Gauss-Newton steps around the events' modes; its evidence with nodes at the top.

    Climbed to under one prior after the other, as long as those left could matter; the evidence under them
    follows from the likelihood's slope and curvature at the tops. The most probable one is kept.

    Parameters
    ----------
    near : (values, (Population, points)), optional
        A profile, population and events' points: where to begin, beside no force. Far from what was
        recorded, robust errors see outliers and no direction to go.
    first : Prior, optional
        Under which to climb first.
    most : int
        Priors climbed under at most.
    """
    at = knots(base.setting)
    # Nothing like everything else, so that what is left of integration errors is the same there.
    none = np.zeros(len(at))
    nothing = _fit_at(base, kind, at, none, (base.population, base.fit.points))
    starts = [_peak(base, kind, at, none, nothing)]
    if near is not None:
        starts.append(_peak(base, kind, at, near[0], _fit_at(base, kind, at, *near)))
    height = nothing.found.log_evidence
    seen = _Seen(height, at, priors_of(kind, at))
    next_one: Prior | None = first or Prior(kind.amplitude, NEAR_M)
    while next_one is not None and len(seen.peaks) < most:
        cover = next_one.cover(at)
        start = _highest([*starts, *seen.peaks.values()], cover)
        seen.add(next_one, _climb(base, kind, at, start, cover))
        next_one = seen.open
    prior = max(seen.peaks, key=seen.factor)
    peak = seen.peaks[prior]
    cover = np.linalg.inv(peak.information + np.linalg.inv(prior.cover(at)))
    gain = peak.fit.found.log_evidence - height
    return Profile(kind, prior, at, peak.values, 0.5 * (cover + cover.T), seen.log_factor, gain, peak.fit)


class _Promise(NamedTuple):
    """What slope and curvature at a peak say of a prior.

    Attributes
    ----------
    gain : float
        Of the log likelihood, at the most probable values under the prior.
    price : float
        Of those values.
    freedom : float
        Price of their freedom.
    """

    gain: float
    price: float
    freedom: float

    def log_factor(self, most: float = math.inf) -> float:
        """Log Bayes factor if no values gain more than the most; at least that of no force at all."""
        return max(min(self.gain, most) - self.price, 0.0) - self.freedom


class _Seen:
    """Peaks under some priors, and what they say of all of them.

    Where fronts stop, slope and curvature at one peak are a poor guide to another far away. A prior that was
    climbed under has its own factor; one about the same place as some that were, the least that they promise;
    any other the most that any peak promises, so that it is climbed under while it could matter. What is only
    promised in the end counts as if no values gained more than the best that were computed.
    """

    def __init__(self, height: float, at: FloatArray, priors: dict[Prior, float]) -> None:
        self.height = height
        self.shares = priors
        self.covers = {prior: prior.cover(at) for prior in priors}
        self.peaks: dict[Prior, _Peak] = {}
        self.promises: dict[Prior, dict[Prior, _Promise]] = {prior: {} for prior in priors}

    def add(self, climbed: Prior, peak: _Peak) -> None:
        """A peak under a prior."""
        self.peaks[climbed] = peak
        for prior, cover in self.covers.items():
            self.promises[prior][climbed] = _promise(peak, self.height, cover)

    def factor(self, prior: Prior, most: float = math.inf) -> float:
        """Log Bayes factor and log prior probability of a prior, as far as is known."""
        promises, share = self.promises[prior], self.shares[prior]
        if prior in promises:
            return promises[prior].log_factor() + share
        near = [one for climbed, one in promises.items() if climbed.centre_m == prior.centre_m]
        if near:
            return min(one.log_factor(most) for one in near) + share
        return max(one.log_factor(most) for one in promises.values()) + share

    @property
    def open(self) -> Prior | None:
        """The most probable prior not climbed under; None where all of those are improbable together."""
        left = {prior: self.factor(prior) for prior in self.shares if prior not in self.peaks}
        known = np.logaddexp.reduce([self.factor(prior) for prior in self.shares])
        if not left or np.logaddexp.reduce(list(left.values())) < known - _SURE:
            return None
        return max(left, key=lambda one: left[one])

    @property
    def log_factor(self) -> float:
        """Log Bayes factor over all priors."""
        most = max(peak.fit.found.log_evidence - self.height for peak in self.peaks.values())
        return float(np.logaddexp.reduce([self.factor(prior, max(most, 0.0)) for prior in self.shares]))


def _promise(peak: _Peak, height: float, cover: FloatArray) -> _Promise:
    """What a peak, perhaps one under another prior, says of a prior of this covariance."""
    precision = np.linalg.inv(cover)
    step = np.linalg.solve(peak.information + precision, peak.score - precision @ peak.values)
    gain = peak.fit.found.log_evidence - height + peak.score @ step - 0.5 * step @ peak.information @ step
    _, log_det = np.linalg.slogdet(np.eye(len(cover)) + cover @ peak.information)
    return _Promise(float(gain), _price(peak.values + step, precision), 0.5 * float(log_det))


def _highest(peaks: Sequence[_Peak], cover: FloatArray) -> _Peak:
    """The one with the highest posterior under a prior."""
    precision = np.linalg.inv(cover)
    return max(peaks, key=lambda one: one.fit.found.log_evidence - _price(one.values, precision))


def _price(values: FloatArray, precision: FloatArray) -> float:
    """What a prior takes off the log density of values."""
    return 0.5 * float(values @ precision @ values)


def _climb(base: Base, kind: Kind, at: FloatArray, peak: _Peak, cover: FloatArray) -> _Peak:
    """To the top of the posterior under a prior."""
    precision = np.linalg.inv(cover)
    for _ in range(_ROUNDS):
        step = np.linalg.solve(peak.information + precision, peak.score - precision @ peak.values)
        height = peak.fit.found.log_evidence - _price(peak.values, precision)
        promised = 0.5 * float(step @ (peak.score - precision @ peak.values))
        for share in _SHARES:
            if share * (2.0 - share) * promised < _SETTLED:
                return _at_top(peak, precision)
            values = peak.values + share * step
            fit = _fit_at(base, kind, at, values, _start(base, peak.fit))
            gained = fit.found.log_evidence - _price(values, precision) - height
            if gained > 0.0:
                break
        else:
            break
        peak = _peak(base, kind, at, values, fit)
        if gained < _SETTLED:
            break
    return _at_top(peak, precision)


def _at_top(peak: _Peak, precision: FloatArray) -> _Peak:
    """A peak that was climbed to: a slope that is left over, at kinks where fronts stop, promises none."""
    return replace(peak, score=precision @ peak.values)


def _start(base: Base, fit: Fit) -> tuple[Population, FloatArray]:
    return fit.found.population(len(base.law.mechanisms)), fit.points


def as_profile(base: Base, kind: Kind, near: Curve) -> Start:
    """A listed mechanism that enters like a kind, at its best strength: values at the knots, and its fit."""
    at, top = knots(base.setting), int(np.argmax(near.log_evidence))
    edge = np.asarray(base.setting.terrain.edge_s_m)
    profile = near.direction.profiles[near.direction.columns.index(kind.column)]
    cells = hats(base.setting.terrain, at) * np.diff(edge)
    values = near.strengths[top] * (cells @ profile) / np.maximum(cells.sum(axis=1), 1e-9)
    return values, _start(base, near.fits[top])


def _fit_at(
    base: Base, kind: Kind, at: FloatArray, values: FloatArray, start: tuple[Population, FloatArray]
) -> Fit:
    """Population and events with the profile in."""
    direction = combined(base.setting, kind, at, values)
    extension = extended(base.problem, base.law, [*base.directions, direction])
    strengths = np.append(base.strengths, 1.0)[None, :]
    return refit(extension, base.rows, strengths, start, base.log_scale, n_rounds=1)[0]


def _peak(base: Base, kind: Kind, at: FloatArray, values: FloatArray, fit: Fit) -> _Peak:
    """With efficient score and information of the knots' values at what they are."""
    basis = hats(base.setting.terrain, at)
    directions = [entering(base.setting, kind, row) for row in basis]
    wide = extended(base.problem, base.law, [*base.directions, *directions])
    population, points = _start(base, fit)
    around = look_around(wide, base.rows, points, np.concatenate([base.strengths, values]))
    found = efficient_scores(around, base.rows, population, mean_prior(base.law))
    n_before = len(base.directions)
    return _Peak(values, fit, found.score[0, n_before:], found.information[0, n_before:, n_before:])


def most_probable(profiles: Sequence[Profile]) -> Profile:
    """The profile of the most probable kind."""
    return max(profiles, key=lambda one: one.log_bayes_factor + math.log(one.kind.share))


def log_evidence_of(profiles: Sequence[Profile]) -> float:
    """Log Bayes factor of the unlisted force over its kinds."""
    factors = [profile.log_bayes_factor for profile in profiles]
    shares = np.array([profile.kind.share for profile in profiles])
    return float(np.logaddexp.reduce(np.array(factors) + np.log(shares / shares.sum())))
