"""Opened trials compared again by the present code: what it says of forces that are in no list.

``python -m studies.thresholds.compared_again [--batches SEED ...] [--hidden CLASS ...] [--workers 2]`` draws
trials of opened batches in which something was found again from their seeds and compares them. The leading
listed mechanism is added at its best strength, and the unlisted force fitted about it: each kind, its
amplitude, smoothness and place open. What its most probable profile gains, before any price of its freedom,
is about all that could tell a force that is in no list from the listed one that passes for it; beside it
stands the same for trials whose truth is listed. Results are kept trial by trial in
``results/compared_again.json``; the same command goes on with a run that was ended. Trials come in random
order, so a run that was ended is a sample of them.
"""

from __future__ import annotations

import itertools
import tempfile
from collections.abc import Collection, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import cyclopts
import numpy as np
from numpy.typing import NDArray

from skred.campaign import Campaign, read_campaign, write_campaign
from skred.diagnosis.augment.problem import as_diagnosed
from skred.diagnosis.compare.comparison import Comparison, compare
from skred.diagnosis.discrepancy.fit import fit_profile
from skred.diagnosis.discrepancy.profile import KINDS
from skred.diagnosis.effort import SAMPLING
from skred.diagnosis.evidence.coefficient import Base, fit_base
from skred.diagnosis.evidence.population_draws import population_draws, typical
from skred.diagnosis.evidence.prior_odds import NOTHING, POWER, UNLISTED, prior_odds, stated
from skred.inference.calibrate import calibrate_surely
from skred.inference.hierarchical.problem import HierarchicalProblem, hierarchical_problem
from skred.physics.laws import load_law
from skred.physics.mechanisms import mechanisms
from skred.prove.hashes import source_sha256
from skred.simulator.draw import draw_trial
from studies.files import RESULTS, read, write
from studies.proof.record import diagnosed, opened_batches, sealed_of

FloatArray = NDArray[np.float64]
CLASSES = ("listed", "masked", "two", "instrument", "unlisted")
app = cyclopts.App(help=__doc__)


def base_on(campaign: Campaign, law_id: str) -> Base | None:
    """A base law on a campaign, fitted as a diagnosis fits it; None where its gate fails."""
    found = base_and_draws(campaign, law_id)
    return None if found is None else found[0]


def base_and_draws(campaign: Campaign, law_id: str) -> tuple[Base, tuple[FloatArray, FloatArray]] | None:
    """And draws of its populations, means and factors."""
    law = load_law(law_id)
    problem = as_diagnosed(hierarchical_problem(campaign))
    calibration = calibrate_surely(problem, law, SAMPLING)
    if not calibration.gate.passed:
        return None
    assert isinstance(calibration.problem, HierarchicalProblem)
    draws = population_draws(calibration, 0)
    return fit_base(calibration.problem, law, typical(draws)), draws


def base_of(sealed: dict[str, Any]) -> Base | None:
    """The base law of a trial, fitted as a diagnosis fits it; None where its gate fails."""
    asked, truth = sealed["asked"], sealed["truth"]
    trial = draw_trial(asked["seed"], kind=asked["kind"], hidden=asked["hidden"])
    ids = [[one["id"] for one in of["mechanisms"]] for of in (trial.truth, truth)]
    if ids[0] != ids[1] or abs(trial.truth["snr"] - truth["snr"]) > 0.05:  # other machines round otherwise
        raise SystemExit(f"{asked}: the simulator does not draw what was sealed")
    campaign = trial.campaign
    with tempfile.TemporaryDirectory(prefix="again-") as scratch:
        # As a diagnosis reads it: files round what they hold.
        write_campaign(campaign, Path(scratch) / "campaign")
        campaign = read_campaign(Path(scratch) / "campaign")
    return base_on(campaign, truth["base_model"])


def _leading_name(compared: Comparison) -> str:
    """The most probable listed mechanism or fault."""
    shares = compared.probability
    return max((name for name in shares if name not in (NOTHING, UNLISTED)), key=shares.__getitem__)


