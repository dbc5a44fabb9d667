"""A named effect and a residue: a listed mechanism with a force that is in no list beside it.

A force of any shape takes a second, small effect along with the first, and then wins over the mechanism that
explains nearly everything. So a mechanism is also compared together with such a force; that this is there as
well has even odds then.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
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
    """Candidates, with a force beside those that have more than half of what such a force has by itself.

    That is: those that have less than it has by itself, or beside another one.
    """
    found, force = dict(candidates), log_evidence_of(profiles)
    best, tried = force, set[str]()
    while looked := [
        one
        for name, one in found.items()
        if one.mechanism.group is Group.PHYSICS
        and name not in tried
        and 0.5 * force < one.log_bayes_factor < best
    ]:
        tried |= {one.mechanism.id for one in looked}
        for one in _looked_at(base, looked, pool):
            found[one.mechanism.id] = one
            best = max(best, one.log_bayes_factor)
    return found


def _looked_at(base: Base, looked: Sequence[Candidate], pool: Executor) -> Iterator[Candidate]:
    """Candidates with a force beside them, where that is less than they are."""
    jobs = [(one.best, kind) for one in looked for kind in KINDS]
    fits = pool.map(partial(fit_beside, base), *zip(*jobs, strict=True))
    for one, of_each in zip(looked, batched(fits, len(KINDS)), strict=True):
        fitted = tuple(profile for profile in of_each if profile is not None)
        if len(fitted) < len(KINDS):
            continue
        beside = Beside(with_strength(base, one.best), one.best.log_bayes_factor, fitted)
        # What a mechanism leaves is no residue if it is more than what it explains.
        if beside.log_bayes_factor < one.log_bayes_factor:
            yield replace(one, beside=beside)
