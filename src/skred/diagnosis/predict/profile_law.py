"""A force that is not in the list, added: the law with it checked again, and tried on avalanches left out.

A profile has many coefficients, so nothing that it was fitted to may try it. For each avalanche the base law
and the profile, with its amplitude, correlation length and place, are fitted to the others alone; only how
it goes with speed is not chosen again. Populations are drawn by importance sampling, profiles around their
mean by the Laplace approximation. The base law is tried likewise, so that before and after differ by the
profile alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skred.diagnosis.check.bootstrap_test import BootstrapTest, linear_test
from skred.diagnosis.compare.comparison import ComparisonUnderErrors
from skred.diagnosis.discrepancy.fit import fit_profile
from skred.diagnosis.discrepancy.profile import Profile, combined, knot_by_knot, most_probable
from skred.diagnosis.evidence.coefficient import Base
from skred.diagnosis.evidence.conditional_map import EventLikelihood, event_modes
from skred.diagnosis.evidence.event_quadrature import USUAL, event_nodes
from skred.diagnosis.evidence.extension import Extension, extended
from skred.diagnosis.evidence.marginal import evidence, importance_draws, population_at
from skred.diagnosis.evidence.predictive import Predicted, predict_event
from skred.diagnosis.evidence.refit import Fit, Rounds, refit
from skred.diagnosis.predict.draws import Draws, LeftOut
from skred.diagnosis.predict.held_out import HeldOut
from skred.diagnosis.predict.unseen import log_densities
from skred.parallel.threads import side_by_side
from skred.physics.mechanisms.spec import Direction

FloatArray = NDArray[np.float64]
_DRAWS = 200
"""Populations and profiles drawn: as many as a predictor keeps."""
_FRONTS = 1200
"""New fronts for the predictions of an avalanche, as of mechanisms."""
_BUDGET = USUAL.times(2)
"""Quadrature points of a population fitted to the others: their draws are weighed, not only its maximum."""


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


class _Event(NamedTuple):
    """What the others say of one avalanche."""

    log_score: float
    predicted: Predicted
    others: LeftOut


def profile_law(under_errors: ComparisonUnderErrors, most: int, seed: int) -> ProfileLaw:
    """Add the most probable profile of a comparison.

    Parameters
    ----------
    under_errors : ComparisonUnderErrors
        The comparison under the error model that the force has most evidence under.
    most : int
        Campaigns simulated at most for the check.
    """
    base, profile = under_errors.base, most_probable(under_errors.profiles)
    events = range(len(base.rows.event))
    parts = side_by_side(lambda event: _left_out(base, profile, event, seed), events)
    before, after = (_held_out(base, [part[k] for part in parts]) for k in range(2))
    check, rng = _check(base, profile, most, seed), np.random.default_rng([seed, 55])
    _, without = _plain(base, rng)
    _, within = with_profile(base, profile, rng)
    return ProfileLaw(profile, base.problem.error_model.id, check, before, after, without, within)


def _check(base: Base, profile: Profile, most: int, seed: int) -> BootstrapTest:
    """The bootstrap test of the law with the profile in."""
    directions, strengths = _added_terms(base, profile)
    added = replace(base, directions=directions, strengths=strengths, fit=profile.fit)
    rng = np.random.default_rng([seed, 51])
    extension = extended(base.problem, base.law, directions)
    draws = _draws(base, extension, profile.fit, strengths, np.empty((most, 0)), rng)
    return linear_test(added, (draws.means, draws.factors), seed + 1, most)


def _left_out(base: Base, profile: Profile, event: int, seed: int) -> tuple[_Event, _Event]:
    """One avalanche as the others have it, without the profile and with it."""
    rest = _without(base, event)
    rng = _rng(seed, event)
    before = _before(base, rest, event, rng)
    others = np.flatnonzero(base.rows.event != event)
    population = profile.fit.found.population(len(base.law.mechanisms))
    near = profile.mean, (population, profile.fit.points[others])
    again = fit_profile(rest, profile.kind, near, profile.prior)
    return before, _event(base, *with_profile(rest, again, rng), event, rng)


def base_left_out(base: Base, seed: int) -> HeldOut:
    """Each avalanche as the base law has it, fitted to the others."""
    events = range(len(base.rows.event))
    return _held_out(base, [_before(base, _without(base, k), k, _rng(seed, k)) for k in events])


def _rng(seed: int, event: int) -> np.random.Generator:
    return np.random.default_rng([seed, 53, event])


def _before(base: Base, rest: Base, event: int, rng: np.random.Generator) -> _Event:
    """One avalanche as the base law has it that was fitted to the rest."""
    return _event(base, *_plain(rest, rng), event, rng)


def _plain(base: Base, rng: np.random.Generator) -> tuple[Extension, Draws]:
    """The base law, and draws by the base's events."""
    plain = extended(base.problem, base.law, base.directions)
    own = np.tile(base.strengths, (_DRAWS, 1))
    return plain, _draws(base, plain, base.fit, base.strengths, own, rng)


