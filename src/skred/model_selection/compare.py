"""Compare laws on one campaign: leave-one-event-out, WAIC, evidence, stacking weights."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import arviz_stats as az
import numpy as np
from numpy.typing import NDArray

from skred.campaign import Status
from skred.inference.along_track import with_along_track
from skred.inference.calibrate import Calibration, calibrate, posterior_of
from skred.inference.evidence import SMC_DRAWS, evidence
from skred.inference.gate import ESS_LIMIT, R_HAT_LIMIT
from skred.inference.intervals import INTERVAL_KIND, INTERVAL_PROBABILITY, PRACTICAL_DIFFERENCE
from skred.inference.leave_one_out import ExactLoo, exact_leave_one_out, large_k_shown_elsewhere
from skred.inference.paired import best_first, paired_difference, sum_se
from skred.inference.pooled.problem import PooledProblem
from skred.inference.problem import Problem
from skred.inference.results import save
from skred.inference.sampling import SamplerSettings
from skred.inference.waic import waic
from skred.model_selection.alpha_beta_entry import alpha_beta_entry
from skred.model_selection.loo_pit import loo_pit
from skred.model_selection.ranking import ranking
from skred.model_selection.statement import statement
from skred.output import write_json
from skred.physics.law import Law

EVIDENCE_SEEDS = 2
Tell = Callable[[str], None]


def compare(
    problem: PooledProblem,
    laws: Sequence[Law],
    settings: SamplerSettings,
    folder: Path,
    tell: Tell = lambda line: None,
) -> dict[str, Any]:
    """Calibrate and compare laws by the pooled likelihood; each law's results are written at once.

    Parameters
    ----------
    problem : PooledProblem
    laws : sequence of Law
    settings : SamplerSettings
    folder : Path
        Gets a folder for each law, and ``compare.json``: report and figures are made from these.
    tell : callable
        Takes one line for each stage.

    Returns
    -------
    dict
        The content of ``compare.json``.
    """
    started = time.monotonic()
    document = score(problem, laws, settings, folder, tell, exact=True)
    return write_comparison(document, folder, started)


def score(
    problem: Problem,
    laws: Sequence[Law],
    settings: SamplerSettings,
    folder: Path,
    tell: Tell,
    *,
    exact: bool,
) -> dict[str, Any]:
    """Calibrate laws and score their predictions; with `exact` all events are left out by refits.

    Returns
    -------
    dict
        As in ``compare.json``.
    """
    entries: list[dict[str, Any]] = []
    trees: dict[str, Any] = {}
    for law in laws:
        tell(f"{law.id}: sampling ({problem.likelihood})")
        calibration = calibrate(problem, law, settings)
        entry = calibration.entry()
        if calibration.gate.passed:
            tell(f"{law.id}: leave-one-event-out and evidence")
            entry |= scores(calibration, exact=exact)
            trees[law.id] = calibration.tree
        else:
            tell(f"{law.id}: the chains did not converge: {'; '.join(calibration.gate.problems)}")
            entry |= dict.fromkeys(("loo", "waic", "exact", "difference", "evidence", "weight"))
        entries.append(entry)
        law_folder = folder / law.id
        law_folder.mkdir(exist_ok=True, parents=True)
        save(with_along_track(calibration.whole_tree, law, problem), law_folder / "posterior.nc")
    return _document(problem, settings, calibration, rank(entries, trees))


def write_comparison(comparison: dict[str, Any], folder: Path, started: float) -> dict[str, Any]:
    """Say what came out and what would change it, and write ``compare.json``; returns the document."""
    changed = [note for model in comparison["models"] if (note := model.get("prior_note"))]
    comparison["statement"] = [*changed, *statement(comparison)]
    valid = [model for model in comparison["models"] if model["gate"]["passed"]]
    comparison["ranking"] = ranking(valid, comparison["event_ids"])
    comparison["seconds"] = time.monotonic() - started
    write_json(folder / "compare.json", comparison)
    return comparison


def scores(
    calibration: Calibration,
    *,
    exact: bool,
    evidence_seeds: int = EVIDENCE_SEEDS,
    evidence_draws: int = SMC_DRAWS,
) -> dict[str, Any]:
    """Scores of a law's predictions.

    Events are left out by refits where importance sampling is unreliable; with `exact` all are.
    """
    events = calibration.problem.campaign.event_ids
    seed = calibration.settings.seed
    with large_k_shown_elsewhere():
        loo = az.loo(calibration.tree, var_name="recordings", pointwise=True)
    information = waic(calibration.tree, variable="recordings")
    seeds = [10 * seed + k + 1 for k in range(evidence_seeds)]
    marginal = evidence(calibration.model, seeds, evidence_draws)
    pareto_k = np.asarray(loo.pareto_k, dtype=float)
    unreliable = np.flatnonzero(~(pareto_k <= float(loo.good_k)))
    which = list(range(len(events))) if exact else unreliable.tolist()
    model, step, near = calibration.model, calibration.step, posterior_of(calibration)
    refits = exact_leave_one_out(model, step, events, seed, which, near) if which else None
    return {
        "loo": {
            "elpd": float(loo.elpd),
            "se": float(loo.se),
            "p": float(loo.p),
            "pareto_k_max": float(pareto_k.max()),
            "n_bad": len(unreliable),
            "pareto_k": pareto_k.tolist(),
            "pit": loo_pit(calibration.tree, loo.log_weights),
        },
        "waic": {
            "elpd": float(information.elpd_waic),
            "se": float(information.se),
            "p": float(information.p_waic),
            "n_unreliable": int(information.n_unreliable),
        },
        "exact": leave_one_out_entry(np.asarray(loo.elpd_i, dtype=float), refits, which, events),
        "evidence": {
            "log_evidence": list(marginal.log_evidence),
            "mean": marginal.mean,
            "spread": marginal.spread,
            "seeds": seeds,
        },
    }


def leave_one_out_entry(
    pointwise: NDArray[np.float64], refits: ExactLoo | None, which: Sequence[int], events: Sequence[str]
) -> dict[str, Any]:
    """Leave-one-event-out: exact where an event was refitted, by importance sampling elsewhere.

    Parameters
    ----------
    pointwise : (n_events,) array
        Expected log predictive density of each event by importance sampling.
    refits : ExactLoo or None
        Of the events that were left out; None if none was.
    which : sequence of int
        Numbers of those.
    events : sequence of str
        Ids of all.
    """
    pointwise = pointwise.copy()
    if refits is not None:
        pointwise[list(which)] = refits.pointwise
    return {
        "elpd": float(pointwise.sum()),
        "se": sum_se(pointwise),
        "mcse": refits.mcse if refits is not None else 0.0,
        "pointwise": pointwise.tolist(),
        "refitted": [events[k] for k in which],
        "failed_refits": list(refits.failed) if refits is not None else [],
    }


def rank(entries: list[dict[str, Any]], trees: dict[str, Any]) -> list[dict[str, Any]]:
    """Entries, best first by exact elpd, with paired differences to the best and stacking weights.

    Entries whose chains did not converge come last and are not compared.
    """
    valid, failed = best_first(entries, lambda entry: entry["exact"]["elpd"])
    weights = _stacking([e["id"] for e in valid], trees)
    for entry in valid:
        difference = paired_difference(entry["exact"]["pointwise"], valid[0]["exact"]["pointwise"])
        entry["difference"] = difference._asdict()
        entry["weight"] = weights[entry["id"]]
    return valid + failed


def _stacking(ids: Sequence[str], trees: dict[str, Any]) -> dict[str, float]:
    """Weights that predict best together (Yao and others, 2018, doi 10.1214/17-BA1091)."""
    if len(ids) < 2:
        return dict.fromkeys(ids, 1.0)
    with large_k_shown_elsewhere():
        table = az.compare({law: trees[law] for law in ids}, method="stacking", var_name="recordings")
    return {law: float(table.loc[law, "weight"]) for law in ids}


def _document(
    problem: Problem, settings: SamplerSettings, any_of_them: Calibration, models: list[dict[str, Any]]
) -> dict[str, Any]:
    campaign = problem.campaign
    return {
        "format": 1,
        "likelihood": problem.likelihood,
        "campaign": {
            "name": campaign.name,
            "description": campaign.description,
            "source": campaign.source,
            "fingerprint": campaign.fingerprint(),
            "n_events": campaign.n_events,
            "n_sensors": campaign.n_sensors,
            "reference_s_m": campaign.reference_s_m,
            "readings": {status.name.lower(): int((campaign.status == status).sum()) for status in Status},
        },
        "settings": {
            **settings.as_dict(),
            "smoothing_m": problem.terrain.smoothing_m,
            "cell_m": float(np.diff(problem.terrain.edge_s_m).max()),
        },
        "versions": json.loads(any_of_them.tree.attrs["versions"]),
        "interval": {"kind": INTERVAL_KIND, "probability": INTERVAL_PROBABILITY},
        "limits": {"practical_difference": PRACTICAL_DIFFERENCE, "r_hat": R_HAT_LIMIT, "ess": ESS_LIMIT},
        "event_ids": list(campaign.event_ids),
        "models": models,
        "alpha_beta": alpha_beta_entry(problem),
    }
