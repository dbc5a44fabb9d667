"""The score of added strengths over all that each event may have done, not at its mode alone.

Where an event has several modes, as where its front may have stopped or gone on, an added strength moves
weight from one to another, and no mode's own score says so: it can point the other way. The score of the
evidence is the mean of the score over what is probable of each event (Fisher's identity: Louis, 1982, doi
10.1111/j.2517-6161.1982.tb01203.x); that by the population is nil where it is most probable.
"""

from __future__ import annotations

import numpy as np

from skred.arrays import FloatArray
from skred.diagnosis.evidence.conditional_map import EventLikelihood, Population, event_modes, look_around
from skred.diagnosis.evidence.event_quadrature import USUAL, event_nodes
from skred.diagnosis.evidence.refit import MOST_NODES
from skred.diagnosis.evidence.tolerance import COUNTS


def expected_score(
    likelihood: EventLikelihood, by_strengths: EventLikelihood, population: Population, points: FloatArray
) -> FloatArray:
    """Score of the log evidence by strengths, by quadrature, at the most probable population.

    What the room that is left to the population takes off the evidence counts as constant. Where fronts are
    about to stop tangents have no bound, and the mean is noisy.

    Parameters
    ----------
    likelihood : EventLikelihood
        Of one group of rows, with what is added in few directions: quick at all quadrature points.
    by_strengths : EventLikelihood
        The same fronts, with a direction for each of the strengths.
    points : (n_rows, n_base + 1) array
        The events' modes.

    Returns
    -------
    (n_directions,) array
        By all strengths of `by_strengths`.
    """
    # A point takes as much memory as there are directions.
    at_once = max(MOST_NODES // (USUAL.total * len(by_strengths.extension.directions)), 1)
    n, score = len(points), np.zeros(len(by_strengths.extension.directions))
    for part in (slice(first, first + at_once) for first in range(0, n, at_once)):
        some = likelihood.part(part)
        modes = event_modes(some, points[part], population, n_steps=6)
        spread = event_nodes(some, population, modes)
        shares = spread.log_shares(population, some.rows)
        rows, nodes = np.nonzero(shares > shares.max(axis=1, keepdims=True) - COUNTS)
        there = look_around(by_strengths.part(part).take(rows), spread.points[rows, nodes])
        score += np.einsum("r,rj,rjk->k", np.exp(shares[rows, nodes]), there.slope, there.by_strengths)
    return score
