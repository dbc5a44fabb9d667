"""Predictions of avalanches that a calibration has not seen: leave-one-event-out, before and after."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import arviz_stats as az
import numpy as np

from skred.arrays import BoolArray, FloatArray
from skred.diagnosis.augment.problem import AugmentedProblem
from skred.diagnosis.augment.reference import reference
from skred.diagnosis.augment.step import Step
from skred.diagnosis.evidence.extension import extended
from skred.diagnosis.evidence.predictive import Predicted
from skred.diagnosis.evidence.tolerance import DRAWS
from skred.diagnosis.predict.draws import LeftOut, draws_of, predictions
from skred.inference.calibrate import Calibration, posterior_of
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.inference.leave_one_out import (
    Samples,
    exact_leave_one_out,
    large_k_shown_elsewhere,
    samples_of,
)
from skred.inference.paired import sum_se

K_LIMIT = 0.7
"""Pareto k above which importance sampling is not trusted: Vehtari and others, 2024,
https://jmlr.org/papers/v25/19-556.html."""


@dataclass(frozen=True, eq=False)
class HeldOut:
    """How well a calibration predicts each event from the others.

    Attributes
    ----------
    pointwise : (n_events,) array
        Expected log predictive density of each event.
    pareto_k : (n_events,) array
        Of the importance sampling, before refits; NaN where nothing was reweighted.
    refitted : tuple of str
        Events that it was not trusted for, refitted without.
    not_converged : tuple of str
        Those of them whose refit did not converge.
    predicted : Predicted
        Of each reading, (n_events, n_sensors); NaN where there is none.
    others : tuple of LeftOut
        What the others say of each event.
    """

    pointwise: FloatArray
    pareto_k: FloatArray
    refitted: tuple[str, ...]
    not_converged: tuple[str, ...]
    predicted: Predicted
    others: tuple[LeftOut, ...] = field(default=(), repr=False)

    @classmethod
    def of(
        cls,
        pointwise: FloatArray,
        others: Sequence[LeftOut],
        seed: int,
        pareto_k: FloatArray | None = None,
        refitted: tuple[str, ...] = (),
        not_converged: tuple[str, ...] = (),
    ) -> HeldOut:
        """With the predictions that the others make."""
        predicted = predictions(others, seed).where(others[0].extension.problem.observed)
        k = np.full(len(pointwise), np.nan) if pareto_k is None else pareto_k
        return cls(pointwise, k, refitted, not_converged, predicted, tuple(others))

    @property
    def n_unreliable(self) -> int:
        """Of how many avalanches importance sampling is not trusted; none where nothing was reweighted."""
        return int(np.sum(~(self.pareto_k <= K_LIMIT))) if np.isfinite(self.pareto_k).any() else 0


def largest_k(held: Sequence[HeldOut]) -> float | None:
    """Largest Pareto k of some predictions; None where nothing was reweighted."""
    known = [k for one in held for k in one.pareto_k.tolist() if np.isfinite(k)]
    return max(known, default=None)


def held_out(calibration: Calibration, seed: int, *, exact: bool = False) -> HeldOut:
    """Leave each avalanche out in turn.

    Parameters
    ----------
    calibration : Calibration
        Of the base law, or of the augmented one.
    exact : bool
        Refit without every avalanche instead of only where importance sampling is unreliable.
    """
    problem, tree = calibration.problem, calibration.tree
    with large_k_shown_elsewhere():
        loo = az.loo(tree, var_name="recordings", pointwise=True, reff=1.0)
    pointwise, k = np.array(loo.elpd_i), np.array(loo.pareto_k)
    events = list(problem.campaign.event_ids)
    log_weights = loo.log_weights.transpose("chain", "draw", "event").values
    weights = np.exp(log_weights).reshape(-1, len(events))
    again = list(range(len(events))) if exact else [int(e) for e in np.flatnonzero(~(k <= K_LIMIT))]
    failed: tuple[str, ...] = ()
    refitted: dict[int, Samples] = {}
    if again:
        near = posterior_of(calibration)
        refits = exact_leave_one_out(calibration.model, calibration.step, events, seed, again, near)
        pointwise[again] = refits.pointwise
        samples = samples_of(calibration.model, calibration.step, refits.draws)
        failed, refitted = refits.failed, dict(zip(again, samples, strict=True))
    others = _others(calibration, weights, refitted, seed)
    return HeldOut.of(pointwise, others, seed, k, tuple(events[e] for e in again), failed)


