"""Forces that are in no list: what recordings say beyond the listed mechanism that passes for them.

``python benchmarks/beyond_listed.py [--batches SEED ...] [--snr 5.5]`` draws the unlisted trials of opened
batches again from their seeds, races them, lets the leading listed mechanism in at its best strength and fits
the unlisted force about it: each kind, its amplitude, smoothness and place open. What that gains, before any
price of its freedom, is all that could tell the truth from the listed name. Results are kept trial by trial
in ``results/beyond_listed.json``; the same command goes on with a run that was ended.
"""

from __future__ import annotations

import json
import math
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import cyclopts
import numpy as np

from skred.campaign import read_campaign, write_campaign
from skred.cli_options import DIAGNOSIS_SAMPLING
from skred.diagnosis.augmented import CLAIM_LIMIT
from skred.diagnosis.curves import Base, fit_base
from skred.diagnosis.diagnose import population_draws, typical
from skred.diagnosis.odds import NOTHING, UNLISTED
from skred.diagnosis.race import Race, race
from skred.diagnosis.unlisted import KINDS, fit_profile
from skred.inference.hierarchical import HierarchicalProblem, hierarchical_problem
from skred.laws import load_law
from skred.trials.draw import draw_trial
from skred.work.calibrate import calibrate_surely
from skred.work.output import write_json

RESULTS = Path(__file__).resolve().parent / "results"
app = cyclopts.App(help=__doc__)


def base_of(asked: dict[str, Any], law_id: str) -> Base:
    """The base law of a trial, fitted as a diagnosis fits it."""
    campaign = draw_trial(asked["seed"], kind=asked["kind"], hidden=asked["hidden"]).campaign
    with tempfile.TemporaryDirectory(prefix="beyond-") as scratch:
        # As a diagnosis reads it: files round what they hold.
        write_campaign(campaign, Path(scratch) / "campaign")
        campaign = read_campaign(Path(scratch) / "campaign")
    law = load_law(law_id)
    problem = replace(hierarchical_problem(campaign), integration_limit=CLAIM_LIMIT)
    calibration = calibrate_surely(problem, law, DIAGNOSIS_SAMPLING.settings("hierarchical"))
    assert isinstance(calibration.problem, HierarchicalProblem)
    return fit_base(calibration.problem, law, typical(population_draws(calibration, 120, 0)))


def leader(raced: Race) -> str:
    """The listed candidate that is most probable."""
    listed = {name: p for name, p in raced.probability.items() if name not in (NOTHING, UNLISTED)}
    return max(listed, key=lambda name: listed[name])


def beyond(raced: Race, name: str) -> float:
    """What the unlisted force gains about a listed mechanism at its best strength, in nats, at most."""
    heat = raced.leading(name)
    best = heat.entrants[name].best
    top = int(np.argmax(best.log_evidence))
    about = replace(
        heat.base,
        fit=best.fits[top],
        directions=(*heat.base.directions, best.direction),
        strengths=np.append(heat.base.strengths, best.strengths[top]),
    )
    return max(fit_profile(about, kind).gain for kind in KINDS)


def look(sealed: dict[str, Any]) -> dict[str, Any]:
    """One trial."""
    truth = sealed["truth"]
    raced = race(base_of(sealed["asked"], truth["base_model"]))
    name, factors = leader(raced), raced.log_factors
    return {
        "kind": truth["kind"],
        "hidden": truth["mechanisms"][0]["id"],
        "snr": truth["snr"],
        "leader": name,
        "log_bayes_factor": factors[name],
        "log_bayes_factor_unlisted": factors[UNLISTED],
        "probability_unlisted": raced.probability[UNLISTED],
        "gain_about_leader": beyond(raced, name),
    }


@app.default
def main(*, batches: tuple[int, ...] = (), snr: float = 5.5) -> None:
    """Look at the unlisted trials of opened batches.

    Parameters
    ----------
    batches
        Their seeds; by default all that are opened.
    snr
        Least signal-to-noise.
    """
    path = RESULTS / "beyond_listed.json"
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    for file in sorted((RESULTS / "proof").glob("*/sealed.json")):
        if batches and int(file.parent.name) not in batches:
            continue
        for name, sealed in json.loads(file.read_text(encoding="utf-8")).items():
            key, truth = f"{file.parent.name}:{name}", sealed["truth"]
            if truth["hidden"] == "unlisted" and truth["snr"] >= snr and key not in found:
                found[key] = look(sealed)
                write_json(path, found)
                print(key, found[key], flush=True)
    for kind in ("sparse", "dense"):
        rows = [one for one in found.values() if one["kind"] == kind]
        gains = sorted(one["gain_about_leader"] for one in rows)
        if rows:
            right = sum(one["probability_unlisted"] > 0.5 for one in rows)
            mean = math.fsum(one["probability_unlisted"] for one in rows) / len(rows)
            print(
                f"{kind}: {len(rows)} trials; unlisted more probable than all else in {right}, its mean"
                f" probability {mean:.2f}; gained about the leading listed one: median"
                f" {gains[len(gains) // 2]:.1f} nats, below 3 in {sum(gain < 3.0 for gain in gains)}"
            )


if __name__ == "__main__":
    app()
