"""The model comparison: nothing, each mechanism, each instrument fault, a force that is not in the list.

The robust error model takes part, and the one that the base law alone prefers if that is clearly better. So
odd events, heavy tails and correlated errors stay error models and do not become findings. The robust one is
left out where it is so far behind that no candidate can bring it back.

Curves are computed in threads and by worker processes. scipy's `logsumexp` asks there for JAX, which ArviZ
loads only when asked, and two threads that ask at once find half of it; NumPy's does not.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from skred.arrays import FloatArray
from skred.diagnosis.clock import Progress, Tell
from skred.diagnosis.compare.between import with_ways
from skred.diagnosis.compare.candidate import Candidate
from skred.diagnosis.compare.recomputed import recomputed
from skred.diagnosis.compare.refinement import candidates_of, kinds_of, refine
from skred.diagnosis.compare.residue import with_residues
from skred.diagnosis.compare.screening import screened
from skred.diagnosis.compare.sensor_places import Shifts, with_stated_places
from skred.diagnosis.discrepancy.fit import as_profile, fit_profile
from skred.diagnosis.discrepancy.profile import KINDS, Kind, Profile, alike, log_evidence_of, most_probable
from skred.diagnosis.evidence.coefficient import Base, Curve, curve_near
from skred.diagnosis.evidence.conditional_map import (
    EventLikelihood,
    Population,
    campaign_rows,
    event_modes,
    log_joint,
)
from skred.diagnosis.evidence.event_quadrature import FINE, USUAL, event_nodes
from skred.diagnosis.evidence.prior_odds import NOTHING, UNLISTED, log_odds, prior_odds, stated
from skred.diagnosis.evidence.refit import Rounds, refit
from skred.diagnosis.evidence.tolerance import COUNTS, DECIDES_NOTHING
from skred.inference.error_model import DEFAULT_ERRORS, ERROR_MODELS
from skred.parallel.processes import worker_pool
from skred.parallel.threads import side_by_side

ERROR_SHARES = {"robust": 0.55, "student": 0.15, "correlated": 0.15, "scaled": 0.15}
"""Prior probability of each error model in the comparison."""


@dataclass(frozen=True, eq=False)
class ComparisonUnderErrors:
    """The comparison under one error model.

    Attributes
    ----------
    profiles : list of Profile
        The force not in the list, of each kind; none under an error model that cannot count.
    shifts : Shifts, optional
        Of the sensors whose places have stated errors, beside nothing.
    """

    error_model: str
    base: Base
    candidates: dict[str, Candidate]
    profiles: list[Profile]
    shifts: Shifts | None = None

    @property
    def log_factors(self) -> dict[str, float]:
        """Log Bayes factor of each id against nothing under the same error model."""
        return self.factors(lambda one: one.log_bayes_factor)

    def factors(self, of_mechanism: Callable[[Candidate], float]) -> dict[str, float]:
        """The same by another log Bayes factor of the mechanisms."""
        found = {name: of_mechanism(one) for name, one in self.candidates.items()}
        return found | ({UNLISTED: log_evidence_of(self.profiles)} if self.profiles else {}) | {NOTHING: 0.0}

    @property
    def errors(self) -> dict[str, float | None]:
        """Standard error of each id's log Bayes factor, in nats; None where it was not sampled."""
        found = {name: one.error for name, one in self.candidates.items()}
        return found | ({UNLISTED: most_probable(self.profiles).error} if self.profiles else {})

    @property
    def of_places(self) -> float:
        """What stated errors of sensors' places change in the log evidence of nothing, in nats."""
        return 0.0 if self.shifts is None else self.shifts.log_factor


