"""Diagnose the campaigns of another hand, each under its base law.

``python -m studies.another_hand`` goes on with those that are not in ``results/another_hand.json`` yet;
remove that file to diagnose all again. The truths lie in the archive beside the campaigns. Nothing was tuned
on these. ``faults`` of the result file, written by hand, says which ended with a fault before it was mended.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import cyclopts

from benchmarks.commit import commit
from studies.another_hand.campaigns import hidden, unpack
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


def diagnosed(name: str, base_model: str, folder: Path) -> dict[str, Any]:
    """The verdict on a campaign, as ``skred diagnose`` writes it."""
    out = folder / "out"
    asked = [str(unpack(name, folder)), "--base-model", base_model]
    command = [sys.executable, "-m", "skred.cli", "diagnose", *asked, "--out", str(out), "--quiet"]
    subprocess.run(command, check=True)
    verdict: dict[str, Any] = json.loads((out / "verdict.json").read_text(encoding="utf-8"))
    return verdict


@app.default
def main() -> None:
    """Diagnose those that are not yet."""
    known = read(RESULT) if RESULT.exists() else {}
    answers = known.get("answers", {})
    for name, truth in hidden().items():
        if name in answers:
            continue
        with tempfile.TemporaryDirectory(prefix="another-hand-") as scratch:
            answers[name] = answer(diagnosed(name, truth.base_model, Path(scratch)), commit())
        print(f"{name}: {answers[name]['verdict']} {answers[name]['mechanisms']}", flush=True)
        write(RESULT, {**known, "answers": dict(sorted(answers.items()))})


if __name__ == "__main__":
    app()
