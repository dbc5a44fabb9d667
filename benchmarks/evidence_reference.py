"""Log Bayes factors of the diagnosis against a slow reference that shares nothing with it but the likelihood.

``python -m benchmarks.evidence_reference --n 150 --seed 1 --seconds 3000 [--also DIR]`` draws pairs of a
campaign and a candidate, computes both numbers for each, and writes a table and
``results/evidence_reference.json``. Each pair has a file of its own in ``--out``, and the same command goes
on with a run that was ended. ``--pair K`` computes one pair. ``--engine-again`` keeps what the reference
found, here or in the results, and asks the diagnosis anew. Recordings of ``--also`` are named in the results
and are not copied.

The reference is `benchmarks.reference`. Each avalanche is a sum over a lattice at each coefficient, laid
where a search of a wide box finds its likelihood. The population is integrated by tempered population Monte
Carlo, the coefficient on a grid to thirteen scales of its mechanism that refines itself. At the best
coefficient all is computed a second time on finer lattices, and for every fifth pair by nested sampling
(dynesty) too.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import cyclopts

from benchmarks.commit import commit
from benchmarks.files import RESULTS, ROOT, as_columns, as_rows, rounded, write
from benchmarks.reference.pairs import (
    campaigns_in,
    draw_candidate,
    draw_pair,
    shape_as_dict,
    shape_from_dict,
)
from benchmarks.reference.table import summary, table
from skred.output import write_json

RESULT = RESULTS / "evidence_reference.json"
DIGITS = 4
"""Significant digits of a pair that are kept: of a hundred nats a tenth."""
NESTED_EVERY = 5
"""No multiple of the number of base laws: each of them has its turn."""
app = cyclopts.App(help=__doc__)


def compute(
    seed: int, number: int, also: list[Path], before: dict[str, Any] | None, *, nested: bool
) -> dict[str, Any]:
    """Both numbers of a pair.

    Parameters
    ----------
    before : dict, optional
        What was found before, of which the reference's part is kept if it is of the same recordings: the
        simulator may draw others today.
    nested : bool
        Whether nested sampling checks the reference.
    """
    from benchmarks.reference.bayes_factor import nothing_added, reference_factor
    from benchmarks.reference.coefficient import SCALES
    from benchmarks.reference.engine import engine_log_bayes_factor, fitted_base
    from skred.inference.hierarchical.problem import hierarchical_problem
    from skred.physics.laws import load_law
    from skred.physics.mechanisms import mechanisms

    drawn = draw_pair(seed, number, also)
    problem, law = hierarchical_problem(drawn.campaign), load_law(drawn.base)
    # Of the recordings, and of the prior that the reference integrates over.
    fingerprint = f"{drawn.campaign.fingerprint()[:12]}-{len(SCALES)}"
    record: dict[str, Any] = {"pair": number, "seed": seed, **drawn.as_dict(), "fingerprint": fingerprint}
    if before is not None and before.get("fingerprint") == fingerprint and "reference" in before:
        mechanism = mechanisms()[before["mechanism"]]
        shapes = [shape_from_dict(one) for one in before["shapes"]]
        record |= {key: before[key] for key in ("mechanism", "shapes", "reference")}
    else:
        plain, setting = nothing_added(problem, law, seed + number)
        mechanism, shapes = draw_candidate(drawn, setting)
        record |= {"mechanism": mechanism.id, "shapes": [shape_as_dict(one) for one in shapes]}
        found = reference_factor(plain, setting, mechanism, shapes, n_live=150 if nested else 0)
        record["reference"] = found.as_dict()

    def engine() -> float:
        return engine_log_bayes_factor(fitted_base(problem, law), mechanism, shapes)

    record["engine"] = _timed(engine)
    return record


def _timed(engine: Callable[[], float]) -> dict[str, Any]:
    """The diagnosis' number; a failure is an answer."""
    started = time.process_time()
    try:
        answer: dict[str, Any] = {"log_bayes_factor": engine()}
    except Exception as error:
        answer = {"log_bayes_factor": None, "error": repr(error)}
    return answer | {"seconds": time.process_time() - started}


@app.default
def main(
    *,
    n: int = 150,
    seed: int = 1,
    seconds: Annotated[float, cyclopts.Parameter(help="No pair is begun after so long.")] = float("inf"),
    pair: Annotated[int | None, cyclopts.Parameter(help="This pair alone.")] = None,
    also: Annotated[
        list[Path] | None, cyclopts.Parameter(help="Another campaign, or a folder of them.")
    ] = None,
    engine_again: Annotated[
        bool, cyclopts.Parameter(help="Keep the reference's numbers.", negative="")
    ] = False,
    only_table: Annotated[bool, cyclopts.Parameter(help="Compute nothing.", negative="")] = False,
    out: Path = ROOT / "skred-out" / "evidence_reference",
    result: Annotated[Path, cyclopts.Parameter(name="--json")] = RESULT,
) -> int:
    """Compute what is not computed yet, and compare; each seed has a folder of its own in `out`."""
    started, folders = time.monotonic(), campaigns_in(also or [])
    out = out / f"seed-{seed}"
    out.mkdir(parents=True, exist_ok=True)
    known = []
    if engine_again and result.exists():
        known = as_rows(json.loads(result.read_text(encoding="utf-8"))["pairs"])
    found_before = {one["pair"]: one for one in known if one["seed"] == seed}
    for number in [pair] if pair is not None else range(1, n + 1):
        file = out / f"pair-{number:04d}.json"
        before = json.loads(file.read_text(encoding="utf-8")) if file.is_file() else found_before.get(number)
        if only_table or (before is not None and not engine_again):
            continue
        if time.monotonic() - started > seconds:
            break
        record = compute(seed, number, folders, before, nested=number % NESTED_EVERY == 0)
        write_json(file, record)
        print(_line(record), flush=True)
    records = [json.loads(one.read_text(encoding="utf-8")) for one in sorted(out.glob("pair-*.json"))]
    if pair is not None:
        print(json.dumps(next(one for one in records if one["pair"] == pair), indent=1))
        return 0
    found = summary(records)
    print(table(found))
    write(result, {"commit": commit(), **found, "pairs": as_columns([_kept(one) for one in records])})
    return 0


def _kept(record: dict[str, Any]) -> dict[str, Any]:
    """What the result has of a pair: in digits that matter, and of shapes all that they have.

    Shapes are what the diagnosis is asked again about: half a metre of an obstacle can be a nat.
    """
    shapes = [{key: value for key, value in one.items() if value is not None} for one in record["shapes"]]
    kept: dict[str, Any] = rounded(record, DIGITS)
    return kept | {"shapes": shapes}


def _line(record: dict[str, Any]) -> str:
    reference, engine = record["reference"], record["engine"]
    what = f"{record['source']} {record['base']} {record['recorded']} {record['n_events']}"
    factor = engine["log_bayes_factor"]
    said = "failed" if factor is None else f"{factor:.2f}"
    return (
        f"{record['pair']}: {what} {record['mechanism']} x{len(record['shapes'])}: reference"
        f" {reference['log_bayes_factor']:.2f} +- {reference['error']:.2f}, engine {said};"
        f" {reference['seconds']:.0f} s, {engine['seconds']:.0f} s"
    )


if __name__ == "__main__":
    sys.exit(app())
