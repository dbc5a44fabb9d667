"""Compare laws on one campaign: leave-one-event-out, information criteria, evidence, weights."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import arviz as az
import numpy as np

from skred.campaign import Status
from skred.inference.alpha_beta import ALPHA_SD_DEG, alpha_beta
from skred.inference.evidence import evidence
from skred.inference.intervals import INTERVAL_KIND, INTERVAL_PROBABILITY
from skred.inference.leave_one_out import ExactLoo, exact_leave_one_out
from skred.inference.problem import PooledProblem
from skred.inference.results import save
from skred.inference.sampling import SamplerSettings
from skred.inference.waic import waic
from skred.physics.law import Law
from skred.work.calibrate import Calibration, calibrate
from skred.work.output import write_json, write_text
from skred.work.statement import statement

EVIDENCE_SEEDS = 2
PRACTICAL = 4.0
"""A smaller difference in elpd is no practical difference."""
Tell = Callable[[str], None]


def compare(
    problem: PooledProblem,
    laws: Sequence[Law],
    settings: SamplerSettings,
    folder: Path,
    tell: Tell = lambda line: None,
) -> dict[str, Any]:
    """Calibrate and compare, writing each law's results as soon as they are there.

    Parameters
    ----------
    problem : PooledProblem
    laws : sequence of Law
    settings : SamplerSettings
    folder : Path
        Gets a folder for each law, ``compare.json``, figures and ``report.html``.
    tell : callable
        Told one line for each stage.

    Returns
    -------
    dict
        The content of ``compare.json``.
    """
    from skred.report.figures import save_comparison_figures, save_model_figures
    from skred.report.html import render_comparison

    started = time.monotonic()
    entries: list[dict[str, Any]] = []
    figures: dict[str, Path] = {}
    trees: dict[str, Any] = {}
    for law in laws:
        tell(f"{law.id}: sampling")
        calibration = calibrate(problem, law, settings)
        entry = calibration.entry()
        if calibration.gate.passed:
            tell(f"{law.id}: leave-one-event-out and evidence")
            entry |= _scores(calibration)
            trees[law.id] = calibration.tree
        else:
            tell(f"{law.id}: the gate failed: {'; '.join(calibration.gate.problems)}")
            entry |= dict.fromkeys(("loo", "waic", "exact", "difference", "evidence", "weight"))
        entries.append(entry)
        law_folder = folder / law.id
        law_folder.mkdir(exist_ok=True)
        save(calibration.tree, law_folder / "posterior.nc")
        drawn = save_model_figures(calibration.tree, law, problem, law_folder)
        figures |= {f"{law.id}/{figure.stem}": figure for figure in drawn}
    comparison = _document(problem, settings, calibration, rank(entries, trees))
    comparison["statement"] = statement(comparison)
    comparison["seconds"] = time.monotonic() - started
    tell("writing the report")
    figures |= save_comparison_figures(comparison, folder)
    write_json(folder / "compare.json", comparison)
    write_text(folder / "report.html", render_comparison(comparison, figures))
    return comparison


def _scores(calibration: Calibration) -> dict[str, Any]:
    """Everything a law's entry says of its predictions."""
    events = calibration.problem.campaign.event_ids
    seed = calibration.settings.seed
    loo = az.loo(calibration.tree, var_name="recordings", pointwise=True)
    information = waic(calibration.tree, variable="recordings")
    exact = exact_leave_one_out(calibration.model, calibration.step, events, seed)
    seeds = [10 * seed + k + 1 for k in range(EVIDENCE_SEEDS)]
    marginal = evidence(calibration.model, seeds)
    pareto_k = np.asarray(loo.pareto_k, dtype=float)
    return {
        "loo": {
            "elpd": float(loo.elpd),
            "se": float(loo.se),
            "p": float(loo.p),
            "pareto_k_max": float(pareto_k.max()),
            "n_bad": int((pareto_k > float(loo.good_k)).sum()),
            "pareto_k": pareto_k.tolist(),
        },
        "waic": {
            "elpd": float(information.elpd_waic),
            "se": float(information.se),
            "p": float(information.p_waic),
            "n_unreliable": int(information.n_unreliable),
        },
        "exact": _exact_entry(exact),
        "evidence": {
            "log_evidence": list(marginal.log_evidence),
            "mean": marginal.mean,
            "spread": marginal.spread,
            "seeds": seeds,
        },
    }


