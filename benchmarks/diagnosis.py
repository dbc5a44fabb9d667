"""Diagnoses of simulated campaigns with hidden physics, scored against the truth.

``python benchmarks/development_set.py --n 40 --seed 1000 --out DIR`` makes the campaigns;
``python benchmarks/diagnosis.py --trials DIR [--workers 2] [--json FILE]`` diagnoses them, each in a process
that is told nothing but the campaign and the base law, and scores what came out. Each verdict is written
as soon as it is there, and the same command goes on with a run that was ended. Signal-to-noise is the
square root of twice the expected log likelihood ratio.

A crash is a wrong answer.
"""

from __future__ import annotations

import json
import time
import traceback
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Annotated, Any

import cyclopts
import numpy as np
from scipy.stats import binomtest

from skred.work.output import write_json

SAMPLES = {"draws": 1000, "tune": 1000, "chains": 4}
ALARMS = ("missing_physics", "instrument", "unexplained")
CLEAN = ("nothing", "nasty")


def diagnose_one(trial: Path, out: Path, replicas: int) -> dict[str, Any]:
    """Verdict of one trial, from its campaign folder and its base law only."""
    from skred.campaign import read_campaign
    from skred.diagnosis.diagnose import Effort, diagnose
    from skred.diagnosis.verdict import verdict
    from skred.inference.hierarchical import hierarchical_problem
    from skred.inference.sampling import SamplerSettings
    from skred.laws import load_law

    started, cpu = time.monotonic(), time.process_time()
    request = json.loads((trial / "request.json").read_text(encoding="utf-8"))
    try:
        problem = hierarchical_problem(read_campaign(trial / "campaign"))
        settings = SamplerSettings("metropolis", **SAMPLES, seed=0)
        law = load_law(request["base_model"])
        document = verdict(diagnose(problem, law, settings, Effort(replicas=replicas)))
    except Exception as error:  # a crash is an answer, and a wrong one
        document = {"verdict": "crash", "error": repr(error), "traceback": traceback.format_exc()}
    document |= {"wall_seconds": time.monotonic() - started, "cpu_seconds": time.process_time() - cpu}
    write_json(out, document)
    return document


def share(hits: Sequence[bool]) -> dict[str, Any]:
    """A share with its number of trials and its 95 % interval (Clopper and Pearson)."""
    n, k = len(hits), int(np.sum(hits))
    if n == 0:
        return {"n": 0, "share": None, "low": None, "high": None}
    interval = binomtest(k, n).proportion_ci(0.95)
    return {"n": n, "share": k / n, "low": float(interval.low), "high": float(interval.high)}


def is_alarm(answer: dict[str, Any]) -> bool:
    """Whether a verdict says that something is off."""
    return answer["verdict"] in ALARMS


def named(answer: dict[str, Any]) -> set[str]:
    """The ids of a verdict's tie set."""
    return {answer["mechanism"], *answer["indistinguishable"]} if answer.get("mechanism") else set()


def true_ids(truth: dict[str, Any]) -> set[str]:
    """The ids of what was hidden."""
    return {one["id"] for one in truth["mechanisms"]}


def place_error(truth: dict[str, Any], answer: dict[str, Any]) -> float | None:
    """Distance between the middles of the true and the stated stretch, m."""
    stretches = [one for one in truth["mechanisms"] if one.get("s_from_m") is not None]
    stated = answer.get("location")
    if not stretches or stated is None:
        return None
    middle = 0.5 * (stated["s_from_m"] + stated["s_to_m"])
    return min(abs(0.5 * (one["s_from_m"] + one["s_to_m"]) - middle) for one in stretches)


