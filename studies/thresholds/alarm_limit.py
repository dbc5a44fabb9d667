"""How small the probability of nothing must be for the comparison alone to raise the alarm.

``python -m studies.thresholds.alarm_limit [--n 80] [--workers 2]``. The limit was taken from the answers of
opened batches of concealed trials: how many campaigns with nothing hidden fall below it, nasty ones counted,
and how much of what is hidden is found besides by it. Beside them stand n campaigns with nothing hidden that
were drawn after, half of them nasty, by the present code up to its alarm. Kept trial by trial in
``results/alarm_limit.json``; the same command goes on with a run that was ended.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from itertools import pairwise
from multiprocessing import get_context
from typing import Any

import cyclopts

from benchmarks.commit import commit
from skred.diagnosis.compare.decision import NOTHING_ALONE
from skred.diagnosis.evidence.prior_odds import NOTHING
from skred.prove.plan import NULLS
from skred.prove.scoring.answers import Pair
from skred.simulator.draw import draw_trial
from studies.files import RESULTS, read, write
from studies.masked.open import KINDS, alarm_of, as_read
from studies.proof.record import diagnosed, opened_batches

RESULT = RESULTS / "alarm_limit.json"
SEED = 2_700_000
LIMITS = (0.01, 0.05, 0.1, NOTHING_ALONE, 0.2, 0.3)
EDGES = (2.0, 4.0, 5.5, 7.0, 12.0)
app = cyclopts.App(help=__doc__)


def look(number: int) -> dict[str, Any]:
    """What the alarm says of a campaign with nothing hidden."""
    hidden, kind = NULLS[number // 2 % 2], KINDS[number % 2]
    trial = draw_trial(SEED + number, kind=kind, hidden=hidden)
    told = {"commit": commit(), "hidden": hidden, "kind": kind}
    return told | alarm_of(as_read(trial), trial.truth["base_model"])


def opened(pairs: Sequence[Pair]) -> dict[str, Any]:
    """What each limit would have made of opened trials, by what was stated of them then."""
    stated = [(pair, float(pair.probability.get(NOTHING, 1.0))) for pair in pairs]
    clean = sorted(nothing for pair, nothing in stated if pair.is_null)
    rows = []
    for limit in LIMITS:
        found = {}
        for low, high in pairwise(EDGES):
            here = [one for one in stated if not one[0].is_null and low <= one[0].snr < high]
            found[f"{low:g} to {high:g}"] = [
                sum(pair.alarm or nothing < limit for pair, nothing in here),
                len(here),
            ]
        rows.append({"limit": limit, "clean_below": sum(one < limit for one in clean), "found": found})
    return {"clean": len(clean), "least": clean[:5], "limits": rows}


def drawn_after(found: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Alarms of campaigns with nothing hidden, and how near the others came."""
    rows = {}
    for hidden in NULLS:
        own = [one for one in found if one["hidden"] == hidden]
        rows[hidden] = {"alarms": sum(one["alarm"] for one in own), "of": len(own)}
    return rows | {"least": sorted(one["nothing"] for one in found if "nothing" in one)[:5]}


def keep(found: dict[str, Any], before: dict[str, Any]) -> dict[str, Any]:
    """Write all that is known; `before` is what opened trials say."""
    document: dict[str, Any] = {"opened": before, "drawn_after": drawn_after(list(found.values()))}
    document |= {"seed": SEED, "commits": sorted({one["commit"] for one in found.values()})}
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
    before = opened([pair for batch in opened_batches() for pair in diagnosed(batch)])
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        at_work = {pool.submit(look, k): f"{k:04d}" for k in range(n) if f"{k:04d}" not in found}
        for done in as_completed(at_work):
            found[at_work[done]] = done.result()
            keep(found, before)
            print(at_work[done], done.result(), flush=True)
    told = keep(found, before)
    for row in told["opened"]["limits"]:
        print(row)
    print({key: told["opened"][key] for key in ("clean", "least")}, told["drawn_after"])


if __name__ == "__main__":
    app()
