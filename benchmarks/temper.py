"""Whether stated probabilities should be tempered: measured on the opened trials of the record.

``python benchmarks/temper.py`` multiplies all log Bayes factors by one number, or only those among the ids
other than nothing, and prints what that makes of the log score per trial, of single names and of tie sets.
For each batch it also chooses the number on all other batches and scores that batch with it: the gain to be
expected.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import cyclopts
import numpy as np

from skred.diagnosis.decide import decide
from skred.diagnosis.odds import NOTHING, probabilities
from skred.prove.scores_answers import Pair, pairs_of
from skred.prove.scores_standards import LOG_SCORE_FLOOR

RECORD = Path(__file__).resolve().parent / "results" / "proof"
POWERS = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4)
Probabilities = Mapping[str, float]
app = cyclopts.App(help=__doc__)


def opened() -> dict[str, list[Pair]]:
    """Trials whose answers state Bayes factors, by batch."""
    found = {}
    for folder in sorted(RECORD.iterdir()):
        if (folder / "sealed.json").exists():
            sealed, answers = (
                json.loads((folder / name).read_text(encoding="utf-8"))
                for name in ("sealed.json", "answers.json")
            )
            pairs = pairs_of(list(sealed.values()), answers["skred"])
            found[folder.name] = [one for one in pairs if one.answer.get("log_bayes_factors")]
    return found


def tempered(pair: Pair, power: float) -> Probabilities:
    """Probabilities with all log Bayes factors times a power."""
    stated, factors = pair.probability, pair.answer["log_bayes_factors"]
    odds = {name: stated[name] * math.exp(-min(factors.get(name, 0.0), 600.0)) for name in stated}
    total = sum(odds.values())
    odds = {name: max(value / total, 1e-300) for name, value in odds.items()}
    return probabilities({name: power * value for name, value in factors.items()}, odds)


def tempered_names(pair: Pair, power: float) -> Probabilities:
    """Probabilities with those among the ids other than nothing tempered, that of nothing kept."""
    nothing, among = pair.probability[NOTHING], dict(tempered(pair, power))
    rest = 1.0 - among.pop(NOTHING)
    return {NOTHING: nothing} | {name: (1.0 - nothing) * value / rest for name, value in among.items()}


Tempering = Callable[[Pair, float], Probabilities]


def log_scores(pairs: Sequence[Pair], tempering: Tempering, power: float) -> list[float]:
    """Log probability of the truth of each trial."""
    found = []
    for pair in pairs:
        stated = tempering(pair, power)
        truth = sum(stated.get(name, 0.0) for name in pair.probable_ids)
        found.append(math.log(max(truth, LOG_SCORE_FLOOR)))
    return found


def names(pairs: Sequence[Pair], tempering: Tempering, power: float) -> str:
    """Single names and tie sets, of trials that were alarmed, and how many hold what is hidden."""
    single, sets = list[bool](), list[bool]()
    for pair in pairs:
        if not pair.alarm:
            continue
        decision = decide(tempering(pair, power), 0.0, True)
        if decision.names:
            (single if len(decision.names) == 1 else sets).append(bool(pair.true_ids & set(decision.names)))
    return f"single names right {sum(single)} of {len(single)}, tie sets {sum(sets)} of {len(sets)}"


@app.default
def main() -> None:
    """Measure."""
    batches = opened()
    every = [pair for pairs in batches.values() for pair in pairs]
    for tempering in (tempered, tempered_names):
        print(f"{tempering.__name__}: {len(every)} trials")
        for power in POWERS:
            score = np.mean(log_scores(every, tempering, power))
            print(f"  {power:.1f}: log score {score:.3f} nats per trial; {names(every, tempering, power)}")
        gained = list[float]()
        for batch, pairs in batches.items():
            others = [pair for name, rest in batches.items() if name != batch for pair in rest]
            best = max(POWERS, key=lambda power: float(np.mean(log_scores(others, tempering, power))))
            chosen, plain = (np.array(log_scores(pairs, tempering, power)) for power in (best, 1.0))
            gained += list(chosen - plain)
            print(f"  batch {batch}: {best:.1f} by the others, gains {np.mean(chosen - plain):+.3f}")
        se = np.std(gained, ddof=1) / math.sqrt(len(gained))
        print(f"  chosen on the other batches: {np.mean(gained):+.3f} (standard error {se:.3f})")


if __name__ == "__main__":
    app()