def scores(pairs: Sequence[tuple[dict[str, Any], dict[str, Any]]]) -> dict[str, Any]:
    """All scores of some trials: (truth, answer) each."""

    def those(keep: Callable[[dict[str, Any]], bool]) -> list[tuple[dict[str, Any], dict[str, Any]]]:
        return [(truth, answer) for truth, answer in pairs if keep(truth)]

    listed = ("listed", "two", "instrument", "masked")
    hidden = those(lambda t: t["hidden"] not in CLEAN)
    table: dict[str, Any] = {
        "crashes": share([a["verdict"] == "crash" for _, a in pairs]),
        "false alarms, plain": share([is_alarm(a) for _, a in those(lambda t: t["hidden"] == "nothing")]),
        "false alarms, nasty": share([is_alarm(a) for _, a in those(lambda t: t["hidden"] == "nasty")]),
    }
    for low, high in ((2.0, 4.0), (4.0, 5.5), (5.5, 7.0), (7.0, 9.0), (9.0, 13.0)):
        label = f"signal-to-noise {low:g}-{high:g}"
        inside = [(t, a) for t, a in hidden if low <= t["snr"] < high]
        known = [(t, a) for t, a in inside if t["hidden"] in listed]
        table[f"found, {label}"] = share([is_alarm(a) for _, a in inside])
        table[f"first name right, {label}"] = share([a.get("mechanism") in true_ids(t) for t, a in known])
        table[f"tie set right, {label}"] = share([bool(named(a) & true_ids(t)) for t, a in known])
    with_name = [(t, a) for t, a in pairs if a.get("mechanism") and not a["indistinguishable"]]
    tied = [(t, a) for t, a in pairs if a.get("mechanism") and a["indistinguishable"]]
    unlisted = those(lambda t: t["hidden"] == "unlisted" and t["snr"] >= 5.5)
    table["right where one is named"] = share([a["mechanism"] in true_ids(t) for t, a in with_name])
    table["tie sets hold the truth"] = share([bool(named(a) & true_ids(t)) for t, a in tied])
    table["unlisted named, wrongly"] = share([bool(a.get("mechanism")) for _, a in unlisted])
    errors = [e for t, a in pairs if (e := place_error(t, a)) is not None]
    better = [a["evidence"]["elpd_diff"] > 0 for _, a in pairs if a.get("mechanism")]
    table["held-out score better where named"] = share(better)
    return {
        "table": table,
        "median_place_error_m": float(np.median(errors)) if errors else None,
        "median_wall_seconds": float(np.median([a["wall_seconds"] for _, a in pairs])) if pairs else None,
        "median_cpu_seconds": float(np.median([a["cpu_seconds"] for _, a in pairs])) if pairs else None,
    }


def summary(trials: Path) -> dict[str, Any]:
    """Scores of all trials that have an answer, sparse and dense apart, and one line for each trial."""
    pairs = []
    for file in sorted((trials / "verdicts").glob("trial-*.json")):
        truth = json.loads((trials / "truth" / file.name).read_text(encoding="utf-8"))
        pairs.append((truth, json.loads(file.read_text(encoding="utf-8"))))
    rows = [
        {
            "seed": t["seed"],
            "kind": t["kind"],
            "base_model": t["base_model"],
            "hidden": t["hidden"],
            "true": sorted(true_ids(t)),
            "snr": t["snr"],
            "verdict": a["verdict"],
            "named": [a["mechanism"], *a["indistinguishable"]] if a.get("mechanism") else [],
            "nothing": a.get("probability", {}).get("nothing"),
            "p_value": a.get("evidence", {}).get("p_value"),
            "seconds": round(a["wall_seconds"], 1),
        }
        for t, a in pairs
    ]
    by_kind = {kind: scores([p for p in pairs if p[0]["kind"] == kind]) for kind in ("sparse", "dense")}
    return {"n": len(pairs), "all": scores(pairs), **by_kind, "trials": rows}


app = cyclopts.App(help=__doc__)


@app.default
def main(
    *,
    trials: Annotated[Path, cyclopts.Parameter(help="Folder made by development_set.py.")],
    workers: Annotated[int, cyclopts.Parameter(help="Trials diagnosed at a time.")] = 1,
    replicas: Annotated[int, cyclopts.Parameter(help="Clean campaigns simulated for each check.")] = 120,
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
            pool.submit(diagnose_one, folder, verdicts / f"{folder.name}.json", replicas): folder.name
            for folder in todo
        }
        for number, job in enumerate(as_completed(jobs), 1):
            answer = job.result()
            print(
                f"{number}/{len(jobs)} {jobs[job]}: {answer['verdict']} {answer.get('mechanism')}", flush=True
            )
    found = summary(trials)
    for name, row in found["all"]["table"].items():
        if row["n"]:
            print(f"{name:45s} {row['share']:.2f} ({row['low']:.2f}-{row['high']:.2f}), n = {row['n']}")
    if out is not None:
        write_json(out, found | {"settings": {"samples": SAMPLES, "replicas": replicas}})


if __name__ == "__main__":
    app()
