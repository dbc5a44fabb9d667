"""Ties across groups: what the opened trials answered before there were any say of them.

``python -m studies.thresholds.tie_rules`` takes the stated probabilities of every opened batch. Ids of the
leading group are tied as they were answered; here an id of another group, `unlisted` among them, is tied too
where its log probability is at most so many nats below that of the name. For each limit it tells how often a
name that is left alone is right, how often a tie set holds what is hidden, and how often one name is given
where the linearised ceiling expects one; and of the names that stood alone and do so no longer how many were
right. Writes ``results/tie_rules.json``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import cyclopts

from skred.diagnosis.check.decision import TIED_NATS
from skred.diagnosis.evidence.prior_odds import NOTHING, UNLISTED
from skred.physics.mechanisms import mechanisms
from skred.prove.scoring.answers import Pair
from skred.prove.scoring.intervals import share
from skred.prove.scoring.naming import naming, selectivity
from studies.files import RESULTS, write
from studies.proof.record import Batch, diagnosed, ledger_of, opened_batches

RESULT = RESULTS / "tie_rules.json"
BEFORE = "2026-11-23T14:00"
"""Batches sealed from then on answer by the rule itself, which was chosen with those before in sight."""
NATS = (0.0, 1.0, TIED_NATS, 3.0)
app = cyclopts.App(help=__doc__)


def group(name: str) -> str:
    """The group of an id."""
    return UNLISTED if name == UNLISTED else str(mechanisms()[name].group)


def tied(pair: Pair, nats: float) -> Pair:
    """The same answer; of other groups what is close to its name is tied, and nothing at 0 nats."""
    name, probability = pair.name, pair.probability
    if name is None or not probability:
        return pair
    own = [other for other in pair.names[1:] if group(other) == group(name)]
    least = math.exp(-nats) * probability[name] if nats else math.inf
    close = [
        other
        for other, stated in probability.items()
        if other != NOTHING and group(other) != group(name) and stated >= least
    ]
    close.sort(key=lambda other: -probability[other])
    return replace(pair, answer={**pair.answer, "indistinguishable": [*own, *close]})


def told(pairs: Sequence[Pair], nats: float) -> dict[str, Any]:
    """What one limit makes of some trials."""
    before, after = [tied(pair, 0.0) for pair in pairs], [tied(pair, nats) for pair in pairs]
    no_longer = [
        one for one, other in zip(before, after, strict=True) if one.named_alone and not other.named_alone
    ]
    return {
        "nats": nats,
        **selectivity(after),
        "right_set_of_3_around_7": naming(after)["around_7"]["right_set_of_3"],
        "sets_of_4_and_more": sum(len(pair.names) > 3 for pair in after),
        "no_longer_alone_was_right": share([pair.right_name for pair in no_longer]),
    }


def names(batches: Sequence[Batch]) -> list[str]:
    """Their seeds."""
    return [batch.name for batch in batches]


@app.default
def main() -> None:
    """Score every limit on all trials, on those with a listed truth, and by kind of recording."""
    batches = [batch for batch in opened_batches() if ledger_of(batch)["created_utc"] < BEFORE]
    after = [batch for batch in opened_batches() if batch not in batches]
    pairs = [pair for batch in batches for pair in diagnosed(batch)]
    parts = {
        "sealed after": [pair for batch in after for pair in diagnosed(batch)],
        "all": pairs,
        "without forces in no list": [pair for pair in pairs if pair.hidden != "unlisted"],
        "sparse": [pair for pair in pairs if pair.kind == "sparse"],
        "dense": [pair for pair in pairs if pair.kind == "dense"],
    }
    found = {name: [told(part, nats) for nats in NATS] for name, part in parts.items()}
    write(RESULT, {"format": 1, "batches": names(batches), "after": names(after), "parts": found})
    for name, rows in found.items():
        print(name)
        for row in rows:
            alone, sets = row["right_where_named"], row["set_holds_truth_where_tied"]
            lost, often = row["no_longer_alone_was_right"], row["named_over_ceiling"]["value"]
            print(
                f"  {row['nats']:.0f} nats: alone {alone['hits']} of {alone['n']} right,"
                f" tie sets {sets['hits']} of {sets['n']}, named over ceiling {often:.2f},"
                f" no longer alone {lost['n']} ({lost['hits']} right)"
            )


if __name__ == "__main__":
    app()
