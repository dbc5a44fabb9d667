"""How probable nothing may be beside an alarm: what the opened trials say of several limits.

``python -m studies.thresholds.nothing_at_most`` takes the alarms of every opened batch, as they were
answered, and counts those beside which nothing is less probable than a limit: false ones, and those of
effects that are there. The alarms are of earlier checks. The limit in use follows from what credible sets
hold, not from these counts; they say what it costs. Writes ``results/nothing_at_most.json``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cyclopts

from skred.diagnosis.evidence.prior_odds import NOTHING, SHARES
from skred.diagnosis.limits import NOTHING_AT_MOST
from skred.prove.scoring.alarms import AT
from skred.prove.scoring.answers import Pair
from skred.prove.scoring.intervals import share
from studies.files import RESULTS, write
from studies.proof.record import diagnosed, opened_batches

RESULT = RESULTS / "nothing_at_most.json"
LIMITS = (SHARES[NOTHING], 0.3, 0.2, NOTHING_AT_MOST, 0.05)
app = cyclopts.App(help=__doc__)


def told(pairs: Sequence[Pair], limit: float) -> dict[str, Any]:
    """What one limit makes of some trials."""

    def stays(pair: Pair) -> bool:
        return pair.alarm and pair.probability.get(NOTHING, 0.0) < limit

    weak = [pair for pair in pairs if not pair.is_null and pair.snr < AT[0]]
    strong = [pair for pair in pairs if not pair.is_null and pair.snr >= AT[0]]
    return {
        "limit": limit,
        "false": share([stays(pair) for pair in pairs if pair.is_null]),
        "found_weak": share([stays(pair) for pair in weak]),
        "found": share([stays(pair) for pair in strong]),
    }


@app.default
def main() -> None:
    """Count alarms under every limit."""
    batches = opened_batches()
    pairs = [pair for batch in batches for pair in diagnosed(batch)]
    parts = {
        kind: [pair for pair in pairs if kind in ("all", pair.kind)] for kind in ("all", "sparse", "dense")
    }
    found = {name: [told(part, limit) for limit in LIMITS] for name, part in parts.items()}
    write(RESULT, {"format": 1, "batches": len(batches), "from_snr": AT[0], "parts": found})
    for name, rows in found.items():
        print(name)
        for row in rows:
            counts = (f"{row[key]['hits']} of {row[key]['n']}" for key in ("false", "found", "found_weak"))
            print("  {:g}: false {}, found {}, weaker ones {}".format(row["limit"], *counts))


if __name__ == "__main__":
    app()
