"""The force that is not in the list, fitted, with its evidence over all of its priors.

Gauss-Newton steps lead to the maximum of the posterior under one prior after the other; from there on by the
Laplace approximation.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from skred.arrays import FloatArray
from skred.diagnosis.discrepancy.climb import climb, expanded_at, highest
from skred.diagnosis.discrepancy.explored import (
    Expansion,
    ExploredPriors,
    laplace,
    occam_penalty,
    prior_penalty,
)
from skred.diagnosis.discrepancy.profile import (
    NEAR_M,
    Kind,
    Prior,
    Profile,
    knots,
    log_prior_densities,
    priors_of,
    spline_basis,
)
from skred.diagnosis.evidence.adaptive_sampling import Mode
from skred.diagnosis.evidence.coefficient import Base, Curve
from skred.diagnosis.evidence.conditional_map import Population
from skred.diagnosis.evidence.stated_places import EXACT, StatedPlaces
from skred.diagnosis.evidence.tolerance import DECIDES_NOTHING

Start = tuple[FloatArray, tuple[Population, FloatArray]]
_PRIORS_TRIED = 12
"""Priors climbed under at most, which bounds the time; climbs end before where those left hold little."""
_PRIORS_AGAIN = 4
"""The same where a fit to all avalanches is at hand: those close to its prior, and those that lead then."""


def fit_profile(
    base: Base,
    kind: Kind,
    near: Start | None = None,
    again: Prior | None = None,
    beside: Curve | None = None,
    shifts: StatedPlaces = EXACT,
    least: float = 0.0,
) -> Profile:
    """Fit the profile by Gauss-Newton steps; evidence by quadrature at the maximum.

    Steps follow the score at the events' modes; under the first prior, that of the start if it has one, they
    go on by the score of the evidence itself. One prior is tried after the other, as long as those left could
    matter. The evidence under the others follows from score and information at the maxima that were found.
    The most probable prior is kept.

    Parameters
    ----------
    near : (values, (Population, points)), optional
        A profile, population and events' points: where to begin, beside no force. Far from what was
        recorded, robust errors see outliers and no direction to go.
    again : Prior, optional
        Under which to climb first: `near` is what was found for it by all of some avalanches, of which the
        base has a part. Fewer priors are climbed under then, and from one start each.
    beside : Curve, optional
        Of the base's last direction but shifts, if its strength is to be fitted too: the first of all values,
        with its own prior. The evidence is that of both against neither then.
    shifts : StatedPlaces, optional
        Of the base's last directions, of sensors whose places have stated errors: values after that, and in
        the evidence as well.
    least : float
        Log Bayes factor below which none counts: that of no force, or more where something else leads.
        Climbs end where even the approximations of priors not climbed under have less.
    """
    at, scales = knots(base.setting), np.append([] if beside is None else [beside.widest], shifts.sd)
    n_beside = len(scales)
    # Nothing like everything else, so that what is left of integration errors is the same there.
    none = np.zeros(n_beside + len(at))
    starts = [expanded_at(base, kind, none, base.fit.start)]
    height = starts[0].fit.found.log_evidence
    if near is not None:
        starts.append(expanded_at(base, kind, *near))
    shares = priors_of(kind, at)
    covers = {prior: _with_more(scales, prior.cover(at)) for prior in shares}
    explored = ExploredPriors(height, shares, covers, least, beside)
    waiting, most = ([again], _PRIORS_AGAIN) if again else (_first(kind, starts[-1], explored), _PRIORS_TRIED)
    while waiting and len(explored.maxima) < most:
        prior = waiting.pop()
        begin, cover = [*starts, *explored.maxima.values()], covers[prior]
        found = (
            climb(base, kind, highest(begin, cover), cover) if again else _maximum(base, kind, begin, cover)
        )
        if not explored.maxima:  # once, for it costs more: climbs under the other priors may begin there
            found = climb(base, kind, found, cover, by_modes=False)
        explored.add(prior, found)
        waiting = waiting or explored.open
    prior = max(explored.maxima, key=explored.factor)
    fit, there = explored.maxima[prior].fit, explored.approximation(prior)
    values, cover, factor, modes = there.values, there.covariance, explored.log_factor, explored.modes
    if n_beside:
        modes = ()  # of all together, and so of no force by itself
    gain, values, cover = fit.found.log_evidence - height, values[n_beside:], cover[n_beside:, n_beside:]
    return Profile(kind, prior, at, values, cover, factor, gain, fit, modes)


def _with_more(scales: FloatArray, cover: FloatArray) -> FloatArray:
    """Covariance of a profile's values, and of values before them that are independent of each other."""
    n = len(scales)
    wider = np.pad(cover, ((n, 0), (n, 0)))
    wider[:n, :n] = np.diag(scales**2)
    return wider


def mode_at(base: Base, profile: Profile, values: FloatArray) -> Mode:
    """The mode near some values, under the prior that suits them best."""
    kind = profile.kind
    densities = log_prior_densities(kind, profile.knots_m, values)
    cover = max(densities, key=lambda prior: densities[prior][0]).cover(profile.knots_m)
    begin = expanded_at(base, kind, values, profile.fit.start)
    maximum = climb(base, kind, begin, cover)
    there = laplace(maximum, profile.fit.found.log_evidence, cover)
    return Mode(there.values, there.covariance)


def _first(kind: Kind, start: Expansion, explored: ExploredPriors) -> list[Prior]:
    """Under which priors to climb in any case, the last one first: the usual one, and perhaps one more.

    Where a start is more probable than no force, the prior under which it is most so.
    """
    usual = Prior(kind.amplitude, NEAR_M)
    gain = start.fit.found.log_evidence - explored.height
    covers = explored.covers.items()
    penalty = {prior: prior_penalty(start.values, np.linalg.inv(cover)) for prior, cover in covers}
    if gain <= min(penalty.values()):
        return [usual]
    occam = {prior: occam_penalty(start, cover) for prior, cover in covers}
    own = max(penalty, key=lambda prior: explored.shares[prior] - penalty[prior] - occam[prior])
    return [usual, own] if own != usual else [usual]


def _maximum(base: Base, kind: Kind, starts: Sequence[Expansion], cover: FloatArray) -> Expansion:
    """The maximum under a prior, from the start with the highest posterior and from the one that fits best.

    Sharp edges of a listed shape cost more under a smooth prior than they gain; but where recordings are far
    from what no force does, there may be no other way up.
    """
    first = highest(starts, cover)
    found = climb(base, kind, first, cover)
    best = max(starts, key=lambda one: one.fit.found.log_evidence)
    if best is first or best.fit.found.log_evidence < found.fit.found.log_evidence + DECIDES_NOTHING:
        return found
    return highest([found, climb(base, kind, best, cover)], cover)


def as_profile(base: Base, kind: Kind, near: Curve) -> Start:
    """A listed mechanism that enters like a kind, at its best strength: values at the knots, and its fit."""
    at, (strength, fit) = knots(base.setting), near.top
    profile = near.direction.profiles[near.direction.columns.index(kind.column)]
    cells = spline_basis(base.setting.terrain, at) * np.diff(base.setting.terrain.edge_s_m)
    values = strength * (cells @ profile) / np.maximum(cells.sum(axis=1), 1e-9)
    return values, fit.start
