"""What maxima under some priors say of the force that is not in the list under all of its priors.

From score and information at a maximum the Laplace approximation gives the evidence under any other prior.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from skred.arrays import FloatArray
from skred.diagnosis.discrepancy.profile import Prior
from skred.diagnosis.evidence.adaptive_sampling import Mode
from skred.diagnosis.evidence.over_scales import log_over_scales
from skred.diagnosis.evidence.refit import Fit
from skred.diagnosis.evidence.tolerance import COUNTS, DECIDES_NOTHING
from skred.physics.mechanisms.placed import PlacedMechanism


@dataclass(frozen=True, eq=False)
class Expansion:
    """The log likelihood of a profile's values to second order, around some of them.

    Attributes
    ----------
    values : (n,) array
        Around which: strengths that are free beside the profile, if there are any, then it at its knots.
    fit : Fit
        Population and events with these values in.
    score : (n,) array
        Slope of the log likelihood there, what is known of population and events taken out.
    information : (n, n) array
        Its negative curvature.
    """

    values: FloatArray
    fit: Fit
    score: FloatArray
    information: FloatArray


class Laplace(NamedTuple):
    """The Laplace approximation of a prior's evidence, from score and information at a maximum.

    Attributes
    ----------
    gain : float
        Of the log likelihood, at the most probable values under the prior.
    prior_penalty : float
        What the prior takes off at those values.
    occam_penalty : float
        What it takes off for the room that it gives to all others.
    values : (n,) array
    covariance : (n, n) array
        Of the values, by prior and recordings together.
    of_scales : float
        What the other scales of the first value's prior add, if that is the strength of a mechanism.
    """

    gain: float
    prior_penalty: float
    occam_penalty: float
    values: FloatArray
    covariance: FloatArray
    of_scales: float = 0.0

    def log_factor(self, most: float = math.inf) -> float:
        """Log Bayes factor if no values gain more than `most`; at least that of no force at all."""
        return max(self._above_none(most), 0.0) - self.occam_penalty + self.of_scales

    def mode(self, most: float) -> Mode:
        """Where values are; around none where no force at all is better."""
        mean = self.values if self._above_none(most) > 0.0 else np.zeros_like(self.values)
        return Mode(mean, self.covariance)

    def _above_none(self, most: float) -> float:
        return min(self.gain, most) - self.prior_penalty


class ExploredPriors:
    """Maxima under some priors, and what they say of all of them.

    Where fronts stop, score and information at one maximum are a poor guide to another far away. A prior that
    was climbed under has its own factor. One about the same place as some that were has the least of their
    approximations. Any other has the largest of all, so that it is climbed under while it could matter. What
    is only approximated in the end counts as if no values gained more than the best that were computed.

    Parameters
    ----------
    height : float
        Log evidence of no force.
    shares : dict
        All priors, and the log of each one's probability.
    covers : dict
        Covariance of the values under each.
    least : float
        Log Bayes factor below which nothing more need be known.
    beside : PlacedMechanism, optional
        Whose strength is the first of the values.
    """

    def __init__(
        self,
        height: float,
        shares: dict[Prior, float],
        covers: dict[Prior, FloatArray],
        least: float = 0.0,
        beside: PlacedMechanism | None = None,
    ) -> None:
        self.beside = beside
        self.height, self.shares, self.covers, self.least = height, shares, covers, least
        self.maxima: dict[Prior, Expansion] = {}
        self.approximations: dict[Prior, dict[Prior, Laplace]] = {prior: {} for prior in shares}

    def add(self, climbed: Prior, maximum: Expansion) -> None:
        """A maximum under a prior."""
        self.maxima[climbed] = maximum
        for prior, cover in self.covers.items():
            self.approximations[prior][climbed] = laplace(maximum, self.height, cover, self.beside)

    def factor(self, prior: Prior, most: float = math.inf) -> float:
        """Log Bayes factor and log prior probability of a prior, as far as is known."""
        most = self._counted(prior, most)
        return self.approximation(prior, most).log_factor(most) + self.shares[prior]

    def approximation(self, prior: Prior, most: float = math.inf) -> Laplace:
        """The approximation of a prior that counts, of those from all maxima."""
        approximations = self.approximations[prior]
        if prior in approximations:
            return approximations[prior]
        near = [one for climbed, one in approximations.items() if climbed.centre_m == prior.centre_m]
        if near:
            return min(near, key=lambda one: one.log_factor(most))
        return max(approximations.values(), key=lambda one: one.log_factor(most))

    @property
    def open(self) -> list[Prior]:
        """The most probable prior not climbed under; none where all of those are improbable together.

        Nor where all priors together have less than the least that counts, even by their approximations.
        """
        left = {prior: self.factor(prior) for prior in self.shares if prior not in self.maxima}
        known = np.logaddexp.reduce([self.factor(prior) for prior in self.shares])
        if (
            not left
            or known < self.least
            or np.logaddexp.reduce(list(left.values())) < known - DECIDES_NOTHING
        ):
            return []
        return [max(left, key=lambda one: left[one])]

    @property
    def log_factor(self) -> float:
        """Log Bayes factor over all priors."""
        return float(np.logaddexp.reduce([self.factor(prior, self._most) for prior in self.shares]))

    @property
    def modes(self) -> tuple[Mode, ...]:
        """Where values may be, under each prior that is not far behind the most probable one."""
        factors = {prior: self.factor(prior, self._most) for prior in self.shares}
        least = max(factors.values()) - COUNTS
        return tuple(
            self.approximation(prior, self._most).mode(self._counted(prior, self._most))
            for prior, factor in factors.items()
            if factor > least
        )

    def _counted(self, prior: Prior, most: float) -> float:
        """The most that values under a prior may gain: what was climbed to needs no limit."""
        return math.inf if prior in self.maxima else most

    @property
    def _most(self) -> float:
        """The most that any values computed have gained."""
        most = max(maximum.fit.found.log_evidence - self.height for maximum in self.maxima.values())
        return max(most, 0.0)


def laplace(
    maximum: Expansion, height: float, cover: FloatArray, beside: PlacedMechanism | None = None
) -> Laplace:
    """The Laplace approximation of a prior's evidence.

    Parameters
    ----------
    maximum : Expansion
        Around a maximum, which may be under another prior.
    height : float
        Log evidence of no force.
    cover : (n, n) array
        Covariance of the values under the prior: of a mechanism's strength, under the widest of its scales.
    beside : PlacedMechanism, optional
        Whose strength is the first of the values.
    """
    precision = np.linalg.inv(cover)
    left = np.linalg.inv(maximum.information + precision)
    step = left @ (maximum.score - precision @ maximum.values)
    score, information = maximum.score, maximum.information
    gain = maximum.fit.found.log_evidence - height + score @ step - 0.5 * step @ information @ step
    values = maximum.values + step
    penalties = prior_penalty(values, precision), occam_penalty(maximum, cover)
    of_scales = 0.0 if beside is None else log_over_scales(float(values[0]), float(left[0, 0]), beside)
    return Laplace(float(gain), *penalties, values, 0.5 * (left + left.T), of_scales)


def prior_penalty(values: FloatArray, precision: FloatArray) -> float:
    """What a prior takes off the log density at some values."""
    return 0.5 * float(values @ precision @ values)


def occam_penalty(maximum: Expansion, cover: FloatArray) -> float:
    """What the room that a prior gives to the values takes off the log evidence."""
    _, log_det = np.linalg.slogdet(np.eye(len(cover)) + cover @ maximum.information)
    return 0.5 * float(log_det)
