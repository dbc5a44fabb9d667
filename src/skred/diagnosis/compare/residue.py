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
from itertools import batched

from skred.diagnosis.compare.candidate import Candidate
from skred.diagnosis.discrepancy.beside import Beside, fit_beside, with_strength
from skred.diagnosis.discrepancy.profile import KINDS, Profile, log_evidence_of
from skred.diagnosis.evidence.coefficient import Base
from skred.physics.mechanisms.spec import Group


def with_residues(
    base: Base, candidates: Mapping[str, Candidate], profiles: Sequence[Profile], pool: Executor
) -> dict[str, Candidate]:
    """Candidates, those that a force in no list has up to twice the evidence of with it beside them."""
    found, force = dict(candidates), log_evidence_of(profiles)
    physics = [one for one in candidates.values() if one.mechanism.group is Group.PHYSICS]
    looked = [one for one in physics if 0.5 * force < one.log_bayes_factor < force]
    jobs = [(one.best, kind) for one in looked for kind in KINDS]
    fits = pool.map(partial(fit_beside, base), *zip(*jobs, strict=True)) if jobs else iter(())
    for one, of_each in zip(looked, batched(fits, len(KINDS)), strict=True):
        fitted = tuple(profile for profile in of_each if profile is not None)
        if len(fitted) < len(KINDS):
            continue
        beside = Beside(with_strength(base, one.best), one.best.log_bayes_factor, fitted)
        # What a mechanism leaves is no residue if it is more than what it explains.
        if beside.log_bayes_factor < one.log_bayes_factor:
            found[one.mechanism.id] = replace(one, beside=beside)
    return found
