"""Nodes on a line beside importance nodes: what the comparison's evidences are wrong by, and what that costs.

``python -m studies.thresholds.line_nodes`` keeps one in eight of the curves of Ryggfonn's comparison, under
each candidate error model, and does the integration at each of its strengths again by both rules with the
comparison's budgets, and with nodes on a line sixteen times as close, which stand for exact. Importance
nodes, as many as a minute or so allows, are the second route to those.
"""

from __future__ import annotations

import time
from typing import Any, NamedTuple

import cyclopts
import numpy as np
from threadpoolctl import threadpool_limits

from skred.campaign import find_campaign, read_campaign
from skred.diagnosis.compare.comparison import Comparison, compare
from skred.diagnosis.evidence.coefficient import Base, Curve
from skred.diagnosis.evidence.conditional_map import (
    EventLikelihood,
    Modes,
    Population,
    Rows,
    event_modes,
)
from skred.diagnosis.evidence.event_quadrature import (
    FINE,
    FIRST,
    SCREENING,
    USUAL,
    Budget,
    importance_nodes,
    on_a_line,
)
from skred.diagnosis.evidence.extension import extended
from skred.diagnosis.evidence.marginal import coordinates, evidence, population_at
from skred.inference.hierarchical.surface import Nodes
from studies.files import RESULTS, write
from studies.thresholds.compared_again import base_on

app = cyclopts.App(help=__doc__)
RESULT = RESULTS / "line_nodes.json"
LAWS = ("coulomb", "constant")
BUDGETS = {"first round": FIRST, "screening": SCREENING, "usual": USUAL, "fine": FINE}
EXACT, MANY = USUAL.times(256), USUAL.times(32)
KEPT = 0.125
"""Share of the comparison's curves that are computed again."""
MOST = 40
QUANTILES = {"median": 0.5, "nine in ten": 0.9, "97 in 100": 0.97}
RULES: dict[str, Any] = {"line": on_a_line, "importance": importance_nodes}


class Integration(NamedTuple):
    """Events integrated out at each strength of a curve, one group of rows for each."""

    likelihood: EventLikelihood
    population: Population
    modes: Modes
    reference: Population


def integrations(comparison: Comparison) -> list[Integration]:
    """Those of one in eight curves, screened or computed again, by all error models."""
    rng, kept = np.random.default_rng(0), list[Integration]()
    for under_errors in comparison.under_each:
        for curve in (one for candidate in under_errors.candidates.values() for one in candidate.curves):
            if rng.random() < KEPT:
                kept.append(integration_of(under_errors.base, curve))
    return kept


def integration_of(base: Base, curve: Curve) -> Integration:
    """At all strengths of a curve, about the populations and events' modes that were found for them."""
    extension = extended(base.problem, base.law, (*base.directions, curve.direction))
    n = len(curve.strengths)
    given = np.column_stack([np.tile(base.strengths, (n, 1)), curve.strengths])
    likelihood = EventLikelihood(extension, base.rows, np.empty(0)).in_groups(given)
    population = population_at(np.stack([fit.found.psi for fit in curve.fits]), len(base.law.mechanisms))
    modes = event_modes(likelihood, np.concatenate([fit.points for fit in curve.fits]), population)
    return Integration(likelihood, population, modes, base.population)


def evidences(rule: str, budget: Budget, one: Integration, log_scale: Any) -> tuple[Any, int, float]:
    """Log evidence of each group of rows; nodes of an event; seconds of a processor."""
    rows, started = one.likelihood.rows, time.process_time()
    spread = RULES[rule](one.likelihood, one.population, one.modes, budget, one.reference)
    seconds = time.process_time() - started
    found = [
        evidence(nodes_of(spread.nodes, rows, k), log_scale, coordinates(population)).log_evidence
        for k, population in enumerate(one.population.groups)
    ]
    return np.array(found), spread.points.shape[1], seconds


def nodes_of(nodes: Nodes, rows: Rows, group: int) -> Nodes:
    """Nodes of one group of rows."""
    n_events = len(rows.event) // rows.n_groups
    own = slice(group * n_events, (group + 1) * n_events)
    first = nodes.first[own.start : own.stop + 1]
    inside = slice(first[0], first[-1])
    points = np.ascontiguousarray(nodes.points[:, inside])
    return Nodes(first - first[0], points, nodes.log_weights[inside], nodes.log_widths[inside])


def measured(law_id: str) -> dict[str, Any]:
    """By rule and budget: how far the evidence's differences between strengths are off [nats], quantiles.

    Not the largest: at strengths that are hopeless by thousands of nats no rule finds what is left.
    """
    base = base_on(read_campaign(find_campaign("ryggfonn")), law_id)
    assert base is not None
    with threadpool_limits(1, user_api="blas"):
        every = integrations(compare(base))
    chosen = [every[k] for k in np.random.default_rng(1).permutation(len(every))[:MOST]]
    exact = [evidences("line", EXACT, one, base.log_scale)[0] for one in chosen]
    cases = {(rule, name): budget for rule in RULES for name, budget in BUDGETS.items()}
    cases["importance", "many"] = MANY
    rows = []
    for (rule, name), budget in cases.items():
        found = [evidences(rule, budget, one, base.log_scale) for one in chosen]
        errors = [one[0] - true for one, true in zip(found, exact, strict=True)]
        between = np.abs(np.concatenate([one - np.median(one) for one in errors]))
        row = {"rule": rule, "budget": name, "nodes": found[0][1], "seconds": sum(one[2] for one in found)}
        row |= {name: float(np.quantile(between, q)) for name, q in QUANTILES.items()}
        rows.append(row)
        print(law_id, row)
    return {"base_model": law_id, "integrations": len(chosen), "of": len(every), "rows": rows}


@app.default
def main() -> None:
    """Measure."""
    found = [measured(law_id) for law_id in LAWS]
    write(RESULT, {"laws": found})


if __name__ == "__main__":
    app()
