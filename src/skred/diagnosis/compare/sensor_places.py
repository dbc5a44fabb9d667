"""Stated errors of sensors' places: a nuisance of every model, nothing included, integrated over.

A place is one unknown that all avalanches share, normal with its stated standard deviation. Along the shift
of a sensor the evidence, everything else refitted, is a curve as along the coefficient of a fault, and this
is its prior. What that changes for a candidate, with its coefficient where it is by itself, is set against
what it changes for nothing. Each sensor by itself: of several that are off together only the sum is known.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial

import numpy as np

from skred.diagnosis.compare.candidate import Candidate
from skred.diagnosis.discrepancy.profile import Profile, with_mean
from skred.diagnosis.evidence.coefficient import NEAR, Base, Curve, curve_at, curve_near
from skred.diagnosis.evidence.event_quadrature import SCREENING, USUAL
from skred.diagnosis.evidence.stated_places import stated_places
from skred.diagnosis.evidence.tolerance import COUNTS
from skred.physics.mechanisms.placed import PlacedMechanism


def with_stated_places(
    base: Base, candidates: Mapping[str, Candidate], profiles: Sequence[Profile], pool: Executor
) -> tuple[dict[str, Candidate], list[Profile], tuple[Curve, ...]]:
    """Candidates and profiles under one error model, with stated places in the evidence of what may count.

    Returns
    -------
    candidates, profiles
    places : tuple of Curve
        The shift of each sensor with a stated error, beside nothing.
    """
    found, forces, places = dict(candidates), list(profiles), along_places(base, pool)
    nothing, looked = of_places(places), set[str | int]()
    while places:
        heights: dict[str | int, float] = {name: one.log_bayes_factor for name, one in found.items()}
        heights |= {k: one.log_bayes_factor for k, one in enumerate(forces)}
        least = max(0.0, *heights.values()) - COUNTS
        todo = [key for key, height in heights.items() if height > least and key not in looked]
        if not todo:
            break
        looked.update(todo)
        for key in todo:
            if isinstance(key, str):
                changed = of_places(along_places(with_curve(base, found[key].best), pool)) - nothing
                found[key] = replace(found[key], of_places=changed)
            else:
                changed = of_places(along_places(with_mean(base, forces[key]), pool)) - nothing
                forces[key] = replace(forces[key], log_bayes_factor=forces[key].log_bayes_factor + changed)
    return found, forces, places


def along_places(base: Base, pool: Executor) -> tuple[Curve, ...]:
    """Evidence of a law along the shift of each sensor whose place has a stated error."""
    places = stated_places(base)
    if places:
        for budget in (SCREENING, USUAL):  # before every worker does it
            base.with_nothing(budget)
    return tuple(pool.map(partial(_along, base), places))


def of_places(places: Sequence[Curve]) -> float:
    """What stated places change in the log evidence of a law, in nats."""
    return sum(one.log_bayes_factor for one in places)


def with_curve(base: Base, curve: Curve) -> Base:
    """The law with a mechanism in, as strong as is most probable."""
    top = int(np.argmax(curve.log_evidence + curve.log_prior(curve.strengths, curve.scale)))
    return base.with_in(curve.direction, float(curve.strengths[top]), curve.fits[top])


def _along(base: Base, place: PlacedMechanism) -> Curve:
    """Evidence along the shift of a sensor."""
    strengths = 0.5 * place.scale * np.array(NEAR)
    return curve_near(base, curve_at(base, place, strengths, SCREENING), place.shape)
