"""Stated errors of sensors' places: a nuisance of every model, nothing included, integrated over.

A place is one unknown that all avalanches share, normal with its stated standard deviation. All shifts are
fitted together beside a law, everything else refitted, and integrated over by the Laplace approximation. What
that changes for a candidate, its coefficient fitted anew, is set against what it changes for nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from skred.arrays import FloatArray
from skred.diagnosis.compare.between import or_none
from skred.diagnosis.compare.candidate import Candidate, Strength
from skred.diagnosis.compare.screening import curve as curve_of
from skred.diagnosis.discrepancy.climb import arrived, climb, expanded_at, highest
from skred.diagnosis.discrepancy.explored import Expansion, Laplace, laplace
from skred.diagnosis.discrepancy.fit import Start, fit_profile
from skred.diagnosis.discrepancy.profile import Profile, log_evidence_of_some
from skred.diagnosis.evidence.coefficient import Base, Curve
from skred.diagnosis.evidence.over_scales import moments_over_scales
from skred.diagnosis.evidence.refit import Fit
from skred.diagnosis.evidence.stated_places import EXACT, StatedPlaces, stated_places


@dataclass(frozen=True, eq=False)
class Shifts:
    """Where sensors stand beside a law, of those whose places have stated errors.

    Attributes
    ----------
    places : StatedPlaces
    mean, sd : (n,) arrays
        How much further down than noted [m].
    log_factor : float
        What the stated errors change in the log evidence of the law, in nats.
    fit : Fit
        Of the law with these shifts.
    """

    places: StatedPlaces
    mean: FloatArray
    sd: FloatArray
    log_factor: float
    fit: Fit

    def into(self, base: Base) -> Base:
        """The law with these shifts in."""
        directions = (*base.directions, *self.places.each(base.setting))
        return replace(
            base, directions=directions, strengths=np.append(base.strengths, self.mean), fit=self.fit
        )


def with_stated_places(
    base: Base,
    candidates: Mapping[str, Candidate],
    profiles: Sequence[Profile],
    by_laplace: Sequence[Profile],
    pool: Executor,
) -> tuple[dict[str, Candidate], list[Profile], Shifts]:
    """Candidates and profiles under one error model, with stated places in their evidence.

    Parameters
    ----------
    profiles : sequence of Profile
        Such as may have sampled evidence.
    by_laplace : sequence of Profile
        The same by the Laplace approximation: what it lacks, it lacks with shifts as well.

    Returns
    -------
    candidates, profiles
    shifts : Shifts
        Of the sensors beside nothing.
    """
    nothing = shifts_beside(base)
    if not nothing.places.errors:
        return dict(candidates), list(profiles), nothing
    # All of them: what is far behind with exact places may be so for a shift alone.
    fitted: list[Candidate | Profile] = [*candidates.values(), *by_laplace]
    changed = list(pool.map(partial(_changed, base, nothing), fitted))
    found = {
        name: one.with_places(*change)
        for (name, one), change in zip(candidates.items(), changed, strict=False)
    }
    forces = [
        replace(one, log_bayes_factor=one.log_bayes_factor + change.alone)
        for one, change in zip(profiles, changed[len(found) :], strict=True)
    ]
    return found, forces, nothing


def shifts_beside(base: Base) -> Shifts:
    """The shifts of sensors beside a law; none, and nothing changed, where no place has a stated error."""
    places = stated_places(base.problem)
    if not places.errors:
        return _exactly(base)
    cover, start = np.diag(places.sd**2), expanded_at(base, places, np.zeros(len(places.sd)), base.fit.start)
    found = _maximum(base, places, start, cover)
    there = laplace(found, start.fit.found.log_evidence, cover)
    sd = np.sqrt(np.diag(there.covariance))
    return Shifts(places, there.values, sd, _log_factor(there), found.fit)


def _exactly(base: Base) -> Shifts:
    """No shifts."""
    return Shifts(EXACT, np.empty(0), np.empty(0), 0.0, base.fit)


def _maximum(law: Base, places: StatedPlaces, start: Expansion, cover: FloatArray) -> Expansion:
    """The maximum of the evidence: where fronts stop near a sensor, its shift leads on beyond it."""
    return climb(law, places, climb(law, places, start, cover), cover, by_modes=False)


def _log_factor(there: Laplace) -> float:
    """Log evidence, against that of what the gain is over."""
    return there.gain - there.prior_penalty - there.occam_penalty + there.of_scales


class _Changed(NamedTuple):
    """What stated places change for what was fitted, less what they change for nothing, in nats.

    Attributes
    ----------
    beside : float or None
        For a mechanism with the force beside it, of the kinds that fronts can do; None where there is none.
    strength : Strength or None
        Of a mechanism at its best shape.
    """

    alone: float
    beside: float | None = None
    strength: Strength | None = None


def _changed(base: Base, nothing: Shifts, candidate: Candidate | Profile) -> _Changed:
    """With everything fitted anew; as if shifts gave it nothing where that breaks down."""
    try:
        return _fitted_anew(base, nothing, candidate)
    except np.linalg.LinAlgError:
        return _Changed(-nothing.log_factor)


def _fitted_anew(base: Base, nothing: Shifts, candidate: Candidate | Profile) -> _Changed:
    """What shifts change."""
    if isinstance(candidate, Profile):
        start = np.append(np.zeros(len(nothing.mean)), candidate.mean), candidate.fit.start
        return _Changed(_with_force(base, nothing, candidate, start) - candidate.log_bayes_factor)
    found, within, strength = _with_coefficient(base, candidate.best, nothing)
    _, exact, _ = _with_coefficient(base, candidate.best, _exactly(base))
    changed = _Changed(within - nothing.log_factor - exact, strength=strength)
    if candidate.beside is None:
        return changed
    curve, profiles = candidate.beside
    if curve is not candidate.best:
        found, _, _ = _with_coefficient(base, curve, nothing)
    start = np.append(found.values, np.zeros_like(profiles[0].mean)), found.fit.start
    again = [or_none(_with_force, base, nothing, one, start, curve) for one in profiles]
    both = [
        replace(one, log_bayes_factor=new)
        for one, new in zip(profiles, again, strict=True)
        if new is not None
    ]
    if not both:
        return changed
    return changed._replace(beside=log_evidence_of_some(both) - log_evidence_of_some(profiles))


def _with_coefficient(base: Base, curve: Curve, nothing: Shifts) -> tuple[Expansion, float, Strength | None]:
    """The law with shifts and a mechanism, its coefficient fitted with them; log evidence; the coefficient.

    Parameters
    ----------
    nothing : Shifts
        Beside nothing.
    """
    places, one_sided = nothing.places, not curve.added.either_sign
    strength, fit = _top(curve)
    law = base.with_in(curve.direction, strength, fit)
    cover = np.diag(np.append(curve.widest, places.sd) ** 2)
    values, moved = [(np.append(strength, np.zeros_like(nothing.mean)), fit)], curve
    if places.errors:  # where sensors stand as beside nothing, the coefficient may be another
        moved = curve_of(nothing.into(base), curve)
        strength, fit = _top(moved)
        values.append((np.append(strength, nothing.mean), fit))
    starts = [expanded_at(law, places, one, fit.start) for one, fit in values]
    ends = list(starts)
    for start in starts:  # a step can lead to what no front can do, as a drag far below nil
        with suppress(np.linalg.LinAlgError):
            ends.append(_maximum(law, places, start, cover))
    found = highest(ends, cover)
    if one_sided and found.values[0] <= 0.0:  # where no front goes
        found = expanded_at(law, places, np.append(0.0, nothing.mean), law.fit.start)
    # No score is followed to where nothing was computed: where fronts stop it can be any number.
    there = laplace(arrived(found, np.linalg.inv(cover)), 0.0, cover, curve)
    if one_sided and there.values[0] <= 0.0:  # the curve says what the expansion at nil cannot
        return found, base.fit.found.log_evidence + nothing.log_factor + moved.log_bayes_factor, None
    moments = moments_over_scales(float(there.values[0]), float(there.covariance[0, 0]), curve)
    return found, _log_factor(there), Strength(*moments)


def _top(curve: Curve) -> tuple[float, Fit]:
    """The most probable of a curve's strengths, and the fit there."""
    top = int(np.argmax(curve.log_evidence + curve.log_prior(curve.strengths)))
    return float(curve.strengths[top]), curve.fits[top]


def _with_force(
    base: Base, nothing: Shifts, force: Profile, start: Start, beside: Curve | None = None
) -> float:
    """Log Bayes factor of a force of one kind against nothing, both with shifts, by Laplace.

    Parameters
    ----------
    start : (values, (Population, points))
        Where to begin: the coefficient of a mechanism beside it if there is one, shifts, the force.
    """
    directions = [] if beside is None else [beside.direction]
    directions += nothing.places.each(base.setting)
    strengths = np.append(base.strengths, np.zeros(len(directions)))
    wide = replace(base, directions=(*base.directions, *directions), strengths=strengths)
    least = nothing.log_factor
    again = fit_profile(wide, force.kind, start, beside=beside, shifts=nothing.places, least=least)
    return again.log_bayes_factor - nothing.log_factor
