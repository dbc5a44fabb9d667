"""Write trials to develop on: campaigns with concealed physics, and apart from them the truth.

``python -m benchmarks.development_set --n 40 --seed 1000 --out DIR [--kind mixed] [--hidden two] [--snr 7]``.

Trial i has the seed ``seed + i``; every other one is sparse, the rest dense, unless a kind is given. With
``--each`` they hide, in turn, each mechanism, nothing, each force that is in no list, ... (`EACH`). Folders:
``DIR/trial-0001/campaign/`` is what a diagnosis may see, ``DIR/trial-0001/request.json`` which base law it is
asked to calibrate, ``DIR/truth/trial-0001.json`` what it may not see. Trials that are there already are
skipped, so the same command goes on with a run that was ended.

These are for tuning. Seeds from 1000 to 999 999 are for development; sets whose results are reported use
seeds outside, and so other tracks, avalanches and effects.
"""

from __future__ import annotations

import json
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Annotated, Literal

import cyclopts
from rich.console import Console

from skred.campaign import write_campaign
from skred.simulator.draw import draw_trial
from skred.simulator.listed import LISTED
from skred.simulator.unlisted import UNLISTED

app = cyclopts.App(help=__doc__)
KINDS: tuple[Literal["sparse", "dense"], ...] = ("sparse", "dense")
EACH = (*LISTED, *UNLISTED, *["masked"] * 3, *["nothing", "nasty"] * 2, "two")


def write_trial(
    out: Path,
    number: int,
    seed: int,
    kind: Literal["sparse", "dense"],
    hidden: str | None,
    snr: float | None,
) -> str | None:
    """Write one trial; a line about it, or None where it is there already."""
    name = f"trial-{number:04d}"
    truth_file = out / "truth" / f"{name}.json"
    if truth_file.is_file():
        return None
    start = time.process_time()
    trial = draw_trial(seed, kind=kind, hidden=hidden, snr=snr)
    seconds = time.process_time() - start
    write_campaign(trial.campaign, out / name / "campaign", force=True)
    request = json.dumps({"base_model": trial.truth["base_model"]}) + "\n"
    (out / name / "request.json").write_text(request, encoding="utf-8")
    # The truth last, and whole or not at all: it says that the trial is complete.
    unfinished = truth_file.with_suffix(".part")
    unfinished.write_text(json.dumps(trial.truth, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    unfinished.rename(truth_file)
    ids = " + ".join(m["id"] for m in trial.truth["mechanisms"]) or trial.truth["nasty"] or "-"
    what = f"{trial.truth['base_model']} {trial.truth['hidden']}: {ids}"
    return f"{name} {kind} {what}, snr {trial.truth['snr']} of {trial.truth['snr_asked']}, {seconds:.1f} s"


@app.default
def main(
    *,
    out: Path,
    n: int | None = None,
    seed: int = 1000,
    kind: Literal["sparse", "dense", "mixed"] = "mixed",
    hidden: str | None = None,
    each: Annotated[bool, cyclopts.Parameter(negative="")] = False,
    snr: float | None = None,
    workers: int = 2,
) -> None:
    """Write trials to develop on.

    Parameters
    ----------
    out
        Folder of the set.
    n
        Number of trials; 40 by default, with --each one of each, or of each sparse and dense.
    seed
        Seed of the first.
    kind
        What is recorded: few speeds of many avalanches, many of few, or each in turn.
    hidden
        What is hidden: a class or an id, see `skred.simulator.draw`; by default drawn.
    each
        Each class and id in turn.
    snr
        Signal-to-noise; by default drawn evenly from 2 to 12.
    workers
        Trials drawn at a time.
    """
    console = Console()
    (out / "truth").mkdir(parents=True, exist_ok=True)
    kinds = KINDS if kind == "mixed" else (kind,)
    n = n or (len(EACH) * len(kinds) if each else 40)
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        jobs = [
            pool.submit(
                write_trial,
                *(out, i + 1, seed + i, kinds[i % len(kinds)]),
                EACH[i // len(kinds) % len(EACH)] if each else hidden,
                snr,
            )
            for i in range(n)
        ]
        for job in jobs:
            if line := job.result():
                console.print(line, highlight=False, soft_wrap=True)


if __name__ == "__main__":
    app()
