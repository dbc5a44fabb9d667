"""Where climbs begin: what the fit of another mechanism finds as a start that nothing and the prior miss.

Climbs along a mechanism's strength begin with the population and the events that the base law has alone.
Here each mechanism, at its best shape, is climbed once more from those of the mechanism with most evidence,
and that one from those of the second.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any

from benchmarks.reference.engine import fitted_base
from benchmarks.reference.pairs import Drawn
from skred.diagnosis.compare.screening import curve_about, screened
from skred.diagnosis.evidence.coefficient import Base, Curve
from skred.diagnosis.evidence.global_start import global_starts
from skred.diagnosis.evidence.refit import Fit
from skred.inference.hierarchical.problem import hierarchical_problem
from skred.physics.laws import load_law


def look(drawn: Drawn) -> dict[str, Any] | None:
    """Log Bayes factor of each mechanism's best shape, without and with the other start."""
    base = fitted_base(hierarchical_problem(drawn.campaign), load_law(drawn.base))
    with ThreadPoolExecutor(1) as pool:
        curves = screened(base, pool)
    best: dict[str, Curve] = {}
    for one in sorted(curves, key=lambda one: one.log_bayes_factor):
        best[one.mechanism.id] = one
    order = sorted(best, key=lambda name: -best[name].log_bayes_factor)
    found = {}
    for name in order:
        other = order[1] if name == order[0] else order[0]
        again = _from_both(base, best[name], best[other].top[1])
        found[name] = {"usual": best[name].log_bayes_factor, "more": again.log_bayes_factor}
    return {"mechanisms": found}


def _from_both(base: Base, candidate: Curve, other: Fit) -> Curve:
    """The curve by climbs from the base law's fit, and from another one."""
    extension, either_sign = base.extended(candidate.direction), candidate.added.either_sign
    starts = [
        one
        for fit in (base.fit, other)
        for one in global_starts(
            extension, base.rows, base.strengths, fit.start, candidate.scale, either_sign
        )
    ]
    return curve_about(base, candidate, starts)
