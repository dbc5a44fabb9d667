"""A force that is not in the list, added: the law with it checked again, and tried on avalanches left out.

A profile has many coefficients, so nothing that it was fitted to may try it. For each avalanche, or part of
many, the base law and the profile, with its amplitude, correlation length and place, are fitted to the
others alone; only how it goes with speed is not chosen again. Populations are drawn by importance sampling,
profiles around their mean by the Laplace approximation. The base law is tried likewise, so that before and
after differ by the profile alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from skred.arrays import FloatArray, IntArray
from skred.diagnosis.check.bootstrap_test import BootstrapTest, odds_of_recordings, odds_test
from skred.diagnosis.compare.comparison import ComparisonUnderErrors
from skred.diagnosis.discrepancy.fit import fit_profile
from skred.diagnosis.discrepancy.profile import Profile, most_probable, with_mean
from skred.diagnosis.evidence.coefficient import Base
from skred.diagnosis.evidence.conditional_map import EventLikelihood, event_modes
from skred.diagnosis.evidence.event_quadrature import USUAL, event_nodes
from skred.diagnosis.evidence.marginal import evidence, importance_draws, population_at
from skred.diagnosis.evidence.refit import Rounds, refit
from skred.diagnosis.evidence.tolerance import DRAWS
from skred.diagnosis.limits import FEWEST_CLEAN
from skred.diagnosis.predict.draws import Draws, LeftOut
from skred.diagnosis.predict.held_out import HeldOut
from skred.diagnosis.predict.unseen import log_densities
from skred.parallel.processes import worker_pool
from skred.parallel.threads import side_by_side

_PARTS = 24
"""Parts that are left out one after the other, of more avalanches than that: each leaves nearly all others,
and a refit to these takes as much longer as they are more."""


@dataclass(frozen=True, eq=False)
class ProfileLaw:
    """The base law with a profile in.

    Attributes
    ----------
    profile : Profile
        Fitted to all avalanches.
    error_model : str
        Id of the one under which.
    check : BootstrapTest
        The bootstrap test of the law with it; simulated campaigns are not given another profile, the
        recordings have had theirs fitted to them, so that its p-value is rather too high.
    before, after : HeldOut
        Of avalanches left out, without the profile and with it.
    draws_before, draws_after : Draws
        By all avalanches; with the profile its values at the knots are the strengths.
    """

    profile: Profile
    error_model: str
    check: BootstrapTest
    before: HeldOut
    after: HeldOut
    draws_before: Draws
    draws_after: Draws


def profile_law(under_errors: ComparisonUnderErrors, seed: int) -> ProfileLaw:
    """Add the most probable profile of a comparison.

    Parameters
    ----------
    under_errors : ComparisonUnderErrors
        The comparison under the error model that the force has most evidence under.
    """
    base, profile = under_errors.base, most_probable(under_errors.profiles)
    parts = parts_left_out(len(base.rows.event), seed)
    with worker_pool() as pool:
        fitted = list(pool.map(partial(_left_out, base, profile, seed), parts))
    before, after = (_held_out(base, others, seed) for others in zip(*_by_event(fitted), strict=True))
    check, rng = _check(base, profile, seed), np.random.default_rng([seed, 55])
    without, within = _plain(base, rng).draws, with_profile(base, profile, rng).draws
    return ProfileLaw(profile, base.problem.error_model.id, check, before, after, without, within)


def _check(base: Base, profile: Profile, seed: int) -> BootstrapTest:
    """The bootstrap test of the law with the profile in."""
    added = with_mean(base, profile)
    draws = _draws(base, added, np.empty((FEWEST_CLEAN, 0)), np.random.default_rng([seed, 51]))
    return odds_test(added, (draws.means, draws.factors), seed + 1, odds_of_recordings(added, seed + 1))


def parts_left_out(n: int, seed: int) -> list[IntArray]:
    """Which of `n` avalanches are left out together: each by itself, or of many some at random."""
    order = np.arange(n) if n <= _PARTS else np.random.default_rng([seed, 54]).permutation(n)
    return np.array_split(order, min(n, _PARTS))


def _by_event[Fitted](fitted: Sequence[tuple[IntArray, Fitted]]) -> list[Fitted]:
    """What was fitted without each avalanche, from what was without each part."""
    of_event = {int(event): one for part, one in fitted for event in part}
    return [of_event[event] for event in sorted(of_event)]


def _left_out(
    base: Base, profile: Profile, seed: int, part: IntArray
) -> tuple[IntArray, tuple[LeftOut, LeftOut]]:
    """A part, and what the others say of its avalanches, without the profile and with it."""
    rest, rng = _without(base, part), _rng(seed, part)
    before = _plain(rest, rng)
    near = profile.mean, (profile.fit.population, np.delete(profile.fit.points, part, axis=0))
    return part, (before, with_profile(rest, fit_profile(rest, profile.kind, near, profile.prior), rng))


def base_left_out(base: Base, seed: int) -> HeldOut:
    """Each avalanche as the base law has it, fitted to the others, or to those outside its part."""
    parts = parts_left_out(len(base.rows.event), seed)
    fitted = [(part, _plain(_without(base, part), _rng(seed, part))) for part in parts]
    return _held_out(base, _by_event(fitted), seed)


def _rng(seed: int, part: IntArray) -> np.random.Generator:
    return np.random.default_rng([seed, 53, int(part[0])])


def _plain(base: Base, rng: np.random.Generator) -> LeftOut:
    """The base law, and draws by the base's events."""
    own = np.tile(base.strengths, (DRAWS, 1))
    return LeftOut(base.extended(), _draws(base, base, own, rng))


