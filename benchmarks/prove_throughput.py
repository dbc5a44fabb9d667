"""Trials per second of `skred prove run` with one worker and with two.

``python -m benchmarks.prove_throughput [--trials 6] [--kind sparse] [--quick] [--json FILE]`` seals trials
that hide nothing in a temporary folder and has them diagnosed twice, from the same sealed state, so that both
runs do the same work. Compiled code is cached by a diagnosis that is not timed. Starting workers is part of
a run.
"""

from __future__ import annotations

import json
import shutil
import tempfile
import time
from pathlib import Path
from typing import Annotated, Any, Literal

import cyclopts

from skred.prove.folder import ProofFolder
from skred.prove.plan import Plan, random_seed
from skred.prove.pool import WorkerPool
from skred.prove.run import run
from skred.prove.seal import seal

app = cyclopts.App(help=__doc__)


def silent(line: str) -> None:
    """Keeps a stage to itself."""


def timed(folder: ProofFolder, workers: int) -> dict[str, Any]:
    """Seconds that a run takes, and how its trials fared; its answers are removed."""
    started = time.monotonic()
    counts = run(folder, WorkerPool(workers), silent, silent)
    seconds = time.monotonic() - started
    answers = [json.loads(file.read_text()) for file in sorted(folder.answer("any").parent.glob("*.json"))]
    shutil.rmtree(folder.path / "answers")
    return {
        "workers": workers,
        "seconds": seconds,
        "trials_per_second": counts["answered"] / seconds,
        "cpu_seconds_per_trial": sum(one["cpu_seconds"] for one in answers) / len(answers),
        "crashed": counts["crashed"],
        "late": counts["late"],
    }


@app.default
def main(
    *,
    trials: int = 6,
    kind: Literal["sparse", "dense", "mixed"] = "sparse",
    quick: bool = False,
    out: Annotated[Path | None, cyclopts.Parameter(name="--json", help="File for the figures.")] = None,
) -> None:
    """Measure."""
    with tempfile.TemporaryDirectory(prefix="throughput-") as scratch:
        first = ProofFolder(Path(scratch) / "first")
        seal(
            first, Plan(1, random_seed(), kind, nothing_share=1.0, quick=quick), WorkerPool(1), silent, silent
        )
        timed(first, 1)
        folder = ProofFolder(Path(scratch) / "proof")
        plan = Plan(trials, random_seed(), kind, nothing_share=1.0, quick=quick)
        seal(folder, plan, WorkerPool(2), silent, silent)
        rows = [timed(folder, workers) for workers in (1, 2)]
    for row in rows:
        print(
            f"{row['workers']} workers: {row['trials_per_second']:.4f} trials/s, "
            f"{row['cpu_seconds_per_trial']:.0f} CPU s a trial, {row['seconds']:.0f} s"
        )
    gain = rows[1]["trials_per_second"] / rows[0]["trials_per_second"]
    print(f"two workers: {gain:.2f} times one")
    if out is not None:
        out.write_text(json.dumps({"plan": plan.as_dict(), "runs": rows, "gain": gain}, indent=1) + "\n")


if __name__ == "__main__":
    app()
