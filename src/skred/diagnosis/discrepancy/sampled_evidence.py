"""The evidence of a force that is not in the list by importance sampling, beside the Laplace approximation.

Where fronts stop near sensors, a climb ends on what is left of integration errors, near the mode and not at
it, and the density is not as curved there as the readings' tangents say. By the Laplace approximation alone
this force can have four nats less than its due, and a listed mechanism its place.
"""

from __future__ import annotations

import math
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial

import numpy as np

from skred.arrays import FloatArray
from skred.diagnosis.discrepancy.fit import mode_at
from skred.diagnosis.discrepancy.profile import KINDS, Profile, log_prior_densities
from skred.diagnosis.evidence.adaptive_sampling import Mixture, Mode, weighted_draws
from skred.diagnosis.evidence.coefficient import Base
from skred.diagnosis.evidence.event_quadrature import USUAL
from skred.diagnosis.evidence.refit import Rounds, refit
from skred.diagnosis.evidence.tolerance import STANDARD_ERROR

_AT_ONCE = 32
"""Draws fitted together."""


def sampled(
    base: Base,
    profile: Profile,
    pool: Executor,
    least: float = -math.inf,
    seed: int = 0,
    n: int = 2 * _AT_ONCE,
    enough: float = STANDARD_ERROR,
) -> Profile:
    """A profile with its log Bayes factor over all priors by importance sampling of its values.

    It is left as it is, by the Laplace approximation, where no draw has fronts that tell anything.

    Parameters
    ----------
    pool : Executor
        For the fits, some draws at once. This itself must not be a job of the pool: it waits for those.
    n : int
        Draws of a turn: two lots, one for each of two cores.
    least, enough : float
        When to end, as in `weighted_draws`.
    """

    def log_density(values: FloatArray) -> FloatArray:
        densities = log_prior_densities(profile.kind, profile.knots_m, values)
        return gains(base, profile, values, pool) + np.logaddexp.reduce(list(densities.values()), axis=0)

    def mode_near(values: FloatArray) -> Mode:
        return pool.submit(mode_at, base, profile, values).result()

    rng = np.random.default_rng([seed, 61, KINDS.index(profile.kind)])
    proposal = Mixture.on(profile.modes)
    found = weighted_draws(log_density, proposal, rng, n, enough, least, mode_near)
    if found.log_integral == -math.inf:
        return profile
    return replace(profile, log_bayes_factor=found.log_integral, error=found.error)


def gains(base: Base, profile: Profile, values: FloatArray, pool: Executor) -> FloatArray:
    """Gain in log evidence over no force, at values of a profile, (n, n_knots) to (n,).

    It is minus infinity where fronts tell nothing.
    """
    parts = [values[first : first + _AT_ONCE] for first in range(0, len(values), _AT_ONCE)]
    found = np.concatenate(list(pool.map(partial(_log_evidence, base, profile), parts)))
    nothing = profile.fit.found.log_evidence - profile.gain
    return np.where(np.isfinite(found), found - nothing, -np.inf)


def _log_evidence(base: Base, profile: Profile, values: FloatArray) -> FloatArray:
    """At values of the profile, (n, n_knots)."""
    extension = base.extended(*profile.kind.each(base.setting))
    # With as many nodes and rounds as the peak and nothing: what is left of integration errors is alike.
    fits = refit(extension, base.rows, base.given(values), profile.fit.start, Rounds(USUAL, least=1))
    return np.array([fit.found.log_evidence for fit in fits])
