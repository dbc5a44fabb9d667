"""Effects of one signal-to-noise, masked and open: how often either raises the alarm.

``python benchmarks/masked_open.py weak [--n 120] [--workers 2]`` draws n pairs of campaigns, one with a
masked effect (the calibrated law is right on average at every sensor) and one with an open one of a listed
mechanism, both sparse or both dense and asked to be of one signal-to-noise, drawn evenly from 2 to 5.5, where
batches of concealed trials have few; ``strong`` draws it from 5.5 to 12. Each goes through a diagnosis up to
its alarm. Shares go by the signal-to-noise that came out, measured as it is defined: over readings with
errors, the population refitted with hardly any prior (`skred.trials.detectability.over_noise`). What the
simulator sets it by, exact readings and a prior worth two events, is twice as much for some masked effects on
sparse recordings, and right to a tenth for open ones. Kept trial by trial in ``results/masked_open.json``;
the same command goes on with a run that was ended. Nothing was tuned on them.
"""

from __future__ import annotations

import json
import os
import tempfile
from concurrent.futures import ProcessPoolExecutor, as_completed
from itertools import pairwise, product
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Literal

import cyclopts
import numpy as np
from race_again import REPLICAS, base_and_draws

from skred.campaign import Campaign, read_campaign, write_campaign
from skred.diagnosis.decide import alarmed
from skred.diagnosis.odds import NOTHING
from skred.diagnosis.omnibus import omnibus
from skred.diagnosis.race import race
from skred.diagnosis.screen import Screen
from skred.trials.detectability import over_noise
from skred.trials.draw import Trial, draw_trial
from skred.work.output import write_json

app = cyclopts.App(help=__doc__)
RESULT = Path(__file__).resolve().parent / "results" / "masked_open.json"
SEED = 2_400_000
RANGES = {"weak": (0, 2.0, 5.5), "strong": (1000, 5.5, 12.0)}
"""First number of a range's pairs, and where its signal-to-noise is."""
EDGES = (2.0, 4.0, 5.5, 12.0)
KINDS: tuple[Literal["sparse", "dense"], ...] = ("sparse", "dense")
HIDDEN = ("masked", "listed")
READINGS = 8
"""Sets of readings over which a signal-to-noise is measured."""


