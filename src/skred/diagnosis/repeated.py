"""Diagnoses judged on avalanches that they have not seen: locked ones opened once, and an outer fold.

The gain that selected a model must not be the gain that is reported. So avalanches are set aside before
anything is looked at; and in an outer fold the whole diagnosis is repeated without each part of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from skred.arrays import FloatArray
from skred.campaign import Campaign
from skred.campaign.parts import of_events, without_silent_sensors
from skred.diagnosis.clock import Tell
from skred.diagnosis.detect.too_little import too_little
from skred.diagnosis.outcome import Diagnosis, NotDiagnosed, Outcome
from skred.diagnosis.predict.held_out import elpd_difference, errors
from skred.diagnosis.predict.unseen import log_scores, problem_of, unseen
from skred.diagnosis.verdict.predictors import predictors_of
from skred.errors import InputError
from skred.inference.hierarchical.problem import HierarchicalProblem


def set_aside(problem: HierarchicalProblem, n: int, seed: int) -> tuple[HierarchicalProblem, Campaign]:
    """Lock avalanches away, drawn at random among those with a reading.

    Returns
    -------
    problem : HierarchicalProblem
        Of all other avalanches.
    locked : Campaign

    Raises
    ------
    InputError
        If the others would be too few for a diagnosis.
    """
    campaign, recorded = problem.campaign, np.flatnonzero(problem.observed.any(axis=1))
    if n >= len(recorded):
        raise InputError(f"--lock {n}: only {len(recorded)} avalanches have a reading; lock fewer")
    rng = np.random.default_rng([seed, 61])
    chosen = np.sort(rng.choice(recorded, size=n, replace=False))
    others = _without(problem, chosen.tolist(), f"--lock {n}")
    return others, of_events(campaign, chosen.tolist())


def open_locked(found: Outcome, locked: Campaign, seed: int) -> dict[str, Any]:
    """What locked avalanches make of a diagnosis; null where nothing was added, or calibrated at all."""
    document: dict[str, Any] = {"events": list(locked.event_ids)}
    base, augmented = (None, None) if isinstance(found, NotDiagnosed) else predictors_of(found)
    before, after = (None if one is None else unseen(one, locked, seed) for one in (base, augmented))
    problem = found.problem if base is None else problem_of(base, locked)
    for when, one in (("before", before), ("after", after)):
        document[f"log_score_{when}"] = None if one is None else one.pointwise.tolist()
        document |= errors(one, problem, when)
    pairs = None if before is None or after is None else after.pointwise - before.pointwise
    return document | elpd_difference(pairs)


def folds_of(problem: HierarchicalProblem, k: int, seed: int) -> list[list[int]]:
    """Numbers of the avalanches of each fold, dealt out at random.

    Raises
    ------
    InputError
        If there are fewer avalanches than folds, or too few for a diagnosis without one of the folds.
    """
    n = problem.campaign.n_events
    if k > n:
        raise InputError(f"--outer-folds {k}: there are only {n} avalanches; use fewer folds")
    dealt = np.random.default_rng([seed, 63]).permutation(n)
    folds = [np.sort(part).tolist() for part in np.array_split(dealt, k)]
    for fold in folds:
        _without(problem, fold, f"--outer-folds {k}")
    return folds


def outer_folds(
    problem: HierarchicalProblem,
    k: int,
    seed: int,
    diagnose: Callable[[HierarchicalProblem], Outcome],
    tell: Tell = lambda line: None,
) -> dict[str, Any]:
    """Repeat the whole diagnosis without each fold, and score the fold before and after what it added.

    Where it adds nothing, after is before.

    Parameters
    ----------
    k : int
        Number of folds.
    seed : int
        Of how avalanches are dealt out, and of the scores.
    diagnose : callable
        Takes the problem of the other avalanches.
    """
    folds = folds_of(problem, k, seed)
    entries, pairs = list[dict[str, Any]](), list[FloatArray]()
    for number, fold in enumerate(folds):
        tell(f"outer fold {number + 1} of {k}: the diagnosis without {len(fold)} avalanches")
        others = _without(problem, fold, f"--outer-folds {k}")
        entry, difference = _fold(diagnose(others), of_events(problem.campaign, fold), seed)
        entries.append(entry)
        pairs.append(difference)
    return {"k": k, "folds": entries, **elpd_difference(np.concatenate(pairs))}


def _fold(found: Outcome, left_out: Campaign, seed: int) -> tuple[dict[str, Any], FloatArray]:
    """One fold, and the differences of its avalanches; without any where nothing was calibrated."""
    first = second = np.empty(0)
    if not isinstance(found, NotDiagnosed) or found.calibration is not None:
        before, after = predictors_of(found)
        first = second = log_scores(before, left_out, seed)
        if after is not None:
            second = log_scores(after, left_out, seed)
    difference = second - first
    names = list(found.added) if isinstance(found, Diagnosis) else []
    entry = {
        "events": list(left_out.event_ids),
        "verdict": found.decision.verdict,
        "mechanism": names[0] if names else None,
        "mechanisms": names,
        "reason": found.reason or None,
        "log_score_before": first.tolist(),
        "log_score_after": second.tolist(),
        "elpd_diff": float(difference.sum()),
    }
    return entry, difference


def _without(problem: HierarchicalProblem, rows: Sequence[int], option: str) -> HierarchicalProblem:
    """The problem without some avalanches, and without sensors that only those passed."""
    campaign = problem.campaign
    others = [k for k in range(campaign.n_events) if k not in set(rows)]
    rest = replace(problem, campaign=without_silent_sensors(of_events(campaign, others)))
    reason = too_little(rest)
    if reason:
        raise InputError(f"{option}: too little is left to diagnose ({reason}); set fewer avalanches aside")
    return rest
