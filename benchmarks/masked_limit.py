"""What recordings say of strong effects on a stretch, masked and open, to one who knows where they are.

``python benchmarks/masked_limit.py [--workers 2]``, after ``masked_open.py``: its sparse trials of a
signal-to-noise of 4 and more that hide drag or snow taken up on a stretch. The mechanism is let in at its
true place, a masked one opposed by the relief of those tried that fits best (`FACTORS` of the typical speed
at either end), and its strength is the best of a grid. A diagnosis, which has to look for place, relief and
strength, pays for that out of the evidence gained so. Beside it stands what is expected, half the square of
the signal-to-noise. Kept trial by trial in ``results/masked_limit.json``; the same command goes on with a run
that was ended.
"""

from __future__ import annotations

import json
import os
from concurrent.futures import ProcessPoolExecutor, as_completed
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import cyclopts
import numpy as np
from masked_open import HIDDEN, RESULT, drawn
from race_again import base_on

from skred.diagnosis.curves import curve_at
from skred.diagnosis.event_nodes import USUAL
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.spec import Shape
from skred.physics.mechanisms.stretches import U_1, U_2
from skred.work.output import write_json

FOUND = Path(__file__).resolve().parent / "results" / "masked_limit.json"
IDS, SNR = ("segment_drag", "entrainment"), 4.0
FACTORS = (0.85, 0.92, 1.0, 1.08, 1.15)
STRENGTHS = (0.25, 0.5, 1.0, 2.0, 3.5, 7.0, 14.0)
"""In scales of the prior."""
app = cyclopts.App(help=__doc__)


def at_its_place(number: int, seen: dict[str, Any]) -> dict[str, Any]:
    """Largest log evidence against nothing at the true place [nats]; None where a gate fails."""
    trial, campaign = drawn(number, seen["hidden"])
    told = {key: seen[key] for key in ("hidden", "snr", "ids", "base", "alarm")}
    base = base_on(campaign, trial.truth["base_model"])
    if base is None:
        return told | {"gained": None}
    hidden = trial.truth["mechanisms"][0]
    place = float(hidden["s_from_m"]), float(hidden["s_to_m"])
    mechanism = mechanisms()[hidden["id"]]
    assert mechanism.added is not None
    shapes = [Shape(*place)]
    if seen["hidden"] == "masked":
        typical = np.interp(place, base.setting.terrain.edge_s_m, base.setting.front_speed)
        speeds = [np.array(factors) * typical for factors in product(FACTORS, FACTORS)]
        shapes = [Shape(*place, constants=((U_1, float(one)), (U_2, float(two)))) for one, two in speeds]
    strengths = mechanism.added.scale * np.array(STRENGTHS)
    gained = [curve_at(base, mechanism, shape, strengths, USUAL).log_evidence for shape in shapes]
    return told | {"gained": float(np.max(gained))}


def summary(found: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Medians of what is gained, by what is hidden: all, then by whether it was found."""
    rows = []
    for hidden, alarms in product(HIDDEN, ((True, False), (True,), (False,))):
        own = [one for one in found if one["hidden"] == hidden and one["alarm"] in alarms]
        own = [one for one in own if one["gained"] is not None]
        if own:
            gained = np.array([one["gained"] for one in own])
            row = {
                "hidden": hidden,
                "alarm": "any" if len(alarms) > 1 else "raised" if alarms[0] else "not",
                "trials": len(own),
            }
            row |= {"gained": float(np.median(gained)), "most": float(gained.max())}
            rows.append(row | {"expected": float(np.median([0.5 * one["snr"] ** 2 for one in own]))})
    return rows


@app.default
def main(*, workers: int = 2) -> None:
    """Look at what is not looked at yet.

    Parameters
    ----------
    workers
        Processes.
    """
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    trials = json.loads(RESULT.read_text(encoding="utf-8"))["trials"]
    chosen = {
        name: seen
        for name, seen in trials.items()
        if seen["kind"] == "sparse" and seen["snr"] >= SNR and seen["ids"][0] in IDS
    }
    found: dict[str, Any] = json.loads(FOUND.read_text(encoding="utf-8"))["trials"] if FOUND.exists() else {}
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        at_work = {
            pool.submit(at_its_place, int(name[:4]), seen): name
            for name, seen in chosen.items()
            if name not in found
        }
        for done in as_completed(at_work):
            found[at_work[done]] = done.result()
            write_json(
                FOUND, {"summary": summary(list(found.values())), "trials": dict(sorted(found.items()))}
            )
            print(at_work[done], done.result(), flush=True)
    told = summary(list(found.values()))
    write_json(FOUND, {"summary": told, "trials": dict(sorted(found.items()))})
    for row in told:
        print(row)


if __name__ == "__main__":
    app()