def drawn(number: int, hidden: str) -> tuple[Trial, Campaign]:
    """One trial of a pair, and its campaign."""
    [(low, high)] = [(low, high) for first, low, high in RANGES.values() if number // 1000 == first // 1000]
    snr = float(np.random.default_rng([SEED, number]).uniform(low, high))
    trial = draw_trial(SEED + number, kind=KINDS[number % 2], hidden=hidden, snr=snr)
    return trial, as_read(trial)


def as_read(trial: Trial) -> Campaign:
    """A trial's campaign as a diagnosis reads it: files round what they hold."""
    with tempfile.TemporaryDirectory() as scratch:
        write_campaign(trial.campaign, Path(scratch) / "campaign")
        return read_campaign(Path(scratch) / "campaign")


def look(number: int, hidden: str) -> dict[str, Any]:
    """What was hidden, and what the alarm says."""
    trial, campaign = drawn(number, hidden)
    told = {"hidden": hidden, "kind": KINDS[number % 2], "base": trial.truth["base_model"]}
    told["ids"] = [one["id"] for one in trial.truth["mechanisms"]]
    return told | alarm_of(campaign, trial.truth["base_model"]) | measured(trial, number)


def measured(trial: Trial, number: int) -> dict[str, float]:
    """Its signal-to-noise, and what the simulator set it by."""
    truth, rng = trial.source.truth, np.random.default_rng([SEED, number, 1])
    try:
        gained = over_noise(truth.scene.setting, truth.theta, truth.hidden, rng, READINGS)
    except np.linalg.LinAlgError:
        return {"snr": trial.truth["snr"], "snr_exact": trial.truth["snr"]}
    return {"snr": float(np.sqrt(max(gained.mean(), 0.0))), "snr_exact": trial.truth["snr"]}


def alarm_of(campaign: Campaign, law_id: str) -> dict[str, Any]:
    """A diagnosis up to its alarm; none where a gate or the numerics fail."""
    try:
        found = base_and_draws(campaign, law_id)
        if found is None:
            return {"alarm": False, "failed": "gate"}
        base, draws = found
        screen, start = Screen(base.problem, base.law, base.setting), (base.population, base.fit.points)
        p_value = omnibus(screen, base.rows, start, draws, 0, REPLICAS).p_value
        probability = race(base).probability
    except np.linalg.LinAlgError as error:
        return {"alarm": False, "failed": repr(error)}
    return {"alarm": alarmed(probability, p_value), "p_value": p_value, "nothing": probability[NOTHING]}


def shares(found: list[dict[str, Any]], edges: tuple[float, ...]) -> str:
    """Found shares of masked and open effects, and their difference with a 95 % interval by bootstrap.

    The difference is that of effects spread evenly from the first to the last of `edges`: between each two
    of them it counts by their distance.
    """
    rng = np.random.default_rng(0)
    counts = {hidden: np.zeros(2, dtype=int) for hidden in HIDDEN}
    differences = []
    for low, high in pairwise(edges):
        drawn = []
        for hidden, count in counts.items():
            here = [one for one in found if one["hidden"] == hidden and low <= one["snr"] < high]
            alarms = np.array([one["alarm"] for one in here])
            if not len(alarms):
                return "too few"
            count += (alarms.sum(), len(alarms))
            drawn.append(np.append(alarms.mean(), rng.choice(alarms, (4000, len(alarms))).mean(axis=1)))
        differences.append((high - low) / (edges[-1] - edges[0]) * (drawn[0] - drawn[1]))
    difference = np.sum(differences, axis=0)
    low, high = np.quantile(difference[1:], (0.025, 0.975))
    told = ", ".join(f"{hidden} {count[0]} of {count[1]}" for hidden, count in counts.items())
    return f"{told}: {difference[0]:+.2f} ({low:.2f} to {high:.2f})"


def summary(found: list[dict[str, Any]]) -> dict[str, dict[str, str]]:
    """By signal-to-noise, over all and by kind of recordings."""
    kinds = {"all": found} | {kind: [one for one in found if one["kind"] == kind] for kind in KINDS}
    spans = {f"{low:g} to {high:g}": (low, high) for low, high in pairwise(EDGES)}
    spans |= {"2 to 5.5, evenly": EDGES[:3], "2 to 12, evenly": EDGES}
    return {name: {kind: shares(some, span) for kind, some in kinds.items()} for name, span in spans.items()}


def masked_by(found: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """How many masked effects were found, by what hides them on average: a covariate, or a relief."""
    rows = []
    for kind, covariate in product(KINDS, (False, True)):
        own = [one for one in found if one["hidden"] == "masked" and one["kind"] == kind]
        own = [one for one in own if (one["ids"][0] == "covariate_friction") == covariate]
        strong = [one for one in own if one["snr"] >= EDGES[2]]
        row = {"kind": kind, "by": "a covariate" if covariate else "a relief", "trials": len(own)}
        row |= {"found": sum(one["alarm"] for one in own), "strong": len(strong)}
        rows.append(row | {"strong_found": sum(one["alarm"] for one in strong)})
    return rows


def keep(found: dict[str, Any]) -> None:
    """Write all that is known."""
    trials = list(found.values())
    document = {"summary": summary(trials), "masked_by": masked_by(trials)}
    write_json(RESULT, document | {"trials": dict(sorted(found.items()))})


@app.default
def main(which: Literal["weak", "strong"], /, *, n: int = 120, workers: int = 2) -> None:
    """Look at pairs not looked at yet.

    Parameters
    ----------
    which
        Signal-to-noise from 2 to 5.5, or from 5.5 to 12.
    n
        Pairs in all.
    workers
        Processes.
    """
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    first, _, _ = RANGES[which]
    found: dict[str, Any] = (
        json.loads(RESULT.read_text(encoding="utf-8"))["trials"] if RESULT.exists() else {}
    )
    pairs = [(k, hidden) for k in range(first, first + n) for hidden in HIDDEN]
    open_ones = [(k, hidden) for k, hidden in pairs if f"{k:04d} {hidden}" not in found]
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        at_work = {pool.submit(look, *one): one for one in open_ones}
        for done in as_completed(at_work):
            number, hidden = at_work[done]
            found[f"{number:04d} {hidden}"] = done.result()
            keep(found)
            print(number, done.result(), flush=True)
    keep(found)
    for name, row in summary(list(found.values())).items():
        for kind, told in row.items():
            print(f"{name}, {kind}: {told}")


if __name__ == "__main__":
    app()
