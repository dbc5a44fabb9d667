"""A named effect and a residue: a listed mechanism with a force that is in no list beside it.

A force of any shape takes a second, small effect along with the first, and then wins over the mechanism that
explains nearly everything. So a mechanism is also compared together with such a force: with the probability
that something beside a mechanism is in no list, it is that pair.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial

import numpy as np

from skred.diagnosis.compare.candidate import Candidate
from skred.diagnosis.discrepancy.fit import fit_profile
from skred.diagnosis.discrepancy.profile import KINDS, Profile, log_evidence_of
from skred.diagnosis.evidence.coefficient import Base, fit_base
from skred.physics.mechanisms.spec import Group


def with_residues(
    base: Base, candidates: Mapping[str, Candidate], profiles: Sequence[Profile], pool: Executor
) -> dict[str, Candidate]:
    """Candidates, where a force not in the list has more evidence the best mechanisms with it beside them."""
    found, force = dict(candidates), log_evidence_of(profiles)
    physics = [one for one in candidates.values() if one.mechanism.group is Group.PHYSICS]
    looked = [one for one in physics if 0.5 * force < one.log_bayes_factor < force]
    for one, residue in zip(looked, pool.map(partial(_residue, base), looked), strict=True):
        # What a mechanism leaves is no residue if it is more than what it explains.
        if residue < one.log_bayes_factor:
            found[one.mechanism.id] = replace(one, residue=residue)
    return found


def _residue(base: Base, candidate: Candidate) -> float:
    """Log Bayes factor of a force not in the list beside a mechanism, as strong as it is most probably."""
    best = candidate.best
    top = int(np.argmax(best.log_evidence))
    fit, strengths = best.fits[top], np.append(base.strengths, best.strengths[top])
    population = fit.found.population(len(base.law.mechanisms))
    added = fit_base(
        base.problem, base.law, population, fit.points, (*base.directions, best.direction), strengths
    )
    return log_evidence_of([fit_profile(added, kind) for kind in KINDS])
