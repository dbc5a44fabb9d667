"""Masked and open effects of one signal-to-noise: how often either raises the alarm.

``python -m studies.masked.open weak [--n 40] [--workers 2]`` draws n campaigns with a masked effect (the
calibrated law is right on average at every sensor), sparse and dense in turn, asked to be of a
signal-to-noise from 2 to 5.5, where batches of concealed trials have few; ``strong`` asks for 5.5 to 12. To
each come two campaigns of the signal-to-noise that the masked one turned out to have: one with an open effect
of any listed mechanism, and one with an open effect of the same mechanism, on a track of the same family and
with the same base law. The first says what masked effects are found less by, the second what of that is not
the kind of mechanism. Each goes through a diagnosis up to its alarm.

Signal-to-noise is measured as it is defined: over readings with errors, the population refitted with hardly
any prior (`skred.simulator.detectability.over_noise`). What the simulator sets it by, exact readings and a
prior worth two events, is kept as ``snr_exact``. Kept trial by trial in ``results/masked_open.json``; the
same command goes on with a run that was ended. Nothing was tuned on these.
"""

from __future__ import annotations

import os
import tempfile
from concurrent.futures import ProcessPoolExecutor, as_completed
from itertools import pairwise, product
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Literal

import cyclopts
import numpy as np

from benchmarks.commit import commit
from skred.campaign import Campaign, read_campaign, write_campaign
from skred.diagnosis.check.bootstrap_test import odds_test
from skred.diagnosis.check.decision import alarmed
from skred.diagnosis.compare.comparison import compare
from skred.diagnosis.evidence.prior_odds import NOTHING
from skred.simulator.detectability import over_noise
from skred.simulator.draw import Trial, draw_trial
from studies.files import RESULTS, read, write
from studies.thresholds.compared_again import base_and_draws

app = cyclopts.App(help=__doc__)
RESULT = RESULTS / "masked_open.json"
SEED = 2_900_000
RANGES = {"weak": (0, 2.0, 5.5), "strong": (1000, 5.5, 12.0)}
"""First number of a range's campaigns, and where the signal-to-noise asked for is."""
EDGES = (2.0, 4.0, 5.5, 12.0)
KINDS: tuple[Literal["sparse", "dense"], ...] = ("sparse", "dense")
OPEN = {"any": "an open effect of any listed mechanism", "same": "an open effect of the same mechanism"}
EVERYWHERE = (
    "coulomb_friction",
    "centrifugal",
    "turbulent_drag",
    "viscous_drag",
    "constant_retardation",
    "velocity_weakening",
)
"""Mechanisms without a place or a covariate to be looked for."""
READINGS = 8
"""Sets of readings over which a signal-to-noise is measured."""
SPARSE_MORE = 1.3
"""What is asked of the simulator over what is wanted, for masked effects on sparse recordings: about what it
set too much in the median of the set before."""
LEAST = 1.0
"""Least signal-to-noise that is asked for."""