def with_profile(base: Base, profile: Profile, rng: np.random.Generator) -> LeftOut:
    """The law with a profile fitted to the base's events, each knot a strength; draws by those events.

    The profile's values are drawn by the Laplace approximation.
    """
    wide = base.extended(*profile.kind.each(base.setting))
    values = rng.multivariate_normal(profile.mean, profile.covariance, DRAWS)
    return LeftOut(wide, _draws(base, with_mean(base, profile), base.given(values), rng))


def _without(base: Base, part: IntArray) -> Base:
    """The base law fitted to all events but some."""
    rows = base.rows.take(np.delete(np.arange(len(base.rows.event)), part))
    start = base.population, np.delete(base.fit.points, part, axis=0)
    fit = refit(base.extended(), rows, base.strengths[None, :], start, Rounds())[0]
    return replace(base, rows=rows, fit=fit)


def _draws(base: Base, fitted: Base, strengths: FloatArray, rng: np.random.Generator) -> Draws:
    """Populations by the base's events at fitted strengths, as many as there are draws of strengths."""
    population = fitted.population
    likelihood = EventLikelihood(fitted.extended(), base.rows, fitted.strengths)
    modes = event_modes(likelihood, fitted.fit.points, population)
    nodes = event_nodes(likelihood, population, modes, USUAL, base.population).nodes
    found = evidence(nodes, base.log_scale, fitted.fit.found.psi)
    psi = importance_draws(nodes, base.log_scale, found, len(strengths), rng)
    drawn = population_at(psi, len(base.law.mechanisms))
    return Draws(drawn.mean, np.linalg.cholesky(drawn.covariance), strengths)


def _held_out(base: Base, others: Sequence[LeftOut], seed: int) -> HeldOut:
    """All avalanches, each as the others have it: refitted, nothing reweighted."""

    def score(event: int) -> float:
        extension, draws = others[event]
        rows = base.rows.take(np.flatnonzero(base.rows.event == event))
        densities = log_densities(extension, rows, draws, seed)
        # NumPy's, not scipy's: see `comparison` on threads.
        return float(np.logaddexp.reduce(densities[:, 0])) - math.log(len(densities))

    scores = np.array(side_by_side(score, range(len(others))))
    return HeldOut.of(scores, others, seed, refitted=tuple(base.problem.campaign.event_ids))
