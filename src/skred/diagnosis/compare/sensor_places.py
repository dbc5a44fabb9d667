"""Stated errors of sensors' places: a nuisance of every model, nothing included, integrated over.

A place is one unknown that all avalanches share, normal with its stated standard deviation. All shifts are
fitted together beside a law, everything else refitted, and integrated over by the Laplace approximation. What
that changes for a candidate, its coefficient fitted anew, is set against what it changes for nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from skred.arrays import FloatArray
from skred.diagnosis.compare.candidate import Candidate
from skred.diagnosis.discrepancy.climb import climb, expanded_at
from skred.diagnosis.discrepancy.explored import Laplace, laplace, log_above_nil
from skred.diagnosis.discrepancy.profile import Profile, with_mean
from skred.diagnosis.evidence.coefficient import Base, Curve
from skred.diagnosis.evidence.stated_places import StatedPlaces, stated_places
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
    base: Base, candidates: Mapping[str, Candidate], profiles: Sequence[Profile], pool: Executor
) -> tuple[dict[str, Candidate], list[Profile], Shifts]:
    """Candidates and profiles under one error model, with stated places in the evidence of what may count.

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
        fitted = [found[key] if isinstance(key, str) else forces[key] for key in todo]
        for key, beside in zip(todo, pool.map(partial(_beside, base), fitted), strict=True):
            changed = beside.log_factor - nothing.log_factor
            if isinstance(key, str):
                found[key] = replace(found[key], of_places=changed)
            else:
                forces[key] = replace(forces[key], log_bayes_factor=forces[key].log_bayes_factor + changed)
    return found, forces, nothing


def shifts_beside(base: Base, last: Curve | None = None) -> Shifts:
    """The shifts of sensors beside a law; none, and nothing changed, where no place has a stated error.

    Parameters
    ----------
    last : Curve, optional
        Of the law's last direction, if its coefficient is to be fitted anew with the shifts, by its prior.
    """
    places = stated_places(base.problem)
    if not places.errors:
        return Shifts(places, np.empty(0), np.empty(0), 0.0)
    there, within = _integrated(base, places, last)
    if last is None:
        exact = expanded_at(base, places, np.zeros(len(places.sd)), base.fit.start).fit.found.log_evidence
    else:
        _, exact = _integrated(base, StatedPlaces(()), last)
    own = slice(len(there.values) - len(places.sd), None)
    return Shifts(places, there.values[own], np.sqrt(np.diag(there.covariance)[own]), within - exact)


def _integrated(base: Base, places: StatedPlaces, last: Curve | None) -> tuple[Laplace, float]:
    """A law with shifts, perhaps with its last coefficient, integrated over; and its log evidence."""
    free = 0 if last is None else 1
    scales = places.sd if last is None else np.append(last.scale, places.sd)
    values, cover = np.zeros(len(scales)), np.diag(scales**2)
    values[:free] = base.strengths[len(base.strengths) - free :]
    there = laplace(climb(base, places, expanded_at(base, places, values, base.fit.start), cover), 0.0, cover)
    log_evidence = there.gain - there.prior_penalty - there.occam_penalty
    if last is not None and not last.added.either_sign:
        log_evidence += log_above_nil(float(there.values[0]), float(there.covariance[0, 0]))
    return there, log_evidence


def _beside(base: Base, candidate: Candidate | Profile) -> Shifts:
    """The shifts beside what was fitted: a mechanism as strong as it is with them, a force as it was."""
    if isinstance(candidate, Profile):
        return shifts_beside(with_mean(base, candidate))
    curve = candidate.best
    top = int(np.argmax(curve.log_evidence + curve.log_prior(curve.strengths, curve.scale)))
    law = base.with_in(curve.direction, float(curve.strengths[top]), curve.fits[top])
    return shifts_beside(law, curve)