def _exact_entry(exact: ExactLoo) -> dict[str, Any]:
    return {
        "elpd": exact.elpd,
        "se": exact.se,
        "mcse": exact.mcse,
        "pointwise": exact.pointwise.tolist(),
        "failed_refits": list(exact.failed),
    }


def rank(entries: list[dict[str, Any]], trees: dict[str, Any]) -> list[dict[str, Any]]:
    """Entries, best first by exact elpd, with paired differences to the best and stacking weights.

    Entries whose gate failed come last and are not compared.
    """
    valid = sorted((e for e in entries if e["gate"]["passed"]), key=lambda e: -e["exact"]["elpd"])
    weights = _stacking([e["id"] for e in valid], trees)
    for entry in valid:
        pairs = np.subtract(entry["exact"]["pointwise"], valid[0]["exact"]["pointwise"])
        se = float(np.sqrt(len(pairs) * np.var(pairs, ddof=1)))
        difference = float(pairs.sum())
        entry["difference"] = {
            "elpd": difference,
            "se": se,
            "se_doubled": 2.0 * se,
            "practical": bool(abs(difference) >= PRACTICAL and abs(difference) > 2.0 * se),
        }
        entry["weight"] = weights[entry["id"]]
    return valid + [e for e in entries if not e["gate"]["passed"]]


def _stacking(ids: Sequence[str], trees: dict[str, Any]) -> dict[str, float]:
    """Weights that predict best together (Yao and others, 2018, doi 10.1214/17-BA1091)."""
    if len(ids) < 2:
        return dict.fromkeys(ids, 1.0)
    table = az.compare({law: trees[law] for law in ids}, method="stacking", var_name="recordings")
    return {law: float(table.loc[law, "weight"]) for law in ids}


def _document(
    problem: PooledProblem, settings: SamplerSettings, any_of_them: Calibration, models: list[dict[str, Any]]
) -> dict[str, Any]:
    campaign = problem.campaign
    return {
        "format": 1,
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
        "event_ids": list(campaign.event_ids),
        "models": models,
        "alpha_beta": alpha_beta_entry(problem),
    }


def alpha_beta_entry(problem: PooledProblem) -> dict[str, Any]:
    """The alpha-beta model's extreme runout beside the largest recorded one.

    It predicts where the extreme avalanche of a path stops, not the distribution of its runouts,
    so it has no place in a comparison by leave-one-event-out.
    """
    campaign, terrain = problem.campaign, problem.terrain
    runouts = [j for j, sensor in enumerate(campaign.sensors) if sensor.is_runout]
    middle = 0.5 * (terrain.edge_s_m[1:] + terrain.edge_s_m[:-1])
    slope = np.interp(campaign.track.s_m, middle, terrain.slope_rad)
    try:
        model = alpha_beta(campaign.track.x_m, campaign.track.z_m, slope)
    except ValueError as error:
        return {"reason": str(error)}
    zero = campaign.reference_s_m or 0.0
    entry = {
        "beta_deg": model.beta_deg,
        "alpha_deg": model.alpha_deg,
        "runout_m": model.runout_s_m(reference_s_m=zero),
        "runout_minus_1sd_m": model.runout_s_m(model.alpha_deg - ALPHA_SD_DEG, reference_s_m=zero),
        "note": "runouts relative to the campaign's reference" if zero else "runouts as arc length",
    }
    if runouts and np.isfinite(problem.values[:, runouts]).any():
        values = problem.values[:, runouts].max(axis=1, initial=-np.inf, where=problem.observed[:, runouts])
        largest = int(values.argmax())
        entry |= {
            "recorded_max_m": float(values[largest]) - zero,
            "recorded_max_event": campaign.event_ids[largest],
            "exceedance_of_recorded_max": model.exceedance_probability(float(values[largest])),
        }
    return entry
