"""To which power Bayes factors are to count, so that what is stated means what it says.

``python -m studies.thresholds.calibrate_odds`` takes opened trials in which something was found, compared
again (``studies.thresholds.compared_again``), and scores what would be stated of them by the log probability
of the truth, with Bayes factors among all but nothing to one power after the other. Each class of trials has
the share that it has where trials are drawn by default, masked effects within that of listed ones. Chosen is
the weakest change whose score is within one standard error of the best one's; what it gains is told by powers
chosen without each batch. Result: ``results/calibrate_odds.json``; the power is frozen in
``skred.diagnosis.evidence.prior_odds``.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cyclopts
import numpy as np
from numpy.typing import NDArray

from skred.diagnosis.check.decision import decide
from skred.diagnosis.evidence.prior_odds import UNLISTED
from skred.prove.scoring.standards import LOG_SCORE_FLOOR
from skred.simulator.draw import SHARES
from studies.files import RESULTS, read, write
from studies.proof.record import Batch, sealed_of
from studies.thresholds.compared_again import CLASSES, found_trials, stated_of

FloatArray = NDArray[np.float64]
POWERS = tuple(round(0.05 * k, 2) for k in range(20, 5, -1))
app = cyclopts.App(help=__doc__)


@dataclass(frozen=True)
class Case:
    """A trial compared again.

    Attributes
    ----------
    batch, hidden : str
        The latter the class of what is hidden.
    truth : frozenset of str
        Ids; ``unlisted`` where no list has it.
    log_factors : mapping
    weight : float
    """

    batch: str
    hidden: str
    truth: frozenset[str]
    log_factors: Mapping[str, float]
    weight: float

    def log_score(self, power: float) -> float:
        """Of the truth, as the scorecard has it."""
        probability = stated_of(self.log_factors, power)
        return math.log(max(sum(probability.get(name, 0.0) for name in self.truth), LOG_SCORE_FLOOR))


def cases() -> list[Case]:
    """All trials compared again; a class weighs what is found of it where it is drawn by default."""
    again = read(RESULTS / "compared_again.json")
    again = {key: one for key, one in again.items() if "failed" not in one}
    # Of these batches alone: what is opened later must not change what was frozen before.
    batches = sorted({key.partition(":")[0] for key in again})
    drawn = Counter(
        _class(one["truth"]["hidden"]) for batch in batches for one in sealed_of(Batch(batch)).values()
    )
    of_these = found_trials(tuple(map(int, batches)), CLASSES)
    found = Counter(_class(sealed["truth"]["hidden"]) for sealed in of_these.values())
    compared = Counter(_class(one["hidden"]) for one in again.values())
    weight = {name: SHARES[name] * found[name] / drawn[name] / n for name, n in compared.items()}
    total = sum(weight[name] * n for name, n in compared.items())
    return [
        Case(
            key.partition(":")[0],
            one["hidden"],
            frozenset([UNLISTED] if one["hidden"] == UNLISTED else one["truth"]),
            one["log_bayes_factors"],
            weight[_class(one["hidden"])] / total,
        )
        for key, one in again.items()
    ]


def _class(hidden: str) -> str:
    """Masked effects are listed ones."""
    return "listed" if hidden == "masked" else hidden


def told(some: Sequence[Case], power: float) -> dict[str, tuple[int, int]]:
    """Of single names, tie sets and `unexplained`, how many hold the truth."""
    right, n = Counter[str](), Counter[str]()
    for one in some:
        found = decide(stated_of(one.log_factors, power), 0.0, True)
        kind = {0: found.verdict, 1: "single names"}.get(len(found.names), "tie sets")
        n[kind] += 1
        right[kind] += bool(one.truth & set(found.names or (UNLISTED,)))
    return {kind: (right[kind], n[kind]) for kind in ("single names", "tie sets", "unexplained")}


def mean_and_error(weight: FloatArray, gained: FloatArray) -> tuple[float, float]:
    """Weighted mean and its standard error."""
    mean = float(weight @ gained / weight.sum())
    return mean, float(np.sqrt(weight**2 @ (gained - mean) ** 2) / weight.sum())


def weakest(weight: FloatArray, scores: FloatArray) -> int:
    """Number of the weakest power whose score is within one standard error of the best one's."""
    means = scores @ weight / weight.sum()
    best = int(np.argmax(means))
    within = means >= means[best] - mean_and_error(weight, scores[best] - scores[0])[1]
    return int(np.argmax(within))


@app.default
def main() -> None:
    """Measure and choose."""
    every = cases()
    weight = np.array([one.weight for one in every])
    batch = np.array([one.batch for one in every])
    scores = np.array([[one.log_score(power) for one in every] for power in POWERS])
    rows = []
    for power, row in zip(POWERS, scores, strict=True):
        gained, error = mean_and_error(weight, row - scores[0])
        rows.append({"power": power, "gained": gained, "standard_error": error, **told(every, power)})
        print(f"{power:.2f}: {gained:+.3f} nats a trial (standard error {error:.3f}); {told(every, power)}")
    gains = np.zeros(len(every))
    for one in sorted(set(batch)):
        own = batch == one
        chosen = weakest(weight[~own], scores[:, ~own])
        gains[own] = (scores[chosen] - scores[0])[own]
        gained, _ = mean_and_error(weight[own], gains[own])
        print(f"  batch {one}: {POWERS[chosen]:.2f} by the others, {gained:+.3f}")
    gained, error = mean_and_error(weight, gains)
    power = POWERS[weakest(weight, scores)]
    print(f"{power:.2f}; chosen on the other batches: {gained:+.3f} (standard error {error:.3f})")
    n = dict(sorted(Counter(one.hidden for one in every).items()))
    chosen_elsewhere = {"gained": gained, "standard_error": error}
    found = {"power": power, "trials": n, "chosen_on_other_batches": chosen_elsewhere, "powers": rows}
    write(RESULTS / "calibrate_odds.json", found)


if __name__ == "__main__":
    app()
