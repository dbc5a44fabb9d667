"""A named effect and a residue: a listed mechanism with a force that is in no list beside it.

A force of any shape takes a second, small effect along with the first, and then wins over the mechanism that
explains nearly everything. So a mechanism is also compared together with such a force; that this is there as
well has even odds then.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial
from itertools import batched
from typing import NamedTuple

import numpy as np

from skred.diagnosis.compare.between import or_none
from skred.diagnosis.compare.candidate import Beside, Candidate, names_of_constants
from skred.diagnosis.discrepancy.fit import fit_profile
from skred.diagnosis.discrepancy.profile import (
    KINDS,
    Kind,
    Prior,
    Profile,
    knots,
    log_evidence_of,
    log_evidence_of_some,
)
from skred.diagnosis.evidence.coefficient import Base, Curve
from skred.diagnosis.evidence.tolerance import COUNTS
from skred.physics.mechanisms.spec import Group


class Residue(NamedTuple):
    """A force not in the list beside a mechanism, and its log Bayes factor against the mechanism alone."""

    log_factor: float
    beside: Beside


def with_residues(
    base: Base,
    candidates: Mapping[str, Candidate],
    profiles: Sequence[Profile],
    pool: Executor,
    best: float = -math.inf,
) -> dict[str, Candidate]:
    """Candidates, with a residue those that have more than half of what a force in no list has by itself.

    That is: those that have less than it has by itself, or beside another one. It is looked for beside each
    form of a mechanism's shapes: an obstacle that takes the same from all may need one less than an obstacle
    that takes a share. All are by the Laplace approximation, and so should the profiles be.

    Parameters
    ----------
    best : float
        The most that a candidate has under another error model, in nats above nothing under this one.
    """
    found, force = dict(candidates), log_evidence_of(profiles)
    counts = max([best, force, *(one.log_bayes_factor for one in candidates.values())]) - COUNTS
    highest, tried = force, set[str]()
    while looked := [
        one
        for name, one in found.items()
        if one.mechanism.group is Group.PHYSICS
        and name not in tried
        and 0.5 * force < one.log_bayes_factor < highest
    ]:
        tried |= {one.mechanism.id for one in looked}
        forms = [(one, *form) for one in looked for form in one.best_of_each(names_of_constants)]
        least = [counts - one.alone - log_share for one, _, log_share in forms]
        computed = residues(base, [curve for _, curve, _ in forms], least, pool)
        beside = defaultdict[str, list[Residue]](list)
        for (one, _, log_share), residue in zip(forms, computed, strict=True):
            # What a mechanism leaves is no residue if it is more than what it explains.
            if residue is not None and residue.log_factor < one.log_bayes_factor:
                beside[one.mechanism.id].append(residue._replace(log_factor=log_share + residue.log_factor))
        for name, parts in beside.items():
            together = float(np.logaddexp.reduce([one.log_factor for one in parts]))
            best_form = max(parts, key=lambda one: one.log_factor)
            found[name] = replace(found[name], residue=together, beside=best_form.beside)
            highest = max(highest, found[name].log_bayes_factor)
    return found


def residues(
    base: Base, curves: Sequence[Curve], least: Sequence[float], pool: Executor
) -> list[Residue | None]:
    """Forces not in the list beside mechanisms, against these alone.

    None where that is less than what counts. A kind of force that no front can do beside a mechanism, as a
    drag far below nil, counts for nothing there.

    Parameters
    ----------
    least : sequence of float
        What each must have to count: climbs end where it cannot be had, and then know less than they say.
    """
    jobs = [(curve, one, kind) for curve, one in zip(curves, least, strict=True) for kind in KINDS]
    fits = batched(pool.map(partial(or_none, fit_beside, base), *zip(*jobs, strict=True)), len(KINDS))
    found = list[Residue | None]()
    for curve, lowest, fitted in zip(curves, least, fits, strict=True):
        profiles = tuple(one for one in fitted if one is not None)
        log_factor = log_evidence_of_some(profiles) - curve.log_bayes_factor
        found.append(Residue(log_factor, Beside(curve, profiles)) if log_factor > lowest else None)
    return found


def fit_beside(base: Base, curve: Curve, least: float, kind: Kind, again: Prior | None = None) -> Profile:
    """A force of one kind beside a mechanism of a curve's shape, from where that is by itself.

    Both are fitted together: beside such a force a mechanism is as strong as it is, and not as strong as it
    has to be for both.

    Parameters
    ----------
    least : float
        What the force must have to count, in nats above the mechanism alone.
    again : Prior, optional
        Under which to climb first, as `fit_profile` does by a part of the avalanches.
    """
    strength, fit = curve.top
    directions = (*base.directions, curve.direction)
    wide = replace(base, directions=directions, strengths=np.append(base.strengths, 0.0))
    near = np.append(strength, np.zeros(len(knots(base.setting)))), fit.start
    return fit_profile(wide, kind, near, again, beside=curve, least=curve.log_bayes_factor + least)
