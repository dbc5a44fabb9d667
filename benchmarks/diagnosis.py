"""Diagnoses of simulated campaigns with hidden physics, scored against the truth.

``python -m benchmarks.development_set --n 40 --seed 1000 --out DIR`` makes the campaigns;
``python -m benchmarks.diagnosis --trials DIR [--workers 2] [--json FILE]`` diagnoses them, each in a process
that is told nothing but the campaign and the base law, and scores what came out with the scores of
`skred prove`; FILE holds the whole scorecard. Each verdict is written as soon as it is there, and the same
command goes on with a run that was ended.
"""

from __future__ import annotations

import json
import time
import traceback
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Annotated, Any

import cyclopts

from benchmarks.files import write
from skred.output import write_json
from skred.prove.scorecard import DIAGNOSIS, scorecard


def diagnose_one(trial: Path, out: Path) -> dict[str, Any]:
    """Verdict of one trial, from its campaign folder and its base law only, by a user's settings."""
    from skred.prove.plan import diagnosis_settings
    from skred.prove.task import diagnose_campaign

    started, cpu = time.monotonic(), time.process_time()
    request = json.loads((trial / "request.json").read_text(encoding="utf-8"))
    try:
        document = diagnose_campaign(trial / "campaign", request["base_model"], diagnosis_settings(False))
    except Exception as error:  # a crash is an answer, and a wrong one
        document = {"verdict": "crash", "error": repr(error), "traceback": traceback.format_exc()}
    document |= {"wall_seconds": time.monotonic() - started, "cpu_seconds": time.process_time() - cpu}
    write_json(out, document)
    return document


def summary(trials: Path) -> dict[str, Any]:
    """The scorecard of all trials that have an answer."""
    answers = {
        file.stem: json.loads(file.read_text(encoding="utf-8"))
        for file in sorted((trials / "verdicts").glob("trial-*.json"))
    }
    truths = [
        {"trial": name, "truth": json.loads((trials / "truth" / f"{name}.json").read_text(encoding="utf-8"))}
        for name in answers
    ]
    return scorecard({"note": "development trials: not sealed"}, truths, {DIAGNOSIS: answers})


KEPT = ("n_trials", "counts", "ledger", "bars", "trials")
"""Parts of the scorecard that are written."""
app = cyclopts.App(help=__doc__)


@app.default
def main(
    *,
    trials: Annotated[Path, cyclopts.Parameter(help="Folder made by `benchmarks.development_set`.")],
    workers: Annotated[int, cyclopts.Parameter(help="Trials diagnosed at a time.")] = 1,
    out: Annotated[Path | None, cyclopts.Parameter(name="--json", help="File for the scores.")] = None,
) -> None:
    """Diagnose what is not diagnosed yet, and score all."""
    verdicts = trials / "verdicts"
    verdicts.mkdir(exist_ok=True)
    todo = [
        folder for folder in sorted(trials.glob("trial-*")) if not (verdicts / f"{folder.name}.json").exists()
    ]
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        jobs = {
            pool.submit(diagnose_one, folder, verdicts / f"{folder.name}.json"): folder.name
            for folder in todo
        }
        for number, job in enumerate(as_completed(jobs), 1):
            answer = job.result()
            print(
                f"{number}/{len(jobs)} {jobs[job]}: {answer['verdict']} {answer.get('mechanism')}", flush=True
            )
    found = summary(trials)
    for bar in found["bars"]:
        if bar["measured"] is not None:
            measured = f"{bar['measured']:.2f}, n = {bar['n']}"
            print(f"{bar['goal']}: {bar['what']}: {measured}: {bar['status']}")
    if out is not None:
        write(out, {key: found[key] for key in KEPT})


if __name__ == "__main__":
    app()
