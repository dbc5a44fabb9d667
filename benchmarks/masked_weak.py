"""Weak effects, masked and open: how often either raises the alarm.

``python benchmarks/masked_weak.py [--n 100] [--workers 2]`` draws n pairs of campaigns, one with a masked
effect (the calibrated law is right on average at every sensor) and one with an open one of a listed
mechanism, both sparse or both dense and of one signal-to-noise, drawn evenly from 2 to 5.5, where batches of
concealed trials have few. Each goes through a diagnosis up to its alarm. Kept trial by trial in
``results/masked_weak.json``; the same command goes on with a run that was ended. Nothing was tuned on them.
"""

from __future__ import annotations

import json
import os
import tempfile
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Literal

import cyclopts
import numpy as np
from race_again import REPLICAS, base_and_draws

from skred.campaign import read_campaign, write_campaign
from skred.diagnosis.decide import alarmed
from skred.diagnosis.odds import NOTHING
from skred.diagnosis.omnibus import omnibus
from skred.diagnosis.race import race
from skred.diagnosis.screen import Screen
from skred.trials.draw import draw_trial
from skred.work.output import write_json

app = cyclopts.App(help=__doc__)
RESULT = Path(__file__).resolve().parent / "results" / "masked_weak.json"
SEED, SNR, WEAKER = 1_800_000, (2.0, 5.5), 4.0
KINDS: tuple[Literal["sparse", "dense"], ...] = ("sparse", "dense")
HIDDEN = ("masked", "listed")


def look(number: int, hidden: str) -> dict[str, Any]:
    """One trial of a pair: what was hidden, and what the alarm says."""
    snr = float(np.random.default_rng([SEED, number]).uniform(*SNR))
    trial = draw_trial(SEED + number, kind=KINDS[number % 2], hidden=hidden, snr=snr)
    told = {"hidden": hidden, "kind": KINDS[number % 2], "asked": snr, "snr": trial.truth["snr"]}
    told |= {"ids": [one["id"] for one in trial.truth["mechanisms"]], "base": trial.truth["base_model"]}
    with tempfile.TemporaryDirectory() as scratch:
        # As a diagnosis reads it: files round what they hold.
        write_campaign(trial.campaign, Path(scratch) / "campaign")
        campaign = read_campaign(Path(scratch) / "campaign")
    try:
        found = base_and_draws(campaign, trial.truth["base_model"])
        if found is None:
            return told | {"alarm": False, "failed": "gate"}
        base, draws = found
        screen, start = Screen(base.problem, base.law, base.setting), (base.population, base.fit.points)
        p_value = omnibus(screen, base.rows, start, draws, 0, REPLICAS).p_value
        probability = race(base).probability
    except np.linalg.LinAlgError as error:
        return told | {"alarm": False, "failed": repr(error)}
    alarm = alarmed(probability, p_value)
    return told | {"alarm": alarm, "p_value": p_value, "nothing": probability[NOTHING]}


def shares(found: list[dict[str, Any]]) -> str:
    """Found shares of masked and open effects, and their difference with a 95 % interval by bootstrap."""
    each = [np.array([one["alarm"] for one in found if one["hidden"] == hidden]) for hidden in HIDDEN]
    if min(len(one) for one in each) == 0:
        return "none"
    rng = np.random.default_rng(0)
    drawn = [rng.choice(one, (4000, len(one))).mean(axis=1) for one in each]
    low, high = np.quantile(drawn[0] - drawn[1], (0.025, 0.975))
    counts = ", ".join(
        f"{hidden} {one.sum()} of {len(one)}" for hidden, one in zip(HIDDEN, each, strict=True)
    )
    return f"{counts}: {each[0].mean() - each[1].mean():+.2f} ({low:.2f} to {high:.2f})"


def summarise(found: list[dict[str, Any]]) -> None:
    """By signal-to-noise as it was asked for, and by kind of recordings."""
    print("all:", shares(found))
    for low, high in ((SNR[0], WEAKER), (WEAKER, SNR[1])):
        print(f"{low:g} to {high:g}:", shares([one for one in found if low <= one["asked"] < high]))
    for kind in KINDS:
        print(f"{kind}:", shares([one for one in found if one["kind"] == kind]))


@app.default
def main(*, n: int = 100, workers: int = 2) -> None:
    """Look at pairs not looked at yet.

    Parameters
    ----------
    n
        Pairs in all.
    workers
        Processes.
    """
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    found: dict[str, Any] = json.loads(RESULT.read_text(encoding="utf-8")) if RESULT.exists() else {}
    open_ones = [(k, hidden) for k in range(n) for hidden in HIDDEN if f"{k:04d} {hidden}" not in found]
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        at_work = {pool.submit(look, *one): one for one in open_ones}
        for done in as_completed(at_work):
            number, hidden = at_work[done]
            found[f"{number:04d} {hidden}"] = done.result()
            write_json(RESULT, dict(sorted(found.items())))
            print(number, done.result(), flush=True)
    summarise(list(found.values()))


if __name__ == "__main__":
    app()
