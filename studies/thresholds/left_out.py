"""The left-out score of a base law by three routes: smoothed weights, refits by sampling, by importance.

``python -m studies.thresholds.left_out [--law pcm]`` writes ``results/left_out.json``. The third is what the
force profile of an unexplained diagnosis is tried by; the first is what every diagnosis uses.
"""

from __future__ import annotations

from typing import Any

import cyclopts

from studies.files import RESULTS, write

RESULT = RESULTS / "left_out.json"
app = cyclopts.App(help=__doc__)


@app.default
def main(*, law: str = "pcm", errors: str = "scaled", seed: int = 0) -> None:
    """Score Ryggfonn's avalanches, each by the others."""
    from skred.campaign import find_campaign, read_campaign
    from skred.diagnosis.augment.problem import as_diagnosed
    from skred.diagnosis.effort import SAMPLING
    from skred.diagnosis.evidence.coefficient import fit_base
    from skred.diagnosis.evidence.population_draws import population_draws, typical
    from skred.diagnosis.predict.held_out import held_out
    from skred.diagnosis.predict.profile_law import base_left_out
    from skred.inference.calibrate import calibrate_surely
    from skred.inference.hierarchical.problem import hierarchical_problem
    from skred.physics.laws import load_law

    campaign = read_campaign(find_campaign("ryggfonn"))
    problem = as_diagnosed(hierarchical_problem(campaign, error_model=errors))
    base_law = load_law(law)
    calibration = calibrate_surely(problem, base_law, SAMPLING)
    used: Any = calibration.problem
    routes = {
        "smoothed weights": held_out(calibration, seed),
        "refits by sampling": held_out(calibration, seed, exact=True),
        "refits by importance draws": base_left_out(
            fit_base(used, base_law, typical(population_draws(calibration, seed))), seed
        ),
    }
    found = {
        name: {
            "elpd": float(one.pointwise.sum()),
            "pointwise": one.pointwise.tolist(),
            "refitted": list(one.refitted),
        }
        for name, one in routes.items()
    }
    write(RESULT, {"law": law, "errors": errors, "seed": seed, "routes": found})
    for name, one in routes.items():
        print(f"{name}: {one.pointwise.sum():.2f}")


if __name__ == "__main__":
    app()
