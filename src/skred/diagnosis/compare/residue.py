"""A named effect and a residue: a listed mechanism with a force that is in no list beside it.

A force of any shape takes a second, small effect along with the first, and then wins over the mechanism that
explains nearly everything. So a mechanism is also compared together with such a force; that this is there as
well has even odds then.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial

import numpy as np

from skred.diagnosis.compare.candidate import Candidate
from skred.diagnosis.discrepancy.climb import start_from
from skred.diagnosis.discrepancy.fit import Free, fit_profile
from skred.diagnosis.discrepancy.profile import KINDS, Profile, knots, log_evidence_of
from skred.diagnosis.evidence.coefficient import Base
from skred.physics.mechanisms.spec import Group


def with_residues(
    base: Base, candidates: Mapping[str, Candidate], profiles: Sequence[Profile], pool: Executor
) -> dict[str, Candidate]:
    """Candidates, those that a force in no list has up to twice the evidence of with it beside them."""
    found, force = dict(candidates), log_evidence_of(profiles)
    physics = [one for one in candidates.values() if one.mechanism.group is Group.PHYSICS]
    looked = [one for one in physics if 0.5 * force < one.log_bayes_factor < force]
    for one, residue in zip(looked, pool.map(partial(_residue, base), looked), strict=True):
        # What a mechanism leaves is no residue if it is more than what it explains.
        if residue is not None and residue < one.log_bayes_factor:
            found[one.mechanism.id] = replace(one, residue=residue)
    return found


def _residue(base: Base, candidate: Candidate) -> float | None:
    """Log Bayes factor of a force not in the list beside a mechanism of its best shape, against it alone.

    Both are fitted together: beside such a force a mechanism is as strong as it is, and not as strong as it
    has to be for both. None where a step leads to what no front can do, as a drag far below nil.
    """
    best, added = candidate.best, candidate.mechanism.added
    assert added is not None
    top = int(np.argmax(best.log_evidence))
    wide = replace(
        base, directions=(*base.directions, best.direction), strengths=np.append(base.strengths, 0.0)
    )
    values = np.append(best.strengths[top], np.zeros(len(knots(base.setting))))
    near = values, start_from(base, best.fits[top])
    prior = Free(added.scale_of(best.shape), added.either_sign)
    try:
        both = log_evidence_of([fit_profile(wide, kind, near, free=[prior]) for kind in KINDS])
    except np.linalg.LinAlgError:
        return None
    return both - best.log_bayes_factor
