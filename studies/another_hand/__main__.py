"""Diagnose the campaigns of other hands, each under its base law.

``python -m studies.another_hand [--again NAME ...]`` goes on with those that are not in
``results/another_hand.json`` yet. The truths lie in the archives beside the campaigns, and were opened after
these answers. What is diagnosed again by later code is stored beside them. ``faults`` of the result file,
written by hand, says which ended with a fault before it was mended.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Annotated, Any

import cyclopts

from benchmarks.commit import commit
from skred.cli.exit_codes import NOT_CONVERGED
from studies.another_hand.campaigns import HANDS, hidden, unpack
from studies.files import RESULTS, read, write

app = cyclopts.App(help=__doc__)
RESULT = RESULTS / "another_hand.json"


def answer(verdict: dict[str, Any], code: str) -> dict[str, Any]:
    """What is kept of a verdict, and the version of the code that gave it."""
    return {
        "verdict": verdict["verdict"],
        "mechanisms": [one["id"] for one in verdict["mechanisms"]],
        "tied": verdict["indistinguishable"],
        "location": verdict["location"],
        "strength": verdict["strength"] and {key: verdict["strength"][key] for key in ("mean", "sd", "unit")},
        "probability": {name: share for name, share in verdict["probability"].items() if share >= 0.01},
        "p_value": verdict["evidence"]["p_value"],
        "commit": code,
    }


def diagnosed(hand: str, name: str, base_model: str, folder: Path) -> dict[str, Any]:
    """The verdict on a campaign, as ``skred diagnose`` writes it."""
    out = folder / "out"
    asked = [str(unpack(hand, name, folder)), "--base-model", base_model]
    command = [sys.executable, "-m", "skred.cli", "diagnose", *asked, "--out", str(out), "--quiet"]
    finished = subprocess.run(command)
    if finished.returncode != NOT_CONVERGED:  # which is an answer, too
        finished.check_returncode()
    verdict: dict[str, Any] = json.loads((out / "verdict.json").read_text(encoding="utf-8"))
    return verdict


@app.default
def main(
    *,
    again: Annotated[
        tuple[str, ...], cyclopts.Parameter(help="To be diagnosed by the present code too.")
    ] = (),
) -> None:
    """Diagnose those that are not yet, and some again."""
    found = read(RESULT) if RESULT.exists() else {"answers": {}, "again": {}, "faults": {}}
    for hand in HANDS:
        for name, truth in hidden(hand).items():
            into = found["again"] if name in found["answers"] else found["answers"]
            if name in found["answers"] and name not in again:
                continue
            with tempfile.TemporaryDirectory(prefix="another-hand-") as scratch:
                into[name] = answer(diagnosed(hand, name, truth.base_model, Path(scratch)), commit())
            print(f"{name}: {into[name]['verdict']} {into[name]['mechanisms']}", flush=True)
            for key in ("answers", "again"):
                found[key] = dict(sorted(found[key].items()))
            write(RESULT, found)


if __name__ == "__main__":
    app()
