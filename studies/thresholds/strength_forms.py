"""How much the form of a term adds to the uncertainty of its strength: what `strength.FORM` is set on.

``python -m studies.thresholds.strength_forms`` reads the opened batches whose answers state strengths without
it, and prints how many true strengths the 90 % intervals hold for several values.
"""

from __future__ import annotations

import math

import cyclopts

from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.spec import Group
from skred.prove.scoring.places import comparable
from skred.prove.scoring.standards import CREDIBLE
from studies.proof.record import Batch, diagnosed

BATCHES = (1471600277, 1152334902, 60796182)
app = cyclopts.App(help=__doc__)


@app.default
def main() -> None:
    """Count."""
    known = []
    for seed in BATCHES:
        for pair in diagnosed(Batch(str(seed))):
            truth = comparable(pair) if pair.right_name else None
            mean, sd = pair.number("strength", "mean"), pair.number("strength", "sd")
            if truth is None or mean is None or sd is None:
                continue
            if mechanisms()[str(pair.name)].group is Group.PHYSICS:
                known.append((mean, sd, float(truth["strength"])))
    for form in (0.0, 0.1, 0.2, 0.25, 0.3, 0.35):
        held = [abs(mean - true) <= CREDIBLE * math.hypot(sd, form * mean) for mean, sd, true in known]
        print(f"{form:.2f}: {sum(held)} of {len(held)}")


if __name__ == "__main__":
    app()