def beyond(compared: Comparison, name: str) -> float:
    """What the unlisted force gains about a listed mechanism at its best strength, in nats, at most."""
    under_errors = compared.leading(name)
    best = under_errors.candidates[name].best
    top = int(np.argmax(best.log_evidence))
    about = replace(
        under_errors.base,
        fit=best.fits[top],
        directions=(*under_errors.base.directions, best.direction),
        strengths=np.append(under_errors.base.strengths, best.strengths[top]),
    )
    return max(fit_profile(about, kind).gain for kind in KINDS)


def look(sealed: dict[str, Any]) -> dict[str, Any]:
    """One trial."""
    truth = sealed["truth"]
    told = {
        "source_sha256": source_sha256(),
        "kind": truth["kind"],
        "hidden": truth["hidden"],
        "truth": [one["id"] for one in truth["mechanisms"]],
        "snr": truth["snr"],
    }
    try:
        base = base_of(sealed)
        if base is None:
            return told | {"failed": "gate"}
        compared = compare(base)
        name = _leading_name(compared)
        gain = beyond(compared, name)
    except np.linalg.LinAlgError as error:
        return told | {"failed": repr(error)}
    return told | {"leader": name, "log_bayes_factors": compared.log_factors, "gain_about_leader": gain}


def found_trials(batches: Sequence[int], hidden: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Opened trials in which something was found, whatever it was called: key and what was sealed."""
    trials = {}
    for batch in opened_batches():
        if batches and int(batch.name) not in batches:
            continue
        sealed = sealed_of(batch)
        for pair in diagnosed(batch):
            if pair.alarm and pair.hidden in hidden:
                trials[f"{batch.name}:{pair.trial}"] = sealed[pair.trial]
    return trials


@app.default
def main(
    *, batches: tuple[int, ...] = (), hidden: tuple[str, ...] = CLASSES, workers: int = 2, seed: int = 0
) -> None:
    """Comparison opened trials again.

    Parameters
    ----------
    batches
        Their seeds; by default all that are opened.
    hidden
        Classes of what they hide.
    workers
        Processes.
    seed
        Of the order.
    """
    path = RESULTS / "compared_again.json"
    found: dict[str, Any] = read(path) if path.exists() else {}
    trials = found_trials(batches, hidden)
    open_ones = [key for key in np.random.default_rng(seed).permutation(sorted(trials)) if key not in found]
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        at_work = {pool.submit(look, trials[key]): str(key) for key in open_ones}
        for done in as_completed(at_work):
            key = at_work[done]
            found[key] = done.result()
            write(path, dict(sorted(found.items())))
            print(key, found[key]["hidden"], found[key].get("leader"), flush=True)
    summarise(found.values())


def summarise(found: Collection[dict[str, Any]]) -> None:
    """What a free force gains about the leading listed mechanism, by what is hidden; and what it is given."""
    for hidden, kind in itertools.product(CLASSES, ("sparse", "dense")):
        own = [one for one in found if (one["hidden"], one["kind"]) == (hidden, kind) and "failed" not in one]
        if not own:
            continue
        gains = [one["gain_about_leader"] for one in own]
        unlisted = [stated_of(one["log_bayes_factors"])[UNLISTED] for one in own]
        print(
            f"{hidden}, {kind}: {len(own)} trials; a force gains about the leading listed mechanism: median"
            f" {np.median(gains):.1f} nats, less than 3 in {sum(gain < 3.0 for gain in gains)}; its own"
            f" probability is above one half in {sum(p > 0.5 for p in unlisted)}, on average"
            f" {np.mean(unlisted):.2f}"
        )


def stated_of(log_factors: Mapping[str, float], power: float = POWER) -> dict[str, float]:
    """Probabilities as they are stated of a comparison, or would be with another power."""
    compared = [mechanisms()[name] for name in log_factors if name in mechanisms()]
    return stated(log_factors, prior_odds(compared), power)


if __name__ == "__main__":
    app()
