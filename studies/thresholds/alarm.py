"""How often campaigns with nothing hidden pass the alarm's limits.

``python -m studies.thresholds.alarm [--n 80] [--workers 2]``. The statistic of the recordings is the log odds
by the whole comparison, that of simulated campaigns comes from one shape of each mechanism. That this makes
one limit is shown here: on campaigns with nothing hidden, half of them nasty (a bad reading, heavy tails),
the p-value has to be at most 0.01 in one of a hundred. Kept campaign by campaign in ``results/alarm.json``;
the same command goes on with a run that was ended. Nothing was tuned on these.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from typing import Any

import cyclopts

from benchmarks.commit import commit
from skred.diagnosis.limits import LIMIT
from skred.prove.plan import NULLS
from skred.simulator.draw import draw_trial
from studies.files import RESULTS, read, write
from studies.masked.open import KINDS, alarm_of, as_read

RESULT = RESULTS / "alarm.json"
SEED = 3_430_000
app = cyclopts.App(help=__doc__)


def look(number: int) -> dict[str, Any]:
    """What the alarm says of a campaign with nothing hidden."""
    hidden, kind = NULLS[number // 2 % 2], KINDS[number % 2]
    trial = draw_trial(SEED + number, kind=kind, hidden=hidden)
    told = {"commit": commit(), "hidden": hidden, "kind": kind}
    return told | alarm_of(as_read(trial), trial.truth["base_model"])


def counted(found: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Alarms and passed limits of campaigns with nothing hidden."""
    rows = {}
    for hidden in NULLS:
        own = [one for one in found if one["hidden"] == hidden and "p_value" in one]
        rows[hidden] = {
            "of": len(own),
            "alarms": sum(one["alarm"] for one in own),
            "p at the limit": sum(one["p_value"] <= LIMIT for one in own),
            "p at most 0.1": sum(one["p_value"] <= 0.1 for one in own),
        }
    return rows


def keep(found: dict[str, Any]) -> dict[str, Any]:
    """Write all that is known."""
    document: dict[str, Any] = {"counted": counted(list(found.values())), "seed": SEED}
    document |= {"commits": sorted({one["commit"] for one in found.values()})}
    write(RESULT, document | {"trials": dict(sorted(found.items()))})
    return document


@app.default
def main(*, n: int = 80, workers: int = 2) -> None:
    """Look at campaigns with nothing hidden that were not looked at yet.

    Parameters
    ----------
    n
        Campaigns in all.
    workers
        Processes.
    """
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    found: dict[str, Any] = read(RESULT)["trials"] if RESULT.exists() else {}
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        at_work = {pool.submit(look, k): f"{k:04d}" for k in range(n) if f"{k:04d}" not in found}
        for done in as_completed(at_work):
            found[at_work[done]] = done.result()
            keep(found)
            print(at_work[done], done.result(), flush=True)
    print(keep(found)["counted"])


if __name__ == "__main__":
    app()
