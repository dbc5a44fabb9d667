"""How far integrals over an avalanche's strengths are off, by the quadrature points that they get.

``python -m studies.thresholds.event_nodes``: Ryggfonn's 22 avalanches and a dense development trial, under
base laws of two strengths and robust errors, with terms of each of six mechanisms, each at a random place and
strength; against eight times the points of re-computed evidence. A few avalanches whose fronts are about to
stop are off by far more than all others, so quantiles stand beside the root mean square.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import NamedTuple

import cyclopts
import numpy as np
from numpy.typing import NDArray
from scipy.stats import multivariate_normal

from skred.campaign import find_campaign, read_campaign
from skred.diagnosis.compare.comparison import with_errors
from skred.diagnosis.detect.score_test import placed_mechanisms
from skred.diagnosis.evidence.coefficient import Base
from skred.diagnosis.evidence.conditional_map import EventLikelihood, event_modes
from skred.diagnosis.evidence.event_quadrature import FINE, SCREENING, USUAL, Budget, importance_nodes
from skred.diagnosis.evidence.extension import Extension
from skred.simulator.draw import draw_trial
from studies.files import RESULTS, write
from studies.thresholds.compared_again import base_on

FloatArray = NDArray[np.float64]
app = cyclopts.App(help=__doc__)
RESULT = RESULTS / "event_nodes.json"
BUDGETS = {"of screening": SCREENING, "usual": USUAL, "of re-computed evidence": FINE}
EXACT = FINE.times(8)
TERMS = 4
"""Of each mechanism."""
MECHANISMS = (
    "segment_friction",
    "obstacle",
    "velocity_weakening",
    "viscous_drag",
    "segment_drag",
    "entrainment",
)
SEED = 3


class Case(NamedTuple):
    """A base law with a term of some strength."""

    campaign: str
    base: Base
    extension: Extension
    strength: float

    def integrals(self, budget: Budget) -> FloatArray:
        """Log integral of each avalanche, (n_events,)."""
        base, population = self.base, self.base.population
        given = np.append(base.strengths, self.strength)
        likelihood = EventLikelihood(self.extension, base.rows, given)
        modes = event_modes(likelihood, base.fit.points, population)
        nodes = importance_nodes(likelihood, population, modes, budget)
        prior = multivariate_normal(population.mean[0], population.covariance[0])
        log_terms = nodes.log_weights + prior.logpdf(nodes.points[:, :, :-1])
        return np.asarray(np.logaddexp.reduce(log_terms, axis=1))


def cases() -> Iterator[Case]:
    """All of them."""
    rng = np.random.default_rng(SEED)
    ryggfonn = read_campaign(find_campaign("ryggfonn"))
    dense = draw_trial(1702, kind="dense", hidden="obstacle", base="voellmy").campaign
    for name, campaign, law in (
        ("Ryggfonn", ryggfonn, "pcm"),
        ("Ryggfonn", ryggfonn, "voellmy"),
        ("dense", dense, "voellmy"),
    ):
        fitted = base_on(campaign, law)
        assert fitted is not None
        base = with_errors(fitted, "robust")
        for mechanism in MECHANISMS:
            own = [one for one in placed_mechanisms(base.setting) if one.mechanism.id == mechanism]
            for term in rng.choice(np.array(own, dtype=object), TERMS) if own else ():
                strength = float(rng.uniform(0.05, 0.8) * term.scale)
                yield Case(f"{name}, {law}", base, base.extended(term.direction), strength)


@app.default
def main() -> None:
    """Measure."""
    known = [(one, one.integrals(EXACT)) for one in cases()]
    rows = []
    for campaign in dict.fromkeys(one.campaign for one, _ in known):
        for name, budget in BUDGETS.items():
            started = time.process_time()
            off = np.array(
                [one.integrals(budget) - exact for one, exact in known if one.campaign == campaign]
            )
            size = np.abs(off)
            rows.append(
                {
                    "campaign": campaign,
                    "budget": name,
                    "nodes": budget.total,
                    "integrals": size.size,
                    "root mean square": float(np.sqrt(np.mean(size**2))),
                    "nine in ten": float(np.quantile(size, 0.9)),
                    "97 in 100": float(np.quantile(size, 0.97)),
                    "median of the sum": float(np.median(np.abs(off.sum(axis=1)))),
                    "seconds": time.process_time() - started,
                }
            )
            print(rows[-1], flush=True)
    write(RESULT, {"rows": rows})


if __name__ == "__main__":
    app()
