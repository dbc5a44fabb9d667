"""Answers of the baselines on simulated campaigns with hidden physics.

``python -m benchmarks.run_baselines --trials DIR [--only sindy,forward_bic] [--workers 1]``. DIR is a
development set (``DIR/trial-0001/campaign`` and ``request.json``) or a proof run
(``DIR/trials/trial-0001/...``); each answer is ``DIR/answers/<id>/trial-0001.json``, in the words of
verdict.json, written as soon as it is there, and the same command goes on with a run that was ended. A
baseline is given the campaign and the base law only.

A crash is a wrong answer.
"""

from __future__ import annotations

# Before numpy: CPU time is to be comparable.
import benchmarks.peers.single_thread  # noqa: F401

# isort: split

import json
import time
import traceback
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Annotated, Any

import cyclopts

from benchmarks.baselines import BASELINES, baseline
from skred.output import write_json


def answer_one(name: str, trial: Path, out: Path) -> dict[str, Any]:
    """One baseline's answer to one trial, from its campaign folder and its base law only."""
    from skred.campaign import read_campaign

    started, cpu = time.monotonic(), time.process_time()
    document: dict[str, Any]
    try:
        request = json.loads((trial / "request.json").read_text(encoding="utf-8"))
        asked = baseline(name)
        document = asked.answer(read_campaign(trial / "campaign"), request["base_model"]).as_dict()
    except Exception as error:  # a crash is an answer, and a wrong one
        document = {"verdict": "crash", "error": repr(error), "traceback": traceback.format_exc()}
    document |= {"wall_seconds": time.monotonic() - started, "cpu_seconds": time.process_time() - cpu}
    out.parent.mkdir(parents=True, exist_ok=True)
    write_json(out, document)
    return document


def folders_of(trials: Path) -> list[Path]:
    """The trials of a development set or of a proof run, in order."""
    inner = trials / "trials"
    found = sorted((inner if inner.is_dir() else trials).glob("trial-*"))
    return [one for one in found if (one / "request.json").is_file() and (one / "campaign").is_dir()]


def todo_of(trials: Path, names: list[str]) -> list[tuple[str, Path, Path]]:
    """What has no answer yet: baseline, trial and file of the answer."""
    jobs = []
    for name in names:
        for folder in folders_of(trials):
            out = trials / "answers" / name / f"{folder.name}.json"
            if not out.exists():
                jobs.append((name, folder, out))
    return jobs


app = cyclopts.App(help=__doc__)


@app.default
def main(
    *,
    trials: Annotated[Path, cyclopts.Parameter(help="Folder of a development set or a proof run.")],
    only: Annotated[str, cyclopts.Parameter(help="Ids of baselines, with commas; all if not given.")] = "",
    workers: Annotated[int, cyclopts.Parameter(help="Answers worked out at a time.")] = 1,
) -> None:
    """Answer what is not answered yet."""
    names = [one.strip() for one in only.split(",") if one.strip()] or list(BASELINES)
    unknown = sorted(set(names) - set(BASELINES))
    if unknown:
        raise SystemExit(f"no baseline {', '.join(unknown)}; choose from {', '.join(BASELINES)}")
    if not folders_of(trials):
        raise SystemExit(f"{trials}: expected folders trial-* with a campaign and a request.json, found none")
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        jobs = {pool.submit(answer_one, *job): job for job in todo_of(trials, names)}
        for number, job in enumerate(as_completed(jobs), 1):
            answer, (name, folder, _) = job.result(), jobs[job]
            said = f"{answer['verdict']} {answer.get('mechanism')}"
            print(f"{number}/{len(jobs)} {name} {folder.name}: {said}", flush=True)


if __name__ == "__main__":
    app()
