"""The evidence of a force not in the list: by few draws, by many, by Laplace's approximation.

``python -m studies.thresholds.free_force_draws`` compares what is missing at Ryggfonn under two base
laws, fits the unlisted force under each error model and in each way it may go with speed, and takes its
evidence by either route, with several seeds. Under ``voellmy`` fronts stop near sensors, and Laplace's
formula fails.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from typing import Any

import cyclopts

from benchmarks.commit import commit
from skred.campaign import find_campaign, read_campaign
from skred.diagnosis.compare.comparison import ComparisonUnderErrors, compare, free_force
from skred.diagnosis.discrepancy.profile import KINDS
from skred.diagnosis.discrepancy.sampled_evidence import sampled
from studies.files import RESULTS, write
from studies.thresholds.compared_again import base_on

app = cyclopts.App(help=__doc__)
RESULT = RESULTS / "free_force_draws.json"
LAWS = ("voellmy", "pcm")
SEEDS, MANY_SEEDS, MANY_DRAWS = range(1, 5), range(101, 103), 176


def both_ways(law: str, under_errors: ComparisonUnderErrors, pool: Executor) -> Iterator[dict[str, Any]]:
    """Each kind of force that Laplace's formula gives more evidence than none."""
    listed = max(candidate.log_bayes_factor for candidate in under_errors.candidates.values())
    for kind in KINDS:
        profile = free_force(under_errors.base, kind, under_errors.candidates)
        if profile.log_bayes_factor <= 0.0:
            continue
        started = time.process_time()
        usual = [sampled(under_errors.base, profile, pool, seed=seed).log_bayes_factor for seed in SEEDS]
        seconds = (time.process_time() - started) / len(SEEDS)
        many = [
            sampled(under_errors.base, profile, pool, seed=seed, n=MANY_DRAWS, enough=0.0).log_bayes_factor
            for seed in MANY_SEEDS
        ]
        yield {
            "base_model": law,
            "errors": under_errors.error_model,
            "force": kind.equation,
            "best_listed": listed,
            "laplace": profile.log_bayes_factor,
            "usual": usual,
            "many": many,
            "cpu_seconds": seconds,
        }


@app.default
def main() -> None:
    """Measure."""
    rows = []
    for law in LAWS:
        base = base_on(read_campaign(find_campaign("ryggfonn")), law)
        if base is None:
            sys.exit(f"{law}: the gate of the base law failed")
        with ThreadPoolExecutor(1) as pool:
            for under_errors in compare(base).under_each:
                for row in both_ways(law, under_errors, pool):
                    print(row, flush=True)
                    rows.append(row)
    write(RESULT, {"commit": commit(), "many_draws": 6 * MANY_DRAWS, "rows": rows})


if __name__ == "__main__":
    app()
