"""How far log scores of held-out avalanches are off, by the nodes that each draw's strengths get.

``python -m studies.thresholds.unseen_nodes``: Ryggfonn under PCM with the most probable force profile,
each avalanche scored by 200 draws, with three sets of random shifts of the nodes; against sixteen times the
nodes. Beside it how much other draws change the scores.
"""

from __future__ import annotations

import time
from typing import Any

import cyclopts
import numpy as np

from skred.campaign import find_campaign, read_campaign
from skred.diagnosis.compare.comparison import compare
from skred.diagnosis.discrepancy.profile import Profile, most_probable
from skred.diagnosis.evidence.coefficient import Base
from skred.diagnosis.evidence.event_quadrature import Budget
from skred.diagnosis.evidence.prior_odds import UNLISTED
from skred.diagnosis.predict.profile_law import with_profile
from skred.diagnosis.predict.unseen import NODES, log_densities
from studies.files import RESULTS, write
from studies.thresholds.compared_again import base_on

app = cyclopts.App(help=__doc__)
RESULT = RESULTS / "unseen_nodes.json"
BUDGETS = {
    "used": NODES,
    "twice": NODES.times(2),
    "with adapted ones": Budget(64, 32, 64, 1.5, 1.8),
    "eight times those": Budget(512, 256, 512, 1.5, 1.8),
}
EXACT, SHIFTS = NODES.times(16), 3


def score(base: Base, event: int, added: Any, budget: Budget, seed: int) -> float:
    """Log score of an avalanche."""
    extension, draws = added
    rows = base.rows.take(np.array([event]))
    densities = log_densities(extension, rows, draws, seed, budget)[:, 0]
    return float(np.logaddexp.reduce(densities) - np.log(len(densities)))


def measured(base: Base, profile: Profile) -> list[dict[str, Any]]:
    """By budget: what scores are off by, and seconds."""
    events = range(len(base.rows.event))
    drawn = [with_profile(base, profile, np.random.default_rng(event)) for event in events]
    exact = np.array([score(base, event, drawn[event], EXACT, 0) for event in events])
    rows = []
    for name, budget in BUDGETS.items():
        started = time.perf_counter()
        found = [[score(base, k, drawn[k], budget, seed) for k in events] for seed in range(SHIFTS)]
        rows.append(_row(name, np.array(found) - exact, budget.total))
        rows[-1]["seconds"] = (time.perf_counter() - started) / SHIFTS
    others = [with_profile(base, profile, np.random.default_rng(1000 + event)) for event in events]
    again = np.array([score(base, k, others[k], EXACT, 0) for k in events])
    return [*rows, _row("other draws", again - exact, EXACT.total)]


def _row(name: str, errors: Any, nodes: int) -> dict[str, Any]:
    """Errors in nats: of an avalanche, and of the sum over all."""
    row = {
        "nodes": name,
        "of a draw": nodes,
        "root mean square": float(np.sqrt(np.mean(errors**2))),
        "sum": float(np.atleast_2d(errors).sum(axis=1).mean()),
    }
    print(row)
    return row


@app.default
def main() -> None:
    """Measure."""
    base = base_on(read_campaign(find_campaign("ryggfonn")), "pcm")
    assert base is not None
    under_errors = compare(base).leading(UNLISTED)
    found = measured(under_errors.base, most_probable(under_errors.profiles))
    write(RESULT, {"rows": found})


if __name__ == "__main__":
    app()
