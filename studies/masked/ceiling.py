"""Masked and open effects in the linear model: how much less often masked ones can be found at all.

``python -m studies.masked.ceiling [--n 16] [--workers 2]``. On n campaigns as those of `masked_open`,
sparse and dense in turn, effects are hidden in the linear model itself: candidates of the diagnosis, with
their own shapes, so that nothing is lost by templates, by curved likelihoods or by numerics, and of exactly
the signal-to-noise that was drawn. The alarm is raised by the odds of anything against nothing, which the
linear model has in closed form, with the diagnosis's prior odds (`skred.diagnosis.detect.score_test`). What
masked effects are found less often by then is the price of what has to be looked for besides: which
covariate, or where and opposed at what speed.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import pairwise
from multiprocessing import get_context
from typing import Any

import cyclopts
import numpy as np
from numpy.typing import NDArray

from benchmarks.commit import commit
from skred.diagnosis.detect.score_test import ScoreTest
from skred.diagnosis.evidence.linear_mixed_model import Scores
from skred.diagnosis.limits import LIMIT
from skred.physics.mechanisms.placed import PlacedMechanism
from skred.physics.mechanisms.spec import Group
from skred.physics.mechanisms.stretches import is_opposed
from skred.simulator.masked import MASKED
from studies.files import RESULTS, write
from studies.masked.open import EDGES, KINDS, as_read, drawn
from studies.thresholds.compared_again import base_and_draws

app = cyclopts.App(help=__doc__)
RESULT = RESULTS / "masked_ceiling.json"
FloatArray = NDArray[np.float64]
DRAWS = 100
"""Effects of each arm hidden in a campaign, their signal-to-noise evenly over the whole range."""
STRONGEST = 4.0
"""Strength of a hidden effect in scales of its mechanism, at most."""
BY_COVARIATE = "covariate_friction"
ARMS: dict[str, Callable[[PlacedMechanism], bool]] = {
    "masked": lambda one: (
        one.mechanism.id in MASKED and (one.mechanism.id == BY_COVARIATE or is_opposed(one.shape))
    ),
    "any": lambda one: one.mechanism.group is Group.PHYSICS and not is_opposed(one.shape),
    "same": lambda one: one.mechanism.id in MASKED and not is_opposed(one.shape),
}
"""Which candidates are hidden: as `masked_open` has them."""


def found_in(number: int) -> dict[str, Any] | None:
    """Alarms in one campaign, by arm; None where its gate fails."""
    trial = drawn(number)
    found = base_and_draws(as_read(trial), trial.truth["base_model"])
    if found is None:
        return None
    base, _ = found
    score_test = ScoreTest(base)
    information = score_test.scores(base.rows, base.fit.points, base.population).information[0]
    rng = np.random.default_rng(number)
    alarms = {arm: _alarms(score_test, information, allowed, rng) for arm, allowed in ARMS.items()}
    return {"kind": KINDS[number % 2], "snr": _evenly().tolist(), "alarms": alarms}


def _evenly() -> FloatArray:
    low, high = EDGES[0], EDGES[-1]
    return low + (high - low) * (np.arange(DRAWS) + 0.5) / DRAWS


def _alarms(
    score_test: ScoreTest,
    information: FloatArray,
    allowed: Callable[[PlacedMechanism], bool],
    rng: np.random.Generator,
) -> list[bool | None]:
    """Whether effects of one arm raise the alarm, by signal-to-noise; None where none can have that."""
    values, axes = np.linalg.eigh(information)
    root = axes * np.sqrt(np.maximum(values, 0.0))
    scores = rng.standard_normal((DRAWS, len(information))) @ root.T
    clean, reached = scores.copy(), np.zeros(DRAWS, dtype=bool)
    for k, snr in enumerate(_evenly()):
        direction = _one_of(score_test, information, allowed, float(snr), rng)
        if direction is None:
            continue
        reached[k] = True
        scores[k] += information[:, direction] * snr / math.sqrt(information[direction, direction])
    every = np.broadcast_to(information, (DRAWS, *information.shape))
    raw = np.broadcast_to(np.diag(information), (DRAWS, len(information)))
    log_odds, without = (_log_odds(score_test, Scores(one, every, raw)) for one in (scores, clean))
    alarm = (log_odds > np.quantile(without, 1.0 - LIMIT)).tolist()
    return [one if there else None for one, there in zip(alarm, reached, strict=True)]


def _log_odds(score_test: ScoreTest, scores: Scores) -> FloatArray:
    """Log odds that anything is missing against nothing, in the linear model, (n_groups,)."""
    terms = [
        np.logaddexp.reduce(one.log_factors + one.log_shares, axis=1) + one.log_odds
        for one in score_test.by_id(scores).values()
    ]
    return np.asarray(np.logaddexp.reduce(terms, axis=0))


def _one_of(
    score_test: ScoreTest,
    information: FloatArray,
    allowed: Callable[[PlacedMechanism], bool],
    snr: float,
    rng: np.random.Generator,
) -> int | None:
    """Direction of a candidate, of any mechanism, that a strength within reason gives the signal-to-noise."""
    by_mechanism: dict[str, list[int]] = {}
    for one, direction in zip(score_test.placed_mechanisms, score_test.order, strict=True):
        most = STRONGEST * one.scale * math.sqrt(max(information[direction, direction], 0.0))
        if allowed(one) and most > snr:
            by_mechanism.setdefault(one.mechanism.id, []).append(int(direction))
    if not by_mechanism:
        return None
    return int(rng.choice(by_mechanism[str(rng.choice(sorted(by_mechanism)))]))


def _share(alarms: Sequence[bool | None], inside: NDArray[np.bool_]) -> float:
    seen = [alarm for alarm, here in zip(alarms, inside, strict=True) if here and alarm is not None]
    return float(np.mean(seen)) if seen else math.nan


def summary(found: Sequence[dict[str, Any]]) -> dict[str, dict[str, str]]:
    """Found shares of the arms by signal-to-noise, and what masked effects are found less by."""
    rows: dict[str, dict[str, str]] = {}
    spans = [*pairwise(EDGES), (EDGES[0], EDGES[2]), (EDGES[0], EDGES[-1])]
    for low, high in spans:
        snr = np.array(found[0]["snr"])
        inside = (snr >= low) & (snr < high)
        shares = {arm: np.array([_share(one["alarms"][arm], inside) for one in found]) for arm in ARMS}
        row = {arm: f"{np.nanmean(share):.2f}" for arm, share in shares.items()}
        for arm in ("any", "same"):
            less = shares["masked"] - shares[arm]
            less = less[np.isfinite(less)]
            error = 1.96 * less.std(ddof=1) / math.sqrt(len(less))
            row[f"less than {arm}"] = (
                f"{less.mean():+.2f} ({less.mean() - error:.2f} to {less.mean() + error:.2f})"
            )
        rows[f"{low:g} to {high:g}"] = row
    return rows


@app.default
def main(*, n: int = 16, workers: int = 2) -> None:
    """Compute.

    Parameters
    ----------
    n
        Campaigns.
    workers
        Processes.
    """
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        found = [one for one in pool.map(found_in, range(n)) if one is not None]
    kinds = {"all": found} | {kind: [one for one in found if one["kind"] == kind] for kind in KINDS}
    told = {kind: summary(some) for kind, some in kinds.items()}
    write(RESULT, {"commit": commit(), "campaigns": len(found), "summary": told, "trials": found})
    for kind, rows in told.items():
        for span, row in rows.items():
            print(kind, span, row)


if __name__ == "__main__":
    app()
