"""The model discrepancy: a force that is not in the list, as a profile along the track.

It is a Gaussian process for the missing retardation per unit mass. It is independent of speed, in proportion
to U^2, or to the difference of U^2 from its typical value; the last is compensated, and shows only in what
is unusual about each front. It has several correlation lengths, and amplitudes like those of listed
mechanisms; it acts everywhere, or about one place. It is the way out of the list, and it says where: the
missing force is estimated inside the equation of motion, not in the residuals (Hooker, 2009, doi
10.1111/j.1541-0420.2008.01172.x), and base strengths, events' deviations and releases have their share first
(orthogonal model error: Sargsyan, Huan and Najm, 2019, doi
10.1615/Int.J.UncertaintyQuantification.2019027384).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import multivariate_normal

from skred.arrays import FloatArray
from skred.diagnosis.evidence.adaptive_sampling import Mode
from skred.diagnosis.evidence.coefficient import Base, Curve
from skred.diagnosis.evidence.refit import Fit
from skred.physics.kernel.columns import Column
from skred.physics.mechanisms.spec import Direction, Setting
from skred.physics.mechanisms.strength_prior import SCALES
from skred.physics.mechanisms.stretches import OPPOSED_SCALES, OPPOSED_SHARE, is_opposed
from skred.physics.terrain import Terrain


@dataclass(frozen=True)
class Kind:
    """One way in which the profile goes with speed.

    Attributes
    ----------
    column : Column
        CONSTANT or QUADRATIC.
    opposed : bool
        Whether it is nil at the typical speed.
    amplitude : float
        Typical standard deviation of the profile; `SCALES` are relative to it.
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

    def each(self, setting: Setting) -> list[Direction]:
        """A direction for the value at each knot."""
        return [entering(setting, self, row) for row in spline_basis(setting.terrain, knots(setting))]

    def together(self, setting: Setting, values: FloatArray) -> tuple[list[Direction], FloatArray]:
        """All values in one direction, with its strength: quicker than a knot each."""
        return [combined(setting, self, knots(setting), values)], np.ones(1)


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
        return self.amplitude**2 * (alike + 1e-6 * np.eye(len(at)))


KINDS = (
    Kind(Column.CONSTANT, False, "m s-2", 0.8, 0.5 * (1.0 - OPPOSED_SHARE), "-f(s)"),
    Kind(Column.QUADRATIC, False, "m-1", 1.5e-3, 0.5 * (1.0 - OPPOSED_SHARE), "-f(s) U^2"),
    Kind(Column.QUADRATIC, True, "m-1", OPPOSED_SCALES * 1.5e-3, OPPOSED_SHARE, "-f(s) (U^2 - U_0^2)"),
)
"""The ways to go with speed. Amplitudes and shares are those of listed mechanisms of the same kind, so that
neither has an advantage by its prior."""
LENGTHS_M = (40.0, 120.0, 400.0)
"""Correlation lengths, all of equal prior probability: from a dam to a good part of a track."""
NEAR_M = LENGTHS_M[1]
"""Standard deviation of the window of a profile that is local, and distance of the windows' centres: about
the length of a listed stretch."""
MOST_KNOTS = 32
"""Coefficients at most: what the cost of a fit grows with."""
_LEAST_STEP_M = 30.0
"""Distance of the knots at least: below it recordings do not tell one from the next."""


@dataclass(frozen=True, eq=False)
class Profile:
    """A fitted profile of one kind.

    Attributes
    ----------
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
    modes : tuple of Mode
        Where values are to be looked for: one for each prior that may count.
    error : float or None
        Standard error of the log Bayes factor, in nats; None where it is by the Laplace approximation.
    """

    kind: Kind
    prior: Prior
    knots_m: FloatArray
    mean: FloatArray
    covariance: FloatArray
    log_bayes_factor: float
    gain: float
    fit: Fit
    modes: tuple[Mode, ...]
    error: float | None = None


def priors_of(kind: Kind, at: FloatArray) -> dict[Prior, float]:
    """All priors of a kind's profile with knots at places, and the log of each one's prior probability.

    Everywhere or local with equal probability, as listed forces are; each equally shared.
    """
    n = max(round((at[-1] - at[0]) / NEAR_M), 1)
    centres = at[0] + (np.arange(n) + 0.5) * (at[-1] - at[0]) / n
    sizes = [(kind.amplitude * part, length) for part in SCALES for length in LENGTHS_M]
    everywhere = [Prior(*size) for size in sizes]
    local = [Prior(*size, float(centre)) for size in sizes if size[1] <= NEAR_M for centre in centres]
    return {one: -math.log(2.0 * len(group)) for group in (everywhere, local) for one in group}


def log_prior_densities(kind: Kind, at: FloatArray, values: FloatArray) -> dict[Prior, FloatArray]:
    """Of a profile's values at its knots, (n, n_knots) to (n,), by each prior of its kind and its share."""
    return {
        prior: share + multivariate_normal(cov=prior.cover(at)).logpdf(values).reshape(-1)
        for prior, share in priors_of(kind, at).items()
    }


def knots(setting: Setting) -> FloatArray:
    """Places of the knots [m]: the recorded part of the track."""
    first, last = setting.recorded_m
    n = int(np.clip(round((last - first) / _LEAST_STEP_M), 4, MOST_KNOTS))
    return np.linspace(first, min(last, setting.terrain.length_m), n)


def spline_basis(terrain: Terrain, at: FloatArray) -> FloatArray:
    """Piecewise linear basis, (n_knots, n_cells): 1 at its own knot, 0 at all others and outside."""
    middle = terrain.middle_s_m
    inside = (middle >= at[0]) & (middle <= at[-1])
    rows = [np.interp(middle, at, unit) * inside for unit in np.eye(len(at))]
    return np.array(rows)


def combined(setting: Setting, kind: Kind, at: FloatArray, values: FloatArray) -> Direction:
    """The profile as one direction, of strength 1."""
    return entering(setting, kind, values @ spline_basis(setting.terrain, at))


def with_mean(base: Base, profile: Profile) -> Base:
    """The law with a profile's mean in, as one direction: quicker than a knot each."""
    direction = combined(base.setting, profile.kind, profile.knots_m, profile.mean)
    return base.with_in(direction, 1.0, profile.fit)


def entering(setting: Setting, kind: Kind, profile: FloatArray) -> Direction:
    """A profile over the cells, (n_cells,), in the equation of motion."""
    if not kind.opposed:
        return Direction((kind.column,), profile[None, :])
    return Direction((kind.column, Column.CONSTANT), np.array([profile, -profile * setting.front_square]))


def alike(kind: Kind, curve: Curve) -> bool:
    """Whether a listed mechanism goes with speed as a kind of the force not in the list does."""
    return kind.column in curve.direction.columns and kind.opposed == is_opposed(curve.shape)


def most_probable(profiles: Sequence[Profile]) -> Profile:
    """The profile of the most probable kind."""
    return max(profiles, key=lambda one: one.log_bayes_factor + math.log(one.kind.share))


def log_evidence_of(profiles: Sequence[Profile]) -> float:
    """Log Bayes factor of the force not in the list over its kinds."""
    factors = [profile.log_bayes_factor for profile in profiles]
    shares = np.array([profile.kind.share for profile in profiles])
    return float(np.logaddexp.reduce(np.array(factors) + np.log(shares / shares.sum())))


def log_evidence_of_some(profiles: Sequence[Profile]) -> float:
    """The same where others of its kinds lead to what no front can do, and count for nothing."""
    share = sum(profile.kind.share for profile in profiles)
    return log_evidence_of(profiles) + math.log(share) if profiles else -math.inf
