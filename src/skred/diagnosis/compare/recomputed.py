"""Re-computed evidence of what leads a comparison: with many more quadrature points, and by sampling."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np

from skred.diagnosis.compare.candidate import Candidate
from skred.diagnosis.discrepancy.profile import KINDS, Profile, log_evidence_of
from skred.diagnosis.discrepancy.sampled_evidence import sampled
from skred.diagnosis.evidence.coefficient import Base, Curve, curve_at
from skred.diagnosis.evidence.event_quadrature import FINE
from skred.diagnosis.evidence.tolerance import COUNTS


def recomputed(
    base: Base,
    candidates: Mapping[str, Candidate],
    profiles: Sequence[Profile],
    pool: ThreadPoolExecutor,
    best: float = -np.inf,
) -> tuple[dict[str, Candidate], list[Profile]]:
    """All candidates under one error model, those that lead with re-computed evidence.

    A mechanism's is re-computed along its best curve, a profile's by sampling its values. What the Laplace
    approximation of such a force lacks, it lacks beside a mechanism as well.

    Parameters
    ----------
    best : float
        The most that a candidate has under another error model, in nats above nothing under this one.
    """
    height = {name: candidate.log_bayes_factor for name, candidate in candidates.items()}
    force = [one.log_bayes_factor for one in profiles]
    # Nothing is one of those compared: what it is told from by a few nats is known as well as it is.
    least = max(best, 0.0, *height.values(), *force) - COUNTS
    leading = [name for name in height if height[name] > least]
    beside = any(candidates[name].residue is not None for name in leading)
    # A force takes longer than all mechanisms; one less probable than nothing raises no alarm with some more.
    some = max(force) - COUNTS if beside else max(least, 0.0)
    worth = [k for k, factor in enumerate(force) if factor > some]
    # Each waits for jobs of the pool, and takes none of its threads for that.
    with ThreadPoolExecutor(len(KINDS)) as waiting:
        sampled_of = {k: waiting.submit(sampled, base, profiles[k], pool, some) for k in worth}
        todo = [candidates[name] for name in leading if candidates[name].error is None]
        finer = pool.map(partial(computed_again, base), [one.best for one in todo])
        found = dict(candidates)
        for one, (fine, error) in zip(todo, finer, strict=True):
            changed = fine.log_bayes_factor - one.best.log_bayes_factor
            found[one.mechanism.id] = replace(one, correction=changed, error=error)
        again = [sampled_of[k].result() if k in worth else one for k, one in enumerate(profiles)]
    lacked = log_evidence_of(again) - log_evidence_of(profiles) if worth else 0.0
    for name, one in found.items():
        if one.residue is not None:
            found[name] = replace(one, residue=one.residue + lacked)
    return found, again


def computed_again(base: Base, curve: Curve) -> tuple[Curve, float]:
    """A curve by many more quadrature points and importance sampling, with its log Bayes factor's error.

    The standard error is that at the curve's maximum and that of nothing.
    """
    strengths = curve.strengths[curve.strengths != 0.0]
    fine = curve_at(base, curve, strengths, FINE, curve.known, sampled=True)
    most, nothing = int(np.argmax(fine.log_evidence)), int(np.searchsorted(fine.strengths, 0.0))
    return fine, math.hypot(*(fine.fits[k].found.error for k in {most, nothing}))
