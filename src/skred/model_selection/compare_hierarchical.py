"""Compare laws by the hierarchical likelihood, beside the pooled comparison."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from skred.inference.calibrate import calibrate
from skred.inference.error_model import ERROR_MODELS
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.inference.paired import best_first, paired_difference
from skred.inference.pooled.problem import PooledProblem
from skred.inference.sampling import SamplerSettings
from skred.model_selection.compare import Tell, score, scores, write_comparison
from skred.model_selection.statement import changes
from skred.physics.law import Law

_ERROR_MODEL_SEEDS, _ERROR_MODEL_SMC_DRAWS = 1, 500
_SHOWN = (
    "id", "title", "gate", "parameters", "fit", "fits", "fit_level",
    "loo", "waic", "exact", "difference", "evidence", "weight",
)  # fmt: skip


def compare_hierarchical(
    problem: HierarchicalProblem,
    pooled: PooledProblem | str,
    laws: Sequence[Law],
    settings: SamplerSettings,
    folder: Path,
    tell: Tell = lambda line: None,
    *,
    exact: bool = False,
) -> dict[str, Any]:
    """Calibrate and compare laws by both likelihoods, and error models under the best law.

    Parameters
    ----------
    problem : HierarchicalProblem
    pooled : PooledProblem or str
        The pooled problem of the same campaign, or why there is none.
    laws : sequence of Law
    settings : SamplerSettings
    folder : Path
        Gets a folder for each law, ``pooled`` with the same, and ``compare.json``: report and figures are
        made from these.
    tell : callable
        Takes one line for each stage.
    exact : bool
        Refit without every event in turn, not only where importance sampling is unreliable.

    Returns
    -------
    dict
        The content of ``compare.json``.
    """
    started = time.monotonic()
    document = score(problem, laws, settings, folder, tell, exact=exact)
    document["limits"]["integration"] = problem.integration_limit
    document["pooled"] = _pooled(pooled, laws, settings, folder / "pooled", tell)
    document["changes"] = changes(document)
    best = document["models"][0]
    document["error_models"] = None
    if best["gate"]["passed"]:
        law = next(law for law in laws if law.id == best["id"])
        document["error_models"] = _error_models(problem, law, best, settings, tell)
    return write_comparison(document, folder, started)


def _pooled(
    pooled: PooledProblem | str, laws: Sequence[Law], settings: SamplerSettings, folder: Path, tell: Tell
) -> dict[str, Any]:
    if isinstance(pooled, str):
        return {"reason": pooled, "models": []}
    entries = score(pooled, laws, settings, folder, tell, exact=True)["models"]
    return {"reason": None, "models": [{key: entry[key] for key in _SHOWN} for entry in entries]}


def _error_models(
    problem: HierarchicalProblem, law: Law, best: dict[str, Any], settings: SamplerSettings, tell: Tell
) -> list[dict[str, Any]]:
    """Each error model under one law, best first, with paired differences to the best."""
    entries = []
    for model in ERROR_MODELS.values():
        if model.id == problem.error_model.id:
            entry = best
        else:
            tell(f"{law.id}: errors {model.title}")
            other = HierarchicalProblem(problem.campaign, problem.terrain, model, problem.place_sd_m)
            calibration = calibrate(other, law, settings)
            entry = {"gate": calibration.gate.as_dict()}
            if calibration.gate.passed:
                seeds, draws = _ERROR_MODEL_SEEDS, _ERROR_MODEL_SMC_DRAWS
                entry |= scores(calibration, exact=False, evidence_seeds=seeds, evidence_draws=draws)
        entries.append({"id": model.id, "title": model.title, **_error_model_scores(entry)})
    valid, failed = best_first(entries, lambda entry: entry["elpd"])
    for entry in valid:
        difference = paired_difference(entry["pointwise"], valid[0]["pointwise"])
        entry["difference"] = {key: getattr(difference, key) for key in ("elpd", "se", "practical")}
    return valid + failed


def _error_model_scores(entry: dict[str, Any]) -> dict[str, Any]:
    if not entry["gate"]["passed"]:
        nothing = dict.fromkeys(("elpd", "se", "pointwise", "difference", "evidence", "n_refitted"))
        return {"gate": entry["gate"], **nothing}
    exact, evidence = entry["exact"], entry["evidence"]
    return {
        "gate": entry["gate"],
        "elpd": exact["elpd"],
        "se": exact["se"],
        "pointwise": exact["pointwise"],
        "evidence": {"mean": evidence["mean"], "spread": evidence["spread"]},
        "n_refitted": len(exact["refitted"]),
    }
