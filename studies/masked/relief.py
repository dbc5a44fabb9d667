"""What masked effects lose: opened trials, each at its true place, by how fast the relief that masks it is.

``python -m studies.masked.relief [--workers 2]`` draws the opened trials again in which a drag or snow
taken up is opposed by a relief, fits the base law, and adds the hidden mechanism where it is, opposed by
a relief that equals it at the speed that a diagnosis takes for typical, times several factors. Beside that
stands the best that the trial's own diagnosis found for the mechanism, whose place it had to look for. Kept
trial by trial in ``results/masked_relief.json``; the same command goes on with a run that was ended.
"""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from typing import Any

import cyclopts
import numpy as np

from skred.diagnosis.evidence.coefficient import Base, curve_at, curve_near
from skred.diagnosis.evidence.event_quadrature import USUAL
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.placed import placed
from skred.physics.mechanisms.spec import Shape
from skred.physics.mechanisms.stretches import U_1, U_2
from skred.prove.scorecard import DIAGNOSIS
from studies.files import RESULTS, read, write
from studies.proof.record import answers_of, opened_batches, sealed_of
from studies.thresholds.compared_again import base_of

RESULT = RESULTS / "masked_relief.json"
FACTORS = (0.9, 0.95, 1.0, 1.05, 1.1)
LEFT_OUT = ("1471600277", "1152334902", "1324747921")
"""Batches whose diagnoses did not look for what is opposed; and what came of this study was in the last."""
STRENGTHS = (0.1, 0.25, 0.5, 1.0, 2.0, 3.5)
"""In scales of the mechanism."""
app = cyclopts.App(help=__doc__)


def told_of(sealed: dict[str, Any], found: float | None) -> dict[str, Any]:
    """Log Bayes factor at the true place by the relief's factor; the trial's own; None where a gate fails."""
    truth = sealed["truth"]
    hidden = truth["mechanisms"][0]
    told = {"kind": truth["kind"], "snr": truth["snr"], "id": hidden["id"], "in_its_diagnosis": found}
    base = base_of(sealed)
    if base is None:
        return told | {"at_its_place": None}
    place = float(hidden["s_from_m"]), float(hidden["s_to_m"])
    factors = {f"{factor:g}": _at(base, hidden["id"], place, factor) for factor in FACTORS}
    return told | {"at_its_place": factors}


def _at(base: Base, name: str, place: tuple[float, float], factor: float) -> float:
    """Log Bayes factor of a mechanism on a stretch, opposed at a multiple of the typical speed."""
    # The prior as it was in those diagnoses: of one scale, not three times as wide where opposed.
    mechanism = mechanisms()[name]
    speeds = factor * np.interp(place, base.setting.terrain.edge_s_m, base.setting.front_speed)
    shape = Shape(*place, constants=((U_1, float(speeds[0])), (U_2, float(speeds[1]))))
    candidate = placed(mechanism, base.setting, shape)
    rough = curve_at(base, candidate, candidate.added.scale * np.array(STRENGTHS), USUAL)
    return curve_near(base, rough, shape).log_factor_of(scales=(1.0,))


def opposed_trials() -> dict[str, tuple[dict[str, Any], float | None]]:
    """Opened trials whose effect a relief opposes: what was sealed, and what the diagnosis found for it."""
    trials = {}
    for batch in opened_batches():
        if batch.name in LEFT_OUT:
            continue
        answers = answers_of(batch)[DIAGNOSIS]
        for name, sealed in sealed_of(batch).items():
            hidden = sealed["truth"]["mechanisms"]
            if sealed["truth"]["hidden"] == "masked" and hidden[0]["s_from_m"] is not None:
                factors = answers[name].get("log_bayes_factors") or {}
                trials[f"{batch.name}:{name}"] = sealed, factors.get(hidden[0]["id"])
    return trials


@app.default
def main(*, workers: int = 2) -> None:
    """Work out what is not known yet, and say how much a relief's speed costs."""
    known = read(RESULT) if RESULT.exists() else {}
    todo = {key: one for key, one in opposed_trials().items() if key not in known}
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        jobs = {pool.submit(told_of, *one): key for key, one in todo.items()}
        for job in as_completed(jobs):
            known[jobs[job]] = job.result()
            write(RESULT, known)
            print(jobs[job], known[jobs[job]], flush=True)
    for of in ("sparse", "dense"):
        own = [one for one in known.values() if one["kind"] == of and one["at_its_place"]]
        print(f"{of}: {len(own)} trials; nats in the median (least, most)")
        gains = [max(one["at_its_place"].values()) - one["at_its_place"]["1"] for one in own]
        more = sum(gain > 1.0 for gain in gains)
        print(f"  another speed of the relief gains {_spread(gains)}, more than 1 in {more}")
        losses = [one["at_its_place"]["1"] - one["in_its_diagnosis"] for one in own]
        print(f"  not knowing the place costs {_spread(losses)}")


def _spread(nats: list[float]) -> str:
    return f"{np.median(nats):.1f} ({min(nats):.1f} to {max(nats):.1f})"


if __name__ == "__main__":
    app()
