"""Re-computed evidence of what leads a comparison: with many more quadrature points, and by sampling."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from skred.diagnosis.compare.candidate import Candidate
from skred.diagnosis.discrepancy.profile import KINDS, Profile
from skred.diagnosis.discrepancy.sampled_evidence import sampled_log_factor
from skred.diagnosis.evidence.coefficient import Base
from skred.diagnosis.evidence.conditional_map import EventLikelihood, event_modes
from skred.diagnosis.evidence.event_quadrature import FINE, event_nodes
from skred.diagnosis.evidence.extension import Extension, extended
from skred.diagnosis.evidence.marginal import evidence, importance_evidence
from skred.diagnosis.evidence.refit import Fit, Rounds, refit

FloatArray = NDArray[np.float64]
_CHECKED = 5
"""Mechanisms re-computed at most, which bounds the time."""
_DRAWS = 500
"""Populations drawn for each."""
_BEHIND = 6.0
"""Nats behind the best of all at which nothing is re-computed: it counts for a ninetieth, as stated
(`prior_odds.POWER`), and what a mechanism has changes by a nat or so."""
_COUNTS = 4.0
"""Nats behind the best at which what a force has need not be known better than its first draws tell: two nats
more there are a tenth of a nat for all together."""
_TOO_LOW = 4.0
"""Nats that a force may have more than by the Laplace approximation, where fronts stop near sensors."""


def recomputed(
    base: Base,
    candidates: Mapping[str, Candidate],
    profiles: Sequence[Profile],
    pool: ThreadPoolExecutor,
    best: float = -np.inf,
) -> tuple[dict[str, Candidate], list[Profile]]:
    """All candidates under one error model, those that lead with re-computed evidence.

    A mechanism's is re-computed at the maximum of its best curve, if that was computed with fronts: a rough
    one is wrong in its own way. A profile's is computed by sampling its values.

    Parameters
    ----------
    best : float
        The most that a candidate has under another error model, in nats above nothing under this one.
    """
    height = {name: candidate.log_bayes_factor for name, candidate in candidates.items()}
    force = [one.log_bayes_factor for one in profiles]
    most = max(best, *height.values(), *force)
    leading = sorted(
        (name for name in height if height[name] > most - _BEHIND), key=lambda name: -height[name]
    )
    leading = [name for name in leading[:_CHECKED] if not candidates[name].best.rough]
    # A force that is less probable than none would raise no alarm with some nats more.
    worth = [k for k, factor in enumerate(force) if factor > max(most - _COUNTS - _TOO_LOW, 0.0)]
    # Each waits for jobs of the pool, and takes none of its threads for that.
    with ThreadPoolExecutor(len(KINDS)) as waiting:
        sampled = {
            k: waiting.submit(sampled_log_factor, base, profiles[k], pool, max(most - _COUNTS, 0.0))
            for k in worth
        }
        found = _looked_at(base, candidates, leading, pool)
        factors = {k: one.result() for k, one in sampled.items()}
    again = [replace(one, log_bayes_factor=factors.get(k, force[k])) for k, one in enumerate(profiles)]
    return found, again


def _looked_at(
    base: Base, candidates: Mapping[str, Candidate], leading: Sequence[str], pool: ThreadPoolExecutor
) -> dict[str, Candidate]:
    """All mechanisms, those that lead with many more quadrature points at the maximum of their best curve."""
    looked = {name: pool.submit(_at_top, base, candidates[name]) for name in leading}
    plain = extended(base.problem, base.law, base.directions)
    nothing = pool.submit(_finely, base, plain, base.strengths, base.fit) if leading else None
    found = dict(candidates)
    for name, one in looked.items():
        assert nothing is not None
        (laplace, fine), without = one.result(), nothing.result()
        correction = fine - without[1] - float(candidates[name].best.log_evidence.max())
        disagreement = (fine - laplace) - (without[1] - without[0])
        found[name] = replace(candidates[name], correction=correction, disagreement=disagreement)
    return found


def _at_top(base: Base, candidate: Candidate) -> tuple[float, float]:
    """At the maximum of a mechanism's best curve."""
    best = candidate.best
    top = int(np.argmax(best.log_evidence))
    extension = extended(base.problem, base.law, (*base.directions, best.direction))
    return _finely(base, extension, np.append(base.strengths, best.strengths[top]), best.fits[top])


def _finely(base: Base, extension: Extension, strengths: FloatArray, fit: Fit) -> tuple[float, float]:
    """Log evidence with many quadrature points: by the Laplace approximation, and by importance sampling."""
    start = (fit.found.population(len(base.law.mechanisms)), fit.points)
    fits = refit(extension, base.rows, strengths[None, :], start, Rounds(FINE))
    population = fits[0].found.population(len(base.law.mechanisms))
    likelihood = EventLikelihood(extension, base.rows, strengths)
    modes = event_modes(likelihood, fits[0].points, population)
    nodes = event_nodes(likelihood, population, modes, FINE, base.population).nodes
    found = evidence(nodes, base.log_scale, fits[0].found.psi)
    sampled, _ = importance_evidence(nodes, base.log_scale, found, _DRAWS, seed=0)
    return found.log_evidence, sampled
