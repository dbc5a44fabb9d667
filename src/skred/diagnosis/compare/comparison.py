"""The race: nothing, every listed mechanism, every instrument fault and the unlisted force, refitted each.

Two error models run: the one that the base law alone prefers and, if that is another, the robust one, so that
odd events, heavy tails and correlated errors stay error models and do not become findings. Where the robust
one is so far behind that no candidate can bring it back it does not run.

Curves are computed in threads and by helpers. scipy's `logsumexp` asks there for JAX, which ArviZ loads only
when asked, and two threads that ask at once find half of it; NumPy's does not.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from skred.diagnosis.compare.candidate import Entrant
from skred.diagnosis.compare.recomputed import corrected
from skred.diagnosis.compare.refinement import second_look
from skred.diagnosis.compare.restarts import better_modes
from skred.diagnosis.compare.screening import curve, first_look
from skred.diagnosis.detect.score_test import Screen, candidates
from skred.diagnosis.discrepancy.fit import as_profile, fit_profile
from skred.diagnosis.discrepancy.profile import KINDS, Kind, Profile, alike, log_evidence_of
from skred.diagnosis.evidence.coefficient import Base, Curve, refit
from skred.diagnosis.evidence.conditional_map import campaign_rows
from skred.diagnosis.evidence.event_quadrature import FINE, USUAL, Budget
from skred.diagnosis.evidence.extension import extended
from skred.diagnosis.evidence.prior_odds import NOTHING, UNLISTED, prior_odds, stated
from skred.inference.error_model import DEFAULT_ERRORS, ERROR_MODELS
from skred.parallel.processes import crew
from skred.parallel.threads import side_by_side
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.spec import Shape

FloatArray = NDArray[np.float64]
Tell = Callable[[int, int], None]
ERROR_SHARES = {"robust": 0.55, "student": 0.15, "correlated": 0.15, "scaled": 0.15}
"""Prior probability of each error model in the race."""
_PREFERRED_BY = 1.0
_FAR_BEHIND = 10.0
"""Nats behind its mechanism's best at which a place is not looked at under another error model: it counts for
nothing."""
_OTHER_ERRORS = 5.0
"""Nats that a candidate may have more under the less probable of two error models, beside as many again as it
has under the other. Where a model is farther behind than that, mechanisms to which these are too few are not
raced under it, and count for nothing there."""


@dataclass(frozen=True, eq=False)
class Heat:
    """The race under one error model.

    Attributes
    ----------
    error_model : str
    base : Base
    entrants : mapping of str to Entrant
    profiles : list of Profile
    first_look : list of Curve
        A rough one for each candidate of the mechanisms raced; that under another error model where it
        cannot count.
    """

    error_model: str
    base: Base
    entrants: dict[str, Entrant]
    profiles: list[Profile]
    first_look: list[Curve]

    @property
    def log_factors(self) -> dict[str, float]:
        """Log Bayes factor of each id against nothing under the same error model."""
        found = {name: entrant.log_bayes_factor for name, entrant in self.entrants.items()}
        return found | {UNLISTED: log_evidence_of(self.profiles), NOTHING: 0.0}


@dataclass(frozen=True, eq=False)
class Race:
    """All heats, and what they say together.

    Attributes
    ----------
    heats : tuple of Heat
    odds : mapping
        Prior probability of each id.
    base_evidence : mapping
        Log evidence of the base law under each error model.
    """

    heats: tuple[Heat, ...]
    odds: dict[str, float]
    base_evidence: dict[str, float]

    @property
    def log_factors(self) -> dict[str, float]:
        """Log Bayes factor of each id against nothing, over the error models."""
        parts: dict[str, list[float]] = {}
        for heat in self.heats:
            prior = math.log(ERROR_SHARES[heat.error_model]) + self.base_evidence[heat.error_model]
            for name, factor in heat.log_factors.items():
                parts.setdefault(name, []).append(prior + factor)
        nothing = float(np.logaddexp.reduce(parts[NOTHING]))
        return {name: float(np.logaddexp.reduce(values)) - nothing for name, values in parts.items()}

    @property
    def probability(self) -> dict[str, float]:
        """Probability of each id, as it is stated."""
        return stated(self.log_factors, self.odds)

    @property
    def log_odds(self) -> float:
        """Of anything against nothing."""
        nothing = self.probability[NOTHING]
        return math.log(max(1.0 - nothing, 1e-300)) - math.log(max(nothing, 1e-300))

    def leading(self, name: str) -> Heat:
        """The heat in which an id has most of its evidence."""

        def height(heat: Heat) -> float:
            return (
                math.log(ERROR_SHARES[heat.error_model])
                + self.base_evidence[heat.error_model]
                + heat.log_factors[name]
            )

        return max((heat for heat in self.heats if name in heat.log_factors), key=height)


def race(base: Base, tell: Tell = lambda done, of: None) -> Race:
    """Run the race from a fitted base law.

    Parameters
    ----------
    base : Base
        Under any error model.
    tell : callable
        Told how many first looks are done, and of how many, under each error model.
    """
    fitted = side_by_side(lambda name: with_errors(base, name), list(ERROR_SHARES))
    bases = dict(zip(ERROR_SHARES, fitted, strict=True))
    heights = {name: one.fit.found.log_evidence for name, one in bases.items()}
    height = {name: math.log(ERROR_SHARES[name]) + heights[name] for name in bases}
    preferred = max(height, key=lambda name: height[name])
    chosen = [DEFAULT_ERRORS]
    if height[preferred] > height[DEFAULT_ERRORS] + _PREFERRED_BY:
        chosen.insert(0, preferred)
    heats = [_heat(chosen[0], bases[chosen[0]], tell)]
    for name in chosen[1:]:
        before, behind = heats[0].first_look, height[preferred] - height[name]
        if behind > _OTHER_ERRORS:
            before = _that_may_count(before, behind)
        if before:
            best = max(heats[0].log_factors.values()) + behind
            heats.append(_heat(name, bases[name], tell, before, best))
    # The evidence of an error model without a heat counts for nothing and everything alike.
    raced = [entrant.mechanism for entrant in heats[0].entrants.values()]
    evidence = {heat.error_model: heights[heat.error_model] for heat in heats}
    return Race(tuple(heats), prior_odds(raced), evidence)


def with_errors(base: Base, error_model: str) -> Base:
    """The base law refitted under an error model, with nodes around its own fit."""
    problem = base.problem
    if problem.error_model.id != error_model:
        problem = replace(problem, error_model=ERROR_MODELS[error_model])
    extension = extended(problem, base.law, base.directions)
    rows = campaign_rows(extension)
    start = (base.population, base.fit.points)
    fit = refit(extension, rows, base.strengths[None, :], start, base.log_scale, FINE, USUAL, 3)[0]
    population = fit.found.population(len(base.law.mechanisms))
    points = better_modes(extension, rows, fit.points, base.strengths, population)
    if not np.array_equal(points, fit.points):
        start = (population, points)
        fit = refit(extension, rows, base.strengths[None, :], start, base.log_scale, FINE, USUAL, 3)[0]
    return replace(base, problem=problem, rows=rows, fit=fit)


def _heat(
    error_model: str, base: Base, tell: Tell, before: Sequence[Curve] = (), best: float = -math.inf
) -> Heat:
    """The race under one error model.

    Parameters
    ----------
    before : sequence of Curve, optional
        First looks by another one, at the mechanisms that are raced.
    best : float, optional
        The most that a candidate has under that, in nats above nothing under this one.
    """
    budget = first_look(base)
    base.with_nothing(budget)  # before anyone else does it once more
    with crew() as pool:
        curves = _first_looks(base, budget, pool, tell, before)
        entrants = second_look(base, curves, budget, pool)
        profiles = list(pool.map(partial(free_force, base, entrants=entrants), KINDS))
        entrants, profiles = corrected(base, entrants, profiles, pool, best)
    for mechanism in mechanisms().values():
        other = entrants.get(mechanism.same_term_as)
        if other is not None and mechanism.added is not None and mechanism.added.joins(base.setting.base):
            same = tuple(replace(one, mechanism=mechanism) for one in other.curves)
            entrants[mechanism.id] = replace(other, mechanism=mechanism, curves=same)
    return Heat(error_model, base, entrants, profiles, curves)


def _first_looks(
    base: Base, budget: Budget, pool: ThreadPoolExecutor, tell: Tell, before: Sequence[Curve]
) -> list[Curve]:
    """A rough curve for each candidate; those `before`, by another error model, where they cannot count."""
    todo = [(one.mechanism, one.shape) for one in before or candidates(base.setting, ties=False)]
    curves, looked = dict(enumerate(before)), set[int]()
    linear = _linear_strengths(base)

    def look(number: int) -> Curve:
        mechanism, shape = todo[number]
        return curve(base, mechanism, shape, budget, linear.get((mechanism.id, shape)))

    while jobs := sorted(set(_that_count(curves) if curves else range(len(todo))) - looked):
        looked |= set(jobs)
        for done, (number, one) in enumerate(zip(jobs, pool.map(look, jobs), strict=True), start=1):
            curves[number] = one
            tell(len(todo) - len(jobs) + done, len(todo))
    return [curves[number] for number in range(len(todo))]


def _that_may_count(before: Sequence[Curve], behind: float) -> list[Curve]:
    """Of first looks those of mechanisms that may count by an error model so many nats behind."""
    heights = np.array([one.log_bayes_factor for one in before])
    may_have = heights + np.maximum(heights, 0.0) + _OTHER_ERRORS - behind
    best = max(float(heights.max()), 0.0)
    names = {one.mechanism.id for one, most in zip(before, may_have, strict=True) if most > best}
    return [one for one in before if one.mechanism.id in names]


def _linear_strengths(base: Base) -> dict[tuple[str, Shape], float]:
    """Roughly how strong the candidates are that stand out."""
    screen = Screen(base.problem, base.law, base.setting, base.directions, base.strengths)
    return screen.strengths_found(screen.scores(base.rows, base.fit.points, base.population))


def _that_count(curves: Mapping[int, Curve]) -> list[int]:
    """Numbers of the curves that are not far behind their mechanism's best."""
    best: dict[str, float] = {}
    for one in curves.values():
        best[one.mechanism.id] = max(one.log_bayes_factor, best.get(one.mechanism.id, -math.inf))
    return [
        number
        for number, one in curves.items()
        if one.log_bayes_factor > best[one.mechanism.id] - _FAR_BEHIND
    ]


def free_force(base: Base, kind: Kind, entrants: Mapping[str, Entrant]) -> Profile:
    """The unlisted force of one kind: from no force, and from the best listed one that enters alike."""
    near = [one for entrant in entrants.values() for one in entrant.curves if alike(kind, one)]
    if not near:
        return fit_profile(base, kind)
    return fit_profile(base, kind, as_profile(base, kind, max(near, key=lambda one: one.log_bayes_factor)))
