"""How far integrals over an avalanche's strengths are off, by the nodes that they get.

``python -m studies.thresholds.event_nodes``: Ryggfonn's 22 avalanches and a dense development trial, under
base laws of two strengths and robust errors, each with one term of each of six mechanisms, at a random place
and four strengths close to each other; against eight times the nodes of re-computed evidence.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import NamedTuple

import cyclopts
import numpy as np
from numpy.typing import NDArray

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
    """A base law with a term, at some strengths."""

    campaign: str
    base: Base
    extension: Extension
    strengths: FloatArray

    def integrals(self, budget: Budget) -> FloatArray:
        """Log integral of each avalanche at each strength, (n_strengths, n_events)."""
        base, population, found = self.base, self.base.population, []
        for strength in self.strengths:
            given = np.append(base.strengths, strength)
            likelihood = EventLikelihood(self.extension, base.rows, given)
            modes = event_modes(likelihood, base.fit.points, population)
            nodes = importance_nodes(likelihood, population, modes, budget)
            deviation = nodes.points[:, :, :-1] - population.mean[0]
            white = deviation @ np.linalg.inv(np.linalg.cholesky(population.covariance[0])).T
            log_det = np.linalg.slogdet(2.0 * np.pi * population.covariance[0])[1]
            log_prior = -0.5 * (np.square(white).sum(axis=2) + log_det)
            found.append(np.logaddexp.reduce(nodes.log_weights + log_prior, axis=1))
        return np.array(found)


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
            if own:
                term = own[rng.integers(len(own))]
                strengths = (rng.uniform(0.1, 0.8) + np.linspace(0.0, 0.03, 4)) * term.scale
                yield Case(f"{name}, {law}", base, base.extended(term.direction), strengths)


@app.default
def main() -> None:
    """Measure."""
    known = [(one, one.integrals(EXACT)) for one in cases()]
    rows = []
    for campaign in dict.fromkeys(one.campaign for one, _ in known):
        for name, budget in BUDGETS.items():
            started = time.process_time()
            off = [one.integrals(budget) - exact for one, exact in known if one.campaign == campaign]
            rows.append(
                {
                    "campaign": campaign,
                    "budget": name,
                    "nodes": budget.total,
                    "of an avalanche": float(np.sqrt(np.mean([np.mean(one**2) for one in off]))),
                    "largest": float(max(np.abs(one).max() for one in off)),
                    "of the sum": float(np.sqrt(np.mean([np.mean(one.sum(axis=1) ** 2) for one in off]))),
                    "seconds": time.process_time() - started,
                }
            )
            print(rows[-1], flush=True)
    write(RESULT, {"rows": rows})


if __name__ == "__main__":
    app()
