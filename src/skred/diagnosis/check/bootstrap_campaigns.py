"""Campaigns that a law would have given: the same releases, sensors and gaps; new fronts and errors."""

from __future__ import annotations

import numpy as np

from skred.arrays import FloatArray, IntArray
from skred.campaign import Status
from skred.diagnosis.evidence.conditional_map import Rows
from skred.diagnosis.evidence.extension import Extension
from skred.inference.error_model import EventReadings, FrontsSeen, fronts_seen
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.physics.kernel.inputs import VELOCITY_TO_STOP


def bootstrap_campaigns(
    extension: Extension,
    strengths: FloatArray,
    means: FloatArray,
    factors: FloatArray,
    rng: np.random.Generator,
) -> tuple[Rows, FloatArray]:
    """Simulated recordings, one campaign for each population.

    Where the real campaign has no reading by accident (`missing`) a replica has none; where its front stopped
    above a sensor or passed it, the replica's own front decides. Where only bounds are known of a
    reading, the replica's is drawn without them, and on which side it falls is what is known of it.

    Parameters
    ----------
    strengths : (n_directions,) array
        Of what is added.
    means : (n_groups, n_base) array
    factors : (n_groups, n_base, n_base) array
        Cholesky factors of the populations' covariances.

    Returns
    -------
    rows : Rows
    points : (n_rows, n_base + 1) array
        The true ones.
    """
    problem = extension.problem
    n_groups, n_events = len(means), problem.campaign.n_events
    event, group = np.tile(np.arange(n_events), n_groups), np.repeat(np.arange(n_groups), n_events)
    normal = rng.standard_normal((len(event), means.shape[1]))
    logs = means[group] + np.einsum("rij,rj->ri", factors[group], normal)
    points = np.column_stack([logs, rng.standard_normal(len(event))])
    predictions = extension.predict(event, points, strengths)
    readings = _read(problem, event, predictions, rng)
    return Rows(event, group, readings, problem.error_model.errors), points


def _read(
    problem: HierarchicalProblem,
    event: IntArray,
    predictions: FloatArray,
    rng: np.random.Generator,
) -> EventReadings:
    """Readings of the fronts, with errors."""
    readings = problem.readings
    n = len(event)
    status = np.asarray(problem.campaign.status)[event]
    bounded = readings.bounded[event]
    recorded = (status != Status.MISSING) & ~bounded
    velocity = readings.is_velocity
    stop = predictions[:, -1]
    seen_stop = stop + readings.place_sd * rng.standard_normal(n)
    sensors = problem.sensors[:-1]
    seen = fronts_seen(problem.campaign)
    # An instrument that reads fronts up to where they stop within its span does so in a replica as well.
    to = np.where(seen.came, seen.come_to, np.where(velocity, seen.ends, -np.inf))[event]
    spans = sensors[:, 0] == VELOCITY_TO_STOP
    passed = seen_stop[:, None] > to
    passed &= np.where(spans[None, :] | ~velocity[None, :], True, predictions[:, :-1] > 0.0)
    observed = recorded & passed
    prediction = predictions[:, :-1]
    drawn = problem.error_model.draw(prediction, readings.sd(event, prediction), velocity, rng)
    values = np.where(observed, drawn, 0.0)
    least, most = _sides(np.where(passed, drawn, 0.0), readings.least[event], readings.most[event])
    replica = FrontsSeen(
        came=velocity & ((values > 0.0) | (least > 0.0)),
        stayed=recorded & velocity & ~passed,
        halted=observed & velocity & (values == 0.0),
        stops=np.where(observed, values, most)[:, ~velocity].min(axis=1, initial=np.inf),
        begins=seen.begins,
        ends=seen.ends,
    )
    reached, not_reached = replica.between()
    return readings._replace(
        values=values,
        observed=observed,
        stated_sd=np.where(observed | bounded, readings.stated_sd[event], 0.0),
        least=least,
        most=most,
        reached=reached,
        not_reached=not_reached,
    )


def _sides(drawn: FloatArray, least: FloatArray, most: FloatArray) -> tuple[FloatArray, FloatArray]:
    """On which side of what bounds readings lie: their own bounds, minus and plus infinity where none."""
    # Of one bound there are two sides, of two there are three.
    first = np.where(np.isfinite(least), least, most)
    last = np.where(np.isfinite(most), most, least)
    known = np.isfinite(first)
    new_least = np.where(drawn >= last, last, np.where(drawn >= first, first, -np.inf))
    new_most = np.where(drawn < first, first, np.where(drawn < last, last, np.inf))
    return np.where(known, new_least, -np.inf), np.where(known, new_most, np.inf)