@dataclass(frozen=True, eq=False)
class Comparison:
    """The comparisons under each error model, and what they say together.

    Attributes
    ----------
    odds : mapping
        Prior probability of each id.
    base_evidence : mapping
        Log evidence of the base law under each error model.
    """

    under_each: tuple[ComparisonUnderErrors, ...]
    odds: dict[str, float]
    base_evidence: dict[str, float]

    @property
    def log_factors(self) -> dict[str, float]:
        """Log Bayes factor of each id against nothing, over the error models."""
        return self._factors(lambda one: one.log_bayes_factor)

    @property
    def by_itself(self) -> dict[str, float]:
        """The same without forces beside mechanisms."""
        return self._factors(lambda one: one.by_itself)

    def _factors(self, of_mechanism: Callable[[Candidate], float]) -> dict[str, float]:
        parts: dict[str, list[float]] = {}
        for under_errors in self.under_each:
            for name, factor in under_errors.factors(of_mechanism).items():
                parts.setdefault(name, []).append(self._height(under_errors.error_model) + factor)
        nothing = float(np.logaddexp.reduce(parts[NOTHING]))
        return {name: float(np.logaddexp.reduce(values)) - nothing for name, values in parts.items()}

    @property
    def probability(self) -> dict[str, float]:
        """Probability of each id, as it is stated."""
        return stated(self.log_factors, self.odds)

    @property
    def log_odds(self) -> float:
        """Of anything against nothing, by one thing alone and in common: as those of clean campaigns are."""
        return log_odds(self._factors(lambda one: one.alone), self.odds)

    def leading(self, name: str) -> ComparisonUnderErrors:
        """The comparison under the error model that an id has most of its evidence under."""
        having = [one for one in self.under_each if name in one.log_factors]
        return max(having, key=lambda one: self._height(one.error_model) + one.log_factors[name])

    def _height(self, error_model: str) -> float:
        """Log of an error model's prior probability and of the base law's evidence under it."""
        return math.log(ERROR_SHARES[error_model]) + self.base_evidence[error_model]


def compare(
    base: Base, progress: Progress = lambda done, of: None, tell: Tell = lambda line: None
) -> Comparison:
    """Run the comparison from a fitted base law.

    Parameters
    ----------
    base : Base
        Under any error model.
    progress : callable
        Is told how many candidates are screened, and of how many, under each error model.
    tell : callable
        Is told in a line what is computed then.
    """
    fitted = side_by_side(lambda name: with_errors(base, name), list(ERROR_SHARES))
    bases = dict(zip(ERROR_SHARES, fitted, strict=True))
    heights = {name: one.fit.found.log_evidence for name, one in bases.items()}
    height = {name: math.log(ERROR_SHARES[name]) + heights[name] for name in bases}
    preferred = max(height, key=lambda name: height[name])
    ahead = height[preferred] - height[DEFAULT_ERRORS]
    if ahead <= DECIDES_NOTHING:
        preferred = DEFAULT_ERRORS
    with worker_pool() as pool:
        curves = {preferred: screened(bases[preferred], pool, progress)}
        if preferred != DEFAULT_ERRORS:
            before = curves[preferred] if ahead <= COUNTS else worth_comparing(curves[preferred], ahead)
            if before:
                curves[DEFAULT_ERRORS] = screened(bases[DEFAULT_ERRORS], pool, progress, before)
        under = _under_each({name: bases[name] for name in curves}, curves, height, pool, tell)
    # The evidence of an error model that is left out counts for nothing and everything alike.
    listed = [candidate.mechanism for candidate in under[preferred].candidates.values()]
    evidence = {name: heights[name] + one.of_places for name, one in under.items()}
    return Comparison(tuple(under[name] for name in curves), prior_odds(listed), evidence)


def with_errors(base: Base, error_model: str) -> Base:
    """The base law refitted under an error model, with quadrature points around its own fit."""
    if base.problem.error_model.id != error_model:
        base = replace(base, problem=replace(base.problem, error_model=ERROR_MODELS[error_model]))
    extension = base.extended()
    rows = campaign_rows(extension)
    rounds = Rounds(FINE, USUAL, 3)
    fit = refit(extension, rows, base.strengths[None, :], base.fit.start, rounds)[0]
    points = _better_modes(EventLikelihood(extension, rows, base.strengths), *fit.start)
    if not np.array_equal(points, fit.points):
        fit = refit(extension, rows, base.strengths[None, :], (fit.population, points), rounds)[0]
    return replace(base, rows=rows, fit=fit)


def _better_modes(likelihood: EventLikelihood, population: Population, points: FloatArray) -> FloatArray:
    """Each event's mode, or a higher one that a climb from the node with most of its integral leads to.

    Where a gate stands just above the stops, a front that stops a little too early is at a mode of its own,
    and no step away from it gains anything; points spread over the whole population lie beyond.

    Parameters
    ----------
    points : (n_rows, n_base + 1) array
        Where climbs ended.

    Returns
    -------
    (n_rows, n_base + 1) array
        The same points but for rows with a higher mode.
    """
    modes = event_modes(likelihood, points, population)
    spread = event_nodes(likelihood, population, modes, FINE)
    best = spread.log_shares(population, likelihood.rows).argmax(axis=1)
    start = spread.points[np.arange(len(best)), best]
    again = event_modes(likelihood, start, population).points
    heights = [log_joint(likelihood, one, population) for one in (points, again)]
    return np.where((heights[1] > heights[0] + DECIDES_NOTHING)[:, None], again, points)