def drawn(number: int) -> Trial:
    """A masked effect."""
    [(low, high)] = [(low, high) for first, low, high in RANGES.values() if number // 1000 == first // 1000]
    kind = KINDS[number % 2]
    snr = float(np.random.default_rng([SEED, number]).uniform(low, high))
    snr *= SPARSE_MORE if kind == "sparse" else 1.0
    return draw_trial(SEED + number, kind=kind, hidden="masked", snr=snr)


def drawn_beside(number: int, masked: Trial, which: str, snr: float) -> Trial:
    """An open effect of the signal-to-noise of a masked one."""
    kind, snr = KINDS[number % 2], max(snr, LEAST)
    if which == "any":
        return draw_trial(SEED + number, kind=kind, hidden="listed", snr=snr)
    truth = masked.truth
    [name] = [one["id"] for one in truth["mechanisms"]]
    base, family = truth["base_model"], truth["family"]
    return draw_trial(SEED + number, kind=kind, hidden=name, snr=snr, base=base, family=family)


def as_read(trial: Trial) -> Campaign:
    """A trial's campaign as a diagnosis reads it: files round what they hold."""
    with tempfile.TemporaryDirectory() as scratch:
        write_campaign(trial.campaign, Path(scratch) / "campaign")
        return read_campaign(Path(scratch) / "campaign")


def look(number: int) -> dict[str, Any]:
    """What the alarm says of a masked effect, and of the open ones beside it."""
    trial = drawn(number)
    found: dict[str, Any] = {"commit": commit(), "masked": looked_at(trial, number)}
    for which in OPEN:
        beside = drawn_beside(number, trial, which, found["masked"]["snr"])
        found[which] = looked_at(beside, number)
    return found


def looked_at(trial: Trial, number: int) -> dict[str, Any]:
    """What was hidden, and what the alarm says."""
    told = {"kind": KINDS[number % 2], "base": trial.truth["base_model"]}
    told["ids"] = [one["id"] for one in trial.truth["mechanisms"]]
    return told | alarm_of(as_read(trial), trial.truth["base_model"]) | measured(trial, number)


def measured(trial: Trial, number: int) -> dict[str, float]:
    """Its signal-to-noise, 0 where that cannot be measured, and what the simulator set it by."""
    truth, rng = trial.source.truth, np.random.default_rng([SEED, number, 1])
    try:
        gained = over_noise(truth.scene.setting, truth.theta, truth.hidden, rng, READINGS)
    except np.linalg.LinAlgError:
        return {"snr": 0.0, "snr_exact": trial.truth["snr"]}
    return {"snr": float(np.sqrt(max(gained.mean(), 0.0))), "snr_exact": trial.truth["snr"]}


def alarm_of(campaign: Campaign, law_id: str) -> dict[str, Any]:
    """A diagnosis up to its alarm; none where a gate or the numerics fail."""
    try:
        found = base_and_draws(campaign, law_id)
        if found is None:
            return {"alarm": False, "failed": "gate"}
        base, draws = found
        comparison = compare(base)
        log_odds, probability = comparison.log_odds, comparison.probability
        check = odds_test(base, draws, 0, log_odds)
    except np.linalg.LinAlgError as error:
        return {"alarm": False, "failed": repr(error)}
    return {
        "alarm": alarmed(probability, check.p_value),
        "p_value": check.p_value,
        "nothing": probability[NOTHING],
    }


def share_less(found: list[dict[str, Any]], which: str, edges: tuple[float, ...]) -> str:
    """Found shares of masked and open effects, and their difference with a 95 % interval by bootstrap.

    The difference is that of effects spread evenly from the first to the last of `edges`: between each two
    of them it counts by their distance.
    """
    rng = np.random.default_rng(0)
    counts = {arm: np.zeros(2, dtype=int) for arm in ("masked", which)}
    differences = []
    for low, high in pairwise(edges):
        drawn = []
        for arm, count in counts.items():
            alarms = np.array([one[arm]["alarm"] for one in found if low <= one[arm]["snr"] < high])
            if not len(alarms):
                return "too few"
            count += (alarms.sum(), len(alarms))
            drawn.append(np.append(alarms.mean(), rng.choice(alarms, (4000, len(alarms))).mean(axis=1)))
        differences.append((high - low) / (edges[-1] - edges[0]) * (drawn[0] - drawn[1]))
    difference = np.sum(differences, axis=0)
    low, high = np.quantile(difference[1:], (0.025, 0.975))
    masked, beside = (f"{count[0]} of {count[1]}" for count in counts.values())
    return f"{masked}, open {beside}: {difference[0]:+.2f} ({low:.2f} to {high:.2f})"


def summary(found: list[dict[str, Any]], which: str) -> dict[str, dict[str, str]]:
    """Against one kind of open effects: by signal-to-noise, over all and by kind of recordings."""
    kinds = {"all": found}
    kinds |= {kind: [one for one in found if one["masked"]["kind"] == kind] for kind in KINDS}
    spans: dict[str, tuple[float, ...]] = {
        f"{low:g} to {high:g}": (low, high) for low, high in pairwise(EDGES)
    }
    spans |= {"2 to 5.5, evenly": EDGES[:3], "2 to 12, evenly": EDGES}
    return {
        name: {kind: share_less(some, which, span) for kind, some in kinds.items()}
        for name, span in spans.items()
    }


def masked_by(found: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """How many masked effects were found, by what hides them on average: a covariate, or a relief."""
    rows = []
    for kind, covariate in product(KINDS, (False, True)):
        own = [one["masked"] for one in found if one["masked"]["kind"] == kind]
        own = [one for one in own if (one["ids"][0] == "covariate_friction") == covariate]
        strong = [one for one in own if one["snr"] >= EDGES[2]]
        row = {"kind": kind, "by": "a covariate" if covariate else "a relief", "trials": len(own)}
        row |= {"found": sum(one["alarm"] for one in own), "strong": len(strong)}
        rows.append(row | {"strong_found": sum(one["alarm"] for one in strong)})
    return rows


def weak_open(found: list[dict[str, Any]]) -> dict[str, list[int]]:
    """Of open effects of any mechanism below the last range: found and how many, by what is looked for."""
    weak = [one["any"] for one in found if EDGES[0] <= one["any"]["snr"] < EDGES[2]]
    counts = {}
    for name, everywhere in (("alike everywhere", True), ("a place or a covariate", False)):
        own = [one["alarm"] for one in weak if (one["ids"][0] in EVERYWHERE) == everywhere]
        counts[name] = [sum(own), len(own)]
    return counts


def over_exact(found: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Signal-to-noise as defined over what the simulator set it by: quantiles."""
    rows = []
    for kind, arm in product(KINDS, ("masked", *OPEN)):
        own = [one[arm] for one in found if one[arm]["kind"] == kind and one[arm]["snr"] > 0.0]
        ratios = [one["snr"] / one["snr_exact"] for one in own]
        if ratios:
            quantiles = np.quantile(ratios, (0.1, 0.5, 0.9)).tolist()
            rows.append({"kind": kind, "hidden": arm, "trials": len(own), "quantiles": quantiles})
    return rows


def keep(found: dict[str, Any]) -> dict[str, Any]:
    """Write all that is known."""
    trials = list(found.values())
    document: dict[str, Any] = {"summary": {which: summary(trials, which) for which in OPEN}}
    document |= {"masked_by": masked_by(trials), "weak_open": weak_open(trials)}
    document |= {"over_exact": over_exact(trials)}
    document |= {"seed": SEED, "commits": sorted({one["commit"] for one in trials})}
    write(RESULT, document | {"trials": dict(sorted(found.items()))})
    return document


@app.default
def main(which: Literal["weak", "strong"], /, *, n: int = 40, workers: int = 2) -> None:
    """Look at campaigns not looked at yet.

    Parameters
    ----------
    which
        Signal-to-noise from 2 to 5.5, or from 5.5 to 12.
    n
        Masked effects in all, each with its two open ones.
    workers
        Processes.
    """
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    first, _, _ = RANGES[which]
    before = read(RESULT) if RESULT.exists() else {}
    if before and before["seed"] != SEED:
        raise SystemExit(f"{RESULT} holds seeds from {before['seed']}, not {SEED}: put it elsewhere first")
    found: dict[str, Any] = before.get("trials", {})
    todo = [k for k in range(first, first + n) if f"{k:04d}" not in found]
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        at_work = {pool.submit(look, k): k for k in todo}
        for done in as_completed(at_work):
            found[f"{at_work[done]:04d}"] = done.result()
            keep(found)
            print(at_work[done], done.result(), flush=True)
    told = keep(found)
    for arm, rows in told["summary"].items():
        for name, row in rows.items():
            for kind, said in row.items():
                print(f"against {OPEN[arm]}, {name}, {kind}: masked {said}")


if __name__ == "__main__":
    app()
