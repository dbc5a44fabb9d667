"""What the choices that make a comparison affordable cost, each against doing without it.

``python -m benchmarks.evidence_choices places|starts [--n 40] [--seed 2] [--workers 2]`` draws pairs of a
campaign and a base law as `benchmarks.evidence_reference` does and writes ``results/evidence_choices.json``.
The same command goes on with a run that was ended.

places: refined shapes of a stretch against draws of its place and length. starts: climbs that begin with
another mechanism's fit, too.
"""

from __future__ import annotations

import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from importlib import import_module
from multiprocessing import get_context
from typing import Any, Literal

import cyclopts

from benchmarks.commit import commit
from benchmarks.files import RESULTS, read, write
from benchmarks.reference.pairs import draw_pair

RESULT = RESULTS / "evidence_choices.json"
app = cyclopts.App(help=__doc__)


def one_pair(choice: str, seed: int, number: int) -> dict[str, Any]:
    """What one pair says of a choice; a failure is an answer."""
    started = time.process_time()
    drawn = draw_pair(seed, number)
    try:
        found = import_module(f"benchmarks.choices.{choice}").look(drawn) or {"none": True}
    except Exception as error:
        found = {"error": repr(error)}
    told = {key: value for key, value in drawn.as_dict().items() if key != "averaged"}
    return {"pair": number, **told, **found, "seconds": time.process_time() - started}


@app.default
def main(choice: Literal["places", "starts"], /, *, n: int = 40, seed: int = 2, workers: int = 2) -> int:
    """Look at pairs that were not looked at yet."""
    os.environ["OMP_NUM_THREADS"] = "1"  # of each worker
    document: dict[str, Any] = read(RESULT) if RESULT.exists() else {}
    part = document.setdefault(choice, {"seed": seed, "commit": commit(), "pairs": []})
    if part["seed"] != seed:
        raise SystemExit(f"{RESULT.name} has pairs of seed {part['seed']}; remove its part {choice!r}")
    todo = sorted(set(range(1, n + 1)) - {one["pair"] for one in part["pairs"]})
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        at_work = [pool.submit(one_pair, choice, seed, number) for number in todo]
        for done in as_completed(at_work):
            record = done.result()
            part["pairs"] = sorted([*part["pairs"], record], key=lambda one: one["pair"])
            write(RESULT, dict(sorted(document.items())))
            print({key: value for key, value in record.items() if not isinstance(value, dict)}, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(app())
