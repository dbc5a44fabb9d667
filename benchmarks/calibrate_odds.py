"""Whether the probability of a force in no list means what it says, and what would make it so.

``python benchmarks/calibrate_odds.py`` takes opened trials in which something was found, raced again by the
present code (``race_again.py``), and fits what is stated of the unlisted force against the listed ones: log
odds times a power plus an offset, by the log score of "the truth is in the list" or not. Classes of trials
weigh as they are drawn by default, not as in batches that hide more of what is in no list. A batch's gain
is by numbers fitted on the other batches. Also printed: what one power of all Bayes factors would gain
instead, and what becomes of names and ties.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cyclopts
import numpy as np
from race_again import CLASSES, found_trials
from scipy.optimize import minimize
from scipy.special import expit

from skred.diagnosis.decide import decide
from skred.diagnosis.odds import UNLISTED, Calibration, prior_odds, probabilities
from skred.physics.mechanisms import mechanisms
from skred.prove.scores_standards import LOG_SCORE_FLOOR

RESULTS = Path(__file__).resolve().parent / "results"
SHARES = {"listed": 0.35, "two": 0.1, "instrument": 0.1, UNLISTED: 0.1}
"""Of what is drawn by default; masked effects are listed ones."""
POWERS = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5)
app = cyclopts.App(help=__doc__)


@dataclass(frozen=True)
class Case:
    """A trial raced again.

    Attributes
    ----------
    batch : str
    hidden : str
        Class of what is hidden.
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

    def stated(self, power: float = 1.0, calibration: Calibration | None = None) -> dict[str, float]:
        """Probabilities with a power of all Bayes factors and a calibration."""
        odds = prior_odds(mechanisms()[name] for name in self.log_factors if name in mechanisms())
        plain = probabilities({name: power * value for name, value in self.log_factors.items()}, odds)
        return calibration.of(plain) if calibration else plain

    def log_score(self, stated: Mapping[str, float]) -> float:
        """Of probabilities, as the scorecard has it."""
        return math.log(max(sum(stated.get(name, 0.0) for name in self.truth), LOG_SCORE_FLOOR))


def cases() -> list[Case]:
    """All trials that were raced again; a class weighs what is found of it where it is drawn by default."""
    drawn = Counter(
        _class(one["truth"]["hidden"])
        for file in (RESULTS / "proof").glob("*/sealed.json")
        for one in json.loads(file.read_text(encoding="utf-8")).values()
    )
    found = Counter(_class(sealed["truth"]["hidden"]) for sealed in found_trials((), CLASSES).values())
    again = json.loads((RESULTS / "raced_again.json").read_text(encoding="utf-8"))
    again = {key: one for key, one in again.items() if "gate" not in one}
    raced = Counter(_class(one["hidden"]) for one in again.values())
    weight = {name: SHARES[name] * found[name] / drawn[name] / n for name, n in raced.items()}
    return [
        Case(
            key.partition(":")[0],
            one["hidden"],
            frozenset([UNLISTED] if one["hidden"] == UNLISTED else one["truth"]),
            one["log_bayes_factors"],
            weight[_class(one["hidden"])],
        )
        for key, one in again.items()
    ]


def _class(hidden: str) -> str:
    """Masked effects are listed ones."""
    return "listed" if hidden == "masked" else hidden


def fitted(some: Sequence[Case]) -> Calibration:
    """The offset and power with the best score of whether the truth is in the list."""
    z = np.array([Calibration.log_odds(one.stated()) for one in some])
    is_unlisted = np.array([one.hidden == UNLISTED for one in some], float)
    weight = np.array([one.weight for one in some])

    def loss(values: np.ndarray) -> float:
        at = values[0] + values[1] * z
        return float(weight @ (np.logaddexp(0.0, at) - is_unlisted * at) / weight.sum())

    found = minimize(loss, [0.0, 1.0], method="Nelder-Mead")
    return Calibration(float(found.x[0]), float(found.x[1]))


def told(some: Sequence[Case], state: Callable[[Case], Mapping[str, float]]) -> str:
    """Names and ties that hold the truth, weighted."""
    held: dict[str, list[tuple[float, bool]]] = {"single names": [], "tie sets": [], "unexplained": []}
    for one in some:
        decision = decide(state(one), 0.0, True)
        kind = {0: "unexplained", 1: "single names"}.get(len(decision.names), "tie sets")
        right = bool(one.truth & set(decision.names or (UNLISTED,)))
        held[kind].append((one.weight, right))
    return ", ".join(
        f"{kind} {sum(right for _, right in rows)} of {len(rows)}"
        f" ({sum(w * r for w, r in rows) / max(sum(w for w, _ in rows), 1e-300):.2f})"
        for kind, rows in held.items()
    )


def report(name: str, some: Sequence[Case], state: Callable[[Case], Mapping[str, float]]) -> None:
    """One line: the score gained against what is stated without, and what is named."""
    gained = np.array([one.log_score(state(one)) - one.log_score(one.stated()) for one in some])
    weight = np.array([one.weight for one in some])
    mean = float(weight @ gained / weight.sum())
    se = float(np.sqrt(weight**2 @ (gained - mean) ** 2) / weight.sum())
    print(f"{name}: {mean:+.3f} nats a trial (standard error {se:.3f}); right: {told(some, state)}")


@app.default
def main() -> None:
    """Measure."""
    every = cases()
    n = sum(one.hidden == UNLISTED for one in every)
    print(f"{len(every)} trials, of which {n} hide what is in no list")
    for power in POWERS:
        report(f"all factors to the power {power}", every, lambda one, power=power: one.stated(power))
    best = fitted(every)
    report(f"offset {best.offset:.2f}, power {best.power:.2f}", every, lambda one: one.stated(1.0, best))
    elsewhere = {
        batch: fitted([one for one in every if one.batch != batch])
        for batch in sorted({one.batch for one in every})
    }
    for batch, other in elsewhere.items():
        print(f"  without batch {batch}: offset {other.offset:.2f}, power {other.power:.2f}")
    report("fitted on the other batches", every, lambda one: one.stated(1.0, elsewhere[one.batch]))
    at = np.linspace(-8.0, 8.0, 9)
    print("log odds stated:", at, "probability:", np.round(expit(best.offset + best.power * at), 2))


if __name__ == "__main__":
    app()