def _under_each(
    bases: Mapping[str, Base],
    curves: Mapping[str, list[Curve]],
    height: Mapping[str, float],
    pool: ThreadPoolExecutor,
    tell: Tell,
) -> dict[str, ComparisonUnderErrors]:
    """The comparison under each error model, first under that of the highest candidate.

    Without an effect that is there readings look like outliers: an error model that the base law prefers by
    far can be far behind with the effect in. One that cannot count with what leads in stays as it was
    screened.

    Parameters
    ----------
    curves : mapping
        Screened under each error model.
    height : mapping
        Log of each one's prior probability and of the base law's evidence under it.
    """
    top = {name: height[name] + _most(curves[name]) for name in curves}
    first = max(top, key=lambda name: top[name])
    found = {first: _under_errors(first, bases[first], curves[first], pool, tell)}
    leads = max(found[first].candidates.values(), key=lambda one: one.log_bayes_factor).best
    reached = height[first] + max(found[first].log_factors.values())
    if found[first].of_places:  # of exact places, which what is compared first has, that says nothing
        reached = -math.inf
    for name in curves.keys() - found.keys():
        there = curve_near(bases[name], leads, leads.shape)  # places were screened coarsely
        behind = height[first] + _most([leads]) - max(top[name], height[name] + _most([there]))
        if behind > COUNTS:
            candidates = candidates_of(kinds_of(bases[name].setting, curves[name]))
            # Stated places change nothing there: beside candidates that are only screened they are not known.
            found[name] = ComparisonUnderErrors(name, bases[name], candidates, [])
        else:
            least = reached - height[name]
            found[name] = _under_errors(name, bases[name], curves[name], pool, tell, least)
    return found


def _most(curves: Sequence[Curve]) -> float:
    """The highest log Bayes factor, or that of nothing."""
    return max(0.0, *(one.log_bayes_factor for one in curves))


def _under_errors(
    error_model: str,
    base: Base,
    curves: list[Curve],
    pool: ThreadPoolExecutor,
    tell: Tell,
    best: float = -math.inf,
) -> ComparisonUnderErrors:
    """The comparison under one error model, from what was screened under it.

    Parameters
    ----------
    best : float
        The most that a candidate has under another error model, in nats above nothing under this one.
    """
    for budget, sampled in ((USUAL, False), (USUAL, True), (FINE, True)):  # before every worker does it
        base.with_nothing(budget, sampled=sampled)
    tell(f"  under {error_model} errors: places of what may count")
    candidates = refine(base.setting, curves, partial(curve_near, base), pool, best)
    tell("  strengths that differ, and a force in no list")
    fitted = pool.map(partial(free_force, base, candidates=candidates), KINDS)  # and meanwhile:
    candidates = with_ways(base, candidates, pool, best)
    profiles = list(fitted)
    candidates = with_residues(base, candidates, profiles, pool, best)
    tell("  what leads once more, by more points")
    candidates, again = recomputed(base, candidates, profiles, pool, best)
    candidates, again, shifts = with_stated_places(base, candidates, again, profiles, pool)
    return ComparisonUnderErrors(error_model, base, candidates, again, shifts)


def worth_comparing(curves: Sequence[Curve], behind: float) -> list[Curve]:
    """Of what was screened the mechanisms that may count under another error model.

    Parameters
    ----------
    curves : sequence of Curve
        Screened under the most probable error model.
    behind : float
        Nats that the other one is behind it.
    """
    heights = np.array([one.log_bayes_factor for one in curves])
    may_have = heights + np.maximum(heights, 0.0) + COUNTS - behind
    best = float(heights.max(initial=0.0))
    names = {one.mechanism.id for one, most in zip(curves, may_have, strict=True) if most > best}
    return [one for one in curves if one.mechanism.id in names]


def free_force(base: Base, kind: Kind, candidates: Mapping[str, Candidate]) -> Profile:
    """The force not in the list, of one kind: from no force, and from the best listed one of that kind."""
    near = [one for candidate in candidates.values() for one in candidate.curves if alike(kind, one)]
    if not near:
        return fit_profile(base, kind)
    return fit_profile(base, kind, as_profile(base, kind, max(near, key=lambda one: one.log_bayes_factor)))