def gained_by(step: Step, calibration: Calibration, seed: int, *, exact: bool = False) -> FloatArray | None:
    """What a mechanism that was added first gains for each avalanche left out, under its own errors.

    Parameters
    ----------
    calibration : Calibration
        Of the base law, under any error model.

    Returns
    -------
    (n_events,) array or None
        Log predictive density with it, less that of the base law; None where chains of that do not converge.
    """
    under_errors = step.comparison.leading(step.candidate.mechanism.id)
    alone = reference(calibration, under_errors.base.problem)()
    if not alone.gate.passed:
        return None
    before, after = (held_out(one, seed, exact=exact) for one in (alone, step.calibration))
    return after.pointwise - before.pointwise


def _others(
    calibration: Calibration, weights: FloatArray, refitted: Mapping[int, Samples], seed: int
) -> tuple[LeftOut, ...]:
    """What the others say of each event: draws by their weights, or of the refit where there is one."""
    problem, rng = calibration.problem, np.random.default_rng([seed, 31])
    assert isinstance(problem, HierarchicalProblem)
    extension = extended(problem, calibration.law)
    if isinstance(problem, AugmentedProblem):
        extension = problem.extension
    every = draws_of(calibration, posterior_of(calibration), rng)
    parts = []
    for event in range(problem.campaign.n_events):
        draws, share = every, weights[:, event]
        if event in refitted:
            draws = draws_of(calibration, refitted[event], rng)
            share = np.full(len(draws.means), 1.0 / len(draws.means))
        parts.append(LeftOut(extension, draws.take(rng.choice(len(share), size=DRAWS, p=share))))
    return tuple(parts)


def errors(found: HeldOut | None, problem: HierarchicalProblem, when: str) -> dict[str, float | None]:
    """Root mean square error of speeds [m/s] and runouts [m], and coverage of the 90 % intervals.

    Parameters
    ----------
    found : HeldOut or None
        None where there are no predictions: no error is a number then.
    when : {"before", "after"}
        What was added; the keys end with it.
    """
    keys = [f"{name}_{when}" for name in ("rmse_velocity", "rmse_runout", "coverage_90")]
    if found is None:
        return dict.fromkeys(keys)
    velocity, predicted = problem.readings.is_velocity, found.predicted
    difference = np.where(problem.observed, predicted.mean - problem.values, np.nan)

    def rms(columns: BoolArray) -> float | None:
        chosen = difference[:, columns]
        chosen = chosen[np.isfinite(chosen)]
        return float(np.sqrt(np.mean(chosen**2))) if chosen.size else None

    covered = predicted.covered(problem.values, problem.observed)
    known = covered[np.isfinite(covered)]
    coverage = float(known.mean()) if known.size else None
    return dict(zip(keys, (rms(velocity), rms(~velocity), coverage), strict=True))


def elpd_difference(pairs: FloatArray | None) -> dict[str, float | None]:
    """Sum over events of paired differences of log scores, and its standard error where there are several.

    Parameters
    ----------
    pairs : (n_events,) array or None
        After less before; None where nothing was added.
    """
    if pairs is None:
        return {"elpd_diff": None, "elpd_se": None}
    return {"elpd_diff": float(pairs.sum()), "elpd_se": sum_se(pairs) if len(pairs) > 1 else None}
