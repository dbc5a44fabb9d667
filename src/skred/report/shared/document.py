"""Reading the comparison document: plain data in which anything may be null."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from skred.report.shared.numbers import is_number

Document = Mapping[str, Any]

PARETO_K_LIMIT = 0.7


def get(document: Any, *keys: str) -> Any:
    """Value at a path of keys; None where any part of it is absent or null."""
    for key in keys:
        document = document.get(key) if isinstance(document, Mapping) else None
    return document


def listed(document: Any, *keys: str) -> list[Any]:
    """List at a path of keys; empty where it is absent or null."""
    value = get(document, *keys)
    return list(value) if isinstance(value, Sequence) and not isinstance(value, str) else []


def models(comparison: Document) -> list[Document]:
    """All laws, in the document's order: best first."""
    return listed(comparison, "models")


def passed(model: Document) -> bool:
    """Whether the law's chains can be trusted."""
    return get(model, "gate", "passed") is True


def ranked(comparison: Document) -> list[Document]:
    """The laws that are compared: those whose chains converged."""
    return [model for model in models(comparison) if passed(model)]


def failed(comparison: Document) -> list[Document]:
    """The laws whose chains did not converge."""
    return [model for model in models(comparison) if not passed(model)]


def is_hierarchical(comparison: Document) -> bool:
    """Whether every avalanche has its own strengths; older documents do not say, and are pooled."""
    return get(comparison, "likelihood") == "hierarchical"


def side_by_side(comparison: Document) -> list[Document]:
    """For each law its entry here and in the pooled calibration: ``id``, ``hierarchical``, ``pooled``."""
    here = {str(get(model, "id")): model for model in models(comparison)}
    pooled = {str(get(model, "id")): model for model in listed(comparison, "pooled", "models")}
    return [
        {"id": law, "hierarchical": here.get(law), "pooled": pooled.get(law)} for law in {**here, **pooled}
    ]


def pareto_k_limit(comparison: Document) -> float:
    """Largest Pareto k at which importance sampling can be trusted.

    min(1 - 1 / log10(number of draws), 0.7); Vehtari, Simpson, Gelman, Yao and Gabry (2024), JMLR 25(72).
    """
    draws, chains = (get(comparison, "settings", key) for key in ("draws", "chains"))
    if not (is_number(draws) and is_number(chains) and draws * chains > 10):
        return PARETO_K_LIMIT
    from math import log10

    return min(1.0 - 1.0 / log10(draws * chains), PARETO_K_LIMIT)
