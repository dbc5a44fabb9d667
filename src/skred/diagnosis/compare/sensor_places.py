"""Stated errors of sensors' places: a nuisance of every model, nothing included, integrated over.

A place is one unknown that all avalanches share, normal with its stated standard deviation. All shifts are
fitted together beside a law, everything else refitted, and integrated over by the Laplace approximation. What
that changes for a candidate, its coefficient fitted anew, is set against what it changes for nothing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from skred.arrays import FloatArray
from skred.diagnosis.compare.candidate import Candidate, Strength
from skred.diagnosis.discrepancy.climb import climb, expanded_at
from skred.diagnosis.discrepancy.explored import Expansion, Laplace, laplace, log_above_nil
from skred.diagnosis.discrepancy.fit import Start, fit_profile
from skred.diagnosis.discrepancy.profile import Profile
from skred.diagnosis.evidence.coefficient import Base, Curve
from skred.diagnosis.evidence.stated_places import EXACT, StatedPlaces, stated_places
from skred.diagnosis.evidence.tolerance import COUNTS


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
    """

    places: StatedPlaces
    mean: FloatArray
    sd: FloatArray
    log_factor: float


def with_stated_places(
    base: Base,
    candidates: Mapping[str, Candidate],
    profiles: Sequence[Profile],
    by_laplace: Sequence[Profile],
    pool: Executor,
) -> tuple[dict[str, Candidate], list[Profile], Shifts]:
    """Candidates and profiles under one error model, with stated places in the evidence of what may count.

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
    found, forces, nothing = dict(candidates), list(profiles), shifts_beside(base)
    looked = set[str | int]()
    while nothing.places.errors:
        heights: dict[str | int, float] = {name: one.log_bayes_factor for name, one in found.items()}
        heights |= {k: one.log_bayes_factor for k, one in enumerate(forces)}
        least = max(0.0, *heights.values()) - COUNTS
        todo = [key for key, height in heights.items() if height > least and key not in looked]
        if not todo:
            break
        looked.update(todo)
        fitted = [found[key] if isinstance(key, str) else by_laplace[key] for key in todo]
        for key, changed in zip(todo, pool.map(partial(_changes, base, nothing), fitted), strict=True):
            if isinstance(key, str):
                found[key] = found[key].with_places(*changed)
            else:
                forces[key] = replace(
                    forces[key], log_bayes_factor=forces[key].log_bayes_factor + changed.alone
                )
    return found, forces, nothing


def shifts_beside(base: Base) -> Shifts:
    """The shifts of sensors beside a law; none, and nothing changed, where no place has a stated error."""
    places = stated_places(base.problem)
    if not places.errors:
        return Shifts(places, np.empty(0), np.empty(0), 0.0)
    cover, start = np.diag(places.sd**2), expanded_at(base, places, np.zeros(len(places.sd)), base.fit.start)
    there = laplace(_maximum(base, places, start, cover), start.fit.found.log_evidence, cover)
    return Shifts(places, there.values, np.sqrt(np.diag(there.covariance)), _log_factor(there))


def _maximum(law: Base, places: StatedPlaces, start: Expansion, cover: FloatArray) -> Expansion:
    """The maximum of the evidence: where fronts stop near a sensor, its shift leads on beyond it."""
    return climb(law, places, climb(law, places, start, cover), cover, by_modes=False)


def _log_factor(there: Laplace) -> float:
    """Log evidence, against that of what the gain is over."""
    return there.gain - there.prior_penalty - there.occam_penalty


class _Changed(NamedTuple):
    """What stated places change for what was fitted, less what they change for nothing, in nats.

    Attributes
    ----------
    beside : float or None
        For a mechanism with the force beside it; None where there is none, or where a step leads to what no
        front can do.
    strength : Strength or None
        Of a mechanism at its best shape.
    """

    alone: float
    beside: float | None = None
    strength: Strength | None = None


def _changes(base: Base, nothing: Shifts, candidate: Candidate | Profile) -> _Changed:
    """With everything fitted anew."""
    if isinstance(candidate, Profile):
        start = np.append(np.zeros(len(nothing.mean)), candidate.mean), candidate.fit.start
        return _Changed(_of_force(base, nothing, candidate, start))
    curve, beside = candidate.best, candidate.beside
    top = int(np.argmax(curve.log_evidence + curve.log_prior(curve.strengths, curve.scale)))
    law = base.with_in(curve.direction, float(curve.strengths[top]), curve.fits[top])
    found, within, strength = _with_coefficient(law, curve, nothing.places, nothing.mean)
    _, exact, _ = _with_coefficient(law, curve, EXACT, np.empty(0))
    changed = _Changed(within - nothing.log_factor - exact, strength=strength)
    if beside is None:
        return changed
    start = np.append(found.values, np.zeros(len(beside.mean))), found.fit.start
    try:
        return changed._replace(beside=_of_force(base, nothing, beside, start, curve))
    except np.linalg.LinAlgError:
        return changed


def _with_coefficient(
    law: Base, curve: Curve, places: StatedPlaces, shifts_m: FloatArray
) -> tuple[Expansion, float, Strength | None]:
    """A law with shifts, its last coefficient fitted anew with them; its log evidence; the coefficient.

    Parameters
    ----------
    curve : Curve
        Of the law's last direction.
    shifts_m : (n,) array
        The shifts beside nothing.
    """
    cover = np.diag(np.append(curve.scale, places.sd) ** 2)
    start = np.append(law.strengths[-1], np.zeros(len(places.sd)))
    found = _maximum(law, places, expanded_at(law, places, start, law.fit.start), cover)
    there = laplace(found, 0.0, cover)
    strength = Strength(float(there.values[0]), math.sqrt(float(there.covariance[0, 0])))
    if curve.added.either_sign:
        return found, _log_factor(there), strength
    if strength.mean > 0.0:
        return found, _log_factor(there) + log_above_nil(strength.mean, strength.sd**2), strength
    # Where no front goes: from nil then, by score and information there.
    found = expanded_at(law, places, np.append(0.0, shifts_m), law.fit.start)
    there = laplace(found, 0.0, cover)
    above_nil = log_above_nil(float(there.values[0]), float(there.covariance[0, 0]))
    return found, _log_factor(there) + above_nil, None


def _of_force(
    base: Base, nothing: Shifts, force: Profile, start: Start, beside: Curve | None = None
) -> float:
    """What stated places change for a force by the Laplace approximation, less what they do for nothing.

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
    return again.log_bayes_factor - force.log_bayes_factor - nothing.log_factor