def with_profile(base: Base, profile: Profile, rng: np.random.Generator) -> tuple[Extension, Draws]:
    """The law with a profile fitted to the base's events, each knot a strength; draws by those events.

    Parameters
    ----------
    base : Base
    profile : Profile
        Whose values are drawn by the Laplace approximation.
    rng : numpy.random.Generator
    """
    wide = knot_by_knot(base, profile.kind, profile.knots_m)
    own = np.tile(base.strengths, (_DRAWS, 1))
    values = rng.multivariate_normal(profile.mean, profile.covariance, _DRAWS)
    directions, middle = _added_terms(base, profile)
    narrow = extended(base.problem, base.law, directions)
    return wide, _draws(base, narrow, profile.fit, middle, np.column_stack([own, values]), rng)


def _added_terms(base: Base, profile: Profile) -> tuple[tuple[Direction, ...], FloatArray]:
    """What is added with a profile's mean as one direction, and its strengths: quicker than a knot each."""
    direction = combined(base.setting, profile.kind, profile.knots_m, profile.mean)
    return (*base.directions, direction), np.append(base.strengths, 1.0)


def _without(base: Base, event: int) -> Base:
    """The base law fitted to all events but one."""
    others = np.flatnonzero(base.rows.event != event)
    rows, start = base.rows.take(others), (base.population, base.fit.points[others])
    extension = extended(base.problem, base.law, base.directions)
    given = base.strengths[None, :]
    fit = refit(extension, rows, given, start, Rounds(_BUDGET, USUAL))[0]
    return replace(base, rows=rows, fit=fit)


def _draws(
    base: Base,
    extension: Extension,
    fit: Fit,
    middle: FloatArray,
    strengths: FloatArray,
    rng: np.random.Generator,
) -> Draws:
    """Populations by the base's events at the middle strengths, as many as there are draws of strengths."""
    n = len(base.law.mechanisms)
    population = fit.found.population(n)
    likelihood = EventLikelihood(extension, base.rows, middle)
    modes = event_modes(likelihood, fit.points, population)
    nodes = event_nodes(likelihood, population, modes, _BUDGET, base.population).nodes
    found = evidence(nodes, base.log_scale, fit.found.psi)
    drawn = population_at(importance_draws(nodes, base.log_scale, found, len(strengths), rng), n)
    return Draws(drawn.mean, np.linalg.cholesky(drawn.covariance), strengths)


def _event(base: Base, extension: Extension, draws: Draws, event: int, rng: np.random.Generator) -> _Event:
    """Log score of an avalanche, and predictions of its readings."""
    seed = int(rng.integers(2**31))
    rows = base.rows.take(np.flatnonzero(base.rows.event == event))
    densities = log_densities(extension, rows, *draws, seed)[:, 0]
    means, factors, strengths = (np.resize(part, (_FRONTS, *part.shape[1:])) for part in draws)
    predicted = predict_event(extension, event, means, factors, strengths, rng)
    # NumPy's, not scipy's: see `comparison` on threads.
    score = float(np.logaddexp.reduce(densities)) - math.log(len(densities))
    return _Event(score, predicted, LeftOut(extension, draws))


def _held_out(base: Base, parts: Sequence[_Event]) -> HeldOut:
    """All avalanches, each as the others have it: refitted, nothing reweighted."""
    readings = base.problem.readings
    found = Predicted(*(np.array(values) for values in zip(*(part.predicted for part in parts), strict=True)))
    scores = np.array([part.log_score for part in parts])
    covered = found.covered(readings.values, readings.observed)
    ids, others = tuple(base.problem.campaign.event_ids), tuple(part.others for part in parts)
    return HeldOut(scores, np.zeros(len(scores)), ids, (), found.where(readings.observed), covered, others)
