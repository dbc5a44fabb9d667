"""The evidence of a force in no list: from as many draws as a race takes, from many, by Laplace's formula.

``python benchmarks/free_force_draws.py [--json FILE]`` races what is missing at Ryggfonn under two base laws,
fits the unlisted force under each error model and in each way it may go with speed, and takes its evidence
by either route, with several seeds. Under ``voellmy`` fronts stop near sensors, and Laplace's formula fails.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from pathlib import Path
from typing import Annotated, Any

import cyclopts

from benchmarks.commit import commit
from skred.campaign import find_campaign, read_campaign
from skred.diagnosis.compare.comparison import Heat, free_force, race
from skred.diagnosis.discrepancy.profile import KINDS
from skred.diagnosis.discrepancy.sampled_evidence import sampled_log_factor
from skred.output import write_json
from studies.thresholds.compared_again import base_on

app = cyclopts.App(help=__doc__)
LAWS = ("voellmy", "pcm")
SEEDS, MANY_SEEDS, MANY_TURNS = range(1, 5), range(101, 103), 16


def both_ways(law: str, heat: Heat, pool: Executor) -> Iterator[dict[str, Any]]:
    """Each kind of force that Laplace's formula gives more evidence than none."""
    listed = max(entrant.log_bayes_factor for entrant in heat.entrants.values())
    for kind in KINDS:
        profile = free_force(heat.base, kind, heat.entrants)
        if profile.log_bayes_factor <= 0.0:
            continue
        started = time.process_time()
        usual = [sampled_log_factor(heat.base, profile, pool, seed=seed) for seed in SEEDS]
        seconds = (time.process_time() - started) / len(SEEDS)
        many = [
            sampled_log_factor(heat.base, profile, pool, seed=seed, turns=MANY_TURNS, enough=math.inf)
            for seed in MANY_SEEDS
        ]
        yield {
            "base_model": law,
            "errors": heat.error_model,
            "force": kind.equation,
            "best_listed": listed,
            "laplace": profile.log_bayes_factor,
            "usual": usual,
            "many": many,
            "cpu_seconds": seconds,
        }


@app.default
def main(
    *, out: Annotated[Path | None, cyclopts.Parameter(name="--json", help="File for the figures.")] = None
) -> None:
    """Measure."""
    rows = []
    for law in LAWS:
        base = base_on(read_campaign(find_campaign("ryggfonn")), law)
        if base is None:
            sys.exit(f"{law}: the gate of the base law failed")
        with ThreadPoolExecutor(1) as pool:
            for heat in race(base).heats:
                for row in both_ways(law, heat, pool):
                    print(row, flush=True)
                    rows.append(row)
    if out is not None:
        write_json(out, {"commit": commit(), "rows": rows})


if __name__ == "__main__":
    app()
