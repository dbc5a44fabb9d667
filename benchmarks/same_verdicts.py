"""Whether a change of the code left the verdicts as they were.

``python -m benchmarks.same_verdicts DIR`` draws the 40 opened trials of the record, diagnoses them, diagnoses
Ryggfonn, and compares every answer with the record ``results/verdicts_before.json``: a table of what differs.
The same command goes on with a run that was ended. ``--record`` writes the record anew from DIR instead.

The record was made by commit bba8a6d, before the rooms were rearranged, from the trials that
``python -m benchmarks.development_set --each --seed 3100000 --n 40 --out DIR`` draws, and from the results of
`studies.ryggfonn` at that commit. Nothing was tuned on either of them after that.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Annotated, Any

import cyclopts

from benchmarks.files import RESULTS, ROOT, read, write

RECORD = RESULTS / "verdicts_before.json"
SET = ("--each", "--seed", "3100000", "--n", "40")
SAME = ("verdict", "mechanism", "indistinguishable")
"""Keys that must be equal."""
CLOSE = 0.02
"""Largest difference of a probability that counts as the same: sampling in another order moves the last
digits of the evidence, and no verdict hangs on a hundredth."""

app = cyclopts.App(help=__doc__)


def essence(document: dict[str, Any]) -> dict[str, Any]:
    """What of a verdict is compared."""
    evidence = document.get("evidence") or {}
    kept = {key: document.get(key) for key in SAME}
    kept |= {key: evidence.get(key) for key in ("log_bayes_factor", "p_value")}
    kept["probability"] = {
        name: round(share, 6) for name, share in (document.get("probability") or {}).items()
    }
    return kept


def differences(before: dict[str, Any], after: dict[str, Any]) -> list[str]:
    """What two answers differ in, in words; empty where they are the same."""
    found = [f"{key}: {before[key]} -> {after[key]}" for key in SAME if before[key] != after[key]]
    moved = moved_most(before, after)
    if before["probability"].keys() != after["probability"].keys():
        found.append("candidates")
    elif moved > CLOSE:
        found.append(f"a probability by {moved:.3f}")
    if not same_number(before["p_value"], after["p_value"]):
        found.append(f"p-value: {before['p_value']} -> {after['p_value']}")
    return found


def same_number(one: float | None, other: float | None) -> bool:
    """Whether two numbers agree in the digits that result files keep; or neither is there."""
    if one is None or other is None:
        return one is other
    return math.isclose(one, other, rel_tol=1e-5)


def moved_most(before: dict[str, Any], after: dict[str, Any]) -> float:
    """The largest change of a probability."""
    shares, others = before["probability"], after["probability"]
    return max((abs(shares[name] - others[name]) for name in shares.keys() & others.keys()), default=0.0)


def answers(folder: Path) -> dict[str, dict[str, Any]]:
    """Answers of a run by name."""
    files = [
        *sorted((folder / "verdicts").glob("trial-*.json")),
        *sorted((folder / "ryggfonn").glob("*.json")),
    ]
    return {
        f"{file.parent.name}/{file.stem}": essence(json.loads(file.read_text(encoding="utf-8")))
        for file in files
    }


def table(before: dict[str, Any], after: dict[str, Any]) -> str:
    """The comparison as a table."""
    lines = ["| case | verdict before | after | largest change of a probability | differs in |"]
    lines.append("| --- | --- | --- | --- | --- |")
    for name in before:
        if name not in after:
            lines.append(f"| {name} | {said(before[name])} | not run | | |")
            continue
        found = "; ".join(differences(before[name], after[name])) or "nothing"
        moved = moved_most(before[name], after[name])
        lines.append(f"| {name} | {said(before[name])} | {said(after[name])} | {moved:.6f} | {found} |")
    return "\n".join(lines) + "\n"


def said(answer: dict[str, Any]) -> str:
    """A verdict in a few words."""
    return " ".join(part for part in (answer["verdict"], answer["mechanism"]) if part)


def run(*words: str) -> None:
    """Run a program of this repository."""
    subprocess.run([sys.executable, "-m", *words], cwd=ROOT, check=True)


@app.default
def main(
    folder: Path,
    /,
    *,
    workers: Annotated[int, cyclopts.Parameter(help="Trials diagnosed at a time.")] = 1,
    record: Annotated[
        bool, cyclopts.Parameter(help="Write the record from DIR instead.", negative="")
    ] = False,
    only_compare: Annotated[bool, cyclopts.Parameter(help="Diagnose nothing.", negative="")] = False,
) -> int:
    """Diagnose what is not diagnosed yet, and compare with the record."""
    if not (only_compare or record):
        run("benchmarks.development_set", *SET, "--out", str(folder))
        run("benchmarks.diagnosis", "--trials", str(folder), "--workers", str(workers))
        run("studies.ryggfonn", "--out", str(folder / "ryggfonn"))
    after = answers(folder)
    if record:
        write(RECORD, after)
        return 0
    before = read(RECORD)
    print(table(before, after))
    differ = [name for name in before if name in after and differences(before[name], after[name])]
    print(f"{len(differ)} of {len(before.keys() & after.keys())} differ.")
    return 1 if differ else 0


if __name__ == "__main__":
    sys.exit(app())
