"""Nodes on a line beside importance nodes: what the comparison's evidences are wrong by, and what that costs.

``python -m studies.thresholds.line_nodes`` keeps one in eight of the integrations of Ryggfonn's
comparison, under each candidate error model, and does each again by both rules with the comparison's
budgets, and with nodes on a line sixteen times as close, which stand for exact. Importance nodes, as many as
a minute or so allows, are the second route to those.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

import cyclopts
import numpy as np
from threadpoolctl import threadpool_limits

from skred.campaign import find_campaign, read_campaign
from skred.diagnosis.compare.comparison import compare
from skred.diagnosis.evidence import refit as curves
from skred.diagnosis.evidence.conditional_map import Rows
from skred.diagnosis.evidence.event_quadrature import (
    FINE,
    FIRST,
    FRONTS,
    USUAL,
    Budget,
    event_nodes,
    importance_nodes,
    on_a_line,
)
from skred.diagnosis.evidence.marginal import coordinates, evidence
from skred.inference.hierarchical.surface import Nodes
from studies.files import RESULTS, write
from studies.thresholds.compared_again import base_on

app = cyclopts.App(help=__doc__)
RESULT = RESULTS / "line_nodes.json"
LAWS = ("coulomb", "constant")
BUDGETS = {"first round": FIRST, "first look": FRONTS, "usual": USUAL, "fine": FINE}
EXACT, MANY = USUAL.times(256), USUAL.times(32)
KEPT = 0.125
"""Share of the comparison's integrations that are done again."""
MOST = 40
QUANTILES = {"median": 0.5, "nine in ten": 0.9, "97 in 100": 0.97}
RULES: dict[str, Any] = {"line": on_a_line, "importance": importance_nodes}


@contextmanager
def watched(calls: list[tuple[Any, ...]]) -> Iterator[None]:
    """Keep some of the integrations by fronts that refits ask for."""
    rng = np.random.default_rng(0)

    def watch(*given: Any, **more: Any) -> Any:
        if given[3] in (USUAL, FRONTS) and rng.random() < KEPT:
            calls.append((*given[:3], given[4]))
        return event_nodes(*given, **more)

    with patch.object(curves, "event_nodes", watch):
        yield


def evidences(rule: str, budget: Budget, call: tuple[Any, ...], log_scale: Any) -> tuple[Any, int, float]:
    """Log evidence of each group of rows; nodes of an event; seconds."""
    *given, reference = call
    rows, population = given[0].rows, given[1]
    started = time.perf_counter()
    spread = RULES[rule](*given, budget, reference)
    seconds = time.perf_counter() - started
    found = [
        evidence(nodes_of(spread.nodes, rows, k), log_scale, coordinates(population, k)).log_evidence
        for k in range(rows.n_groups)
    ]
    return np.array(found), spread.points.shape[1], seconds


def nodes_of(nodes: Nodes, rows: Rows, group: int) -> Nodes:
    """Nodes of one group of rows."""
    n_events = len(rows.event) // rows.n_groups
    first = nodes.first[group * n_events : (group + 1) * n_events + 1]
    inside = slice(first[0], first[-1])
    return Nodes(first - first[0], np.ascontiguousarray(nodes.points[:, inside]), nodes.log_weights[inside])


def measured(law_id: str) -> dict[str, Any]:
    """By rule and budget: how far the evidence's differences between strengths are off [nats], quantiles.

    Not the largest: at strengths that are hopeless by thousands of nats no rule finds what is left.
    """
    base, calls = base_on(read_campaign(find_campaign("ryggfonn")), law_id), list[tuple[Any, ...]]()
    assert base is not None
    with watched(calls), threadpool_limits(1, user_api="blas"):
        compare(base)
    chosen = np.random.default_rng(1).permutation(len(calls))[:MOST]
    exact = [evidences("line", EXACT, calls[k], base.log_scale)[0] for k in chosen]
    cases = {(rule, name): budget for rule in RULES for name, budget in BUDGETS.items()}
    cases["importance", "many"] = MANY
    rows = []
    for (rule, name), budget in cases.items():
        found = [evidences(rule, budget, calls[k], base.log_scale) for k in chosen]
        errors = [one[0] - true for one, true in zip(found, exact, strict=True)]
        between = np.abs(np.concatenate([one - np.median(one) for one in errors]))
        row = {"rule": rule, "budget": name, "nodes": found[0][1], "seconds": sum(one[2] for one in found)}
        row |= {name: float(np.quantile(between, q)) for name, q in QUANTILES.items()}
        rows.append(row)
        print(law_id, row)
    return {"base_model": law_id, "integrations": len(chosen), "of": len(calls), "rows": rows}


@app.default
def main() -> None:
    """Measure."""
    found = [measured(law_id) for law_id in LAWS]
    write(RESULT, {"laws": found})


if __name__ == "__main__":
    app()
