"""The reference's log Bayes factor of a candidate, with its standard error and checks."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from benchmarks.reference.coefficient import At, Curve, Reference, curve
from benchmarks.reference.lattice import population_envelope
from skred.diagnosis.evidence.extension import extended, setting_of, typical_speed
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.physics.law import Law
from skred.physics.mechanisms.placed import placed
from skred.physics.mechanisms.spec import Mechanism, Setting, Shape
from skred.physics.mechanisms.stretches import shares

_FINER = 0.65
"""Factor on the steps of the lattices of the second computation: more than twice the points on a plane."""


@dataclass(frozen=True)
class ReferenceFactor:
    """What the reference says of a candidate.

    Attributes
    ----------
    log_bayes_factor, error : float
        With its standard error in nats, checks included.
    by_shape : list of float
    best : list of float
        Coefficient with the most evidence, by shape.
    at_best : list of float
        Log evidence there, relative to nothing.
    again : float
        Change of the difference between best and nothing on finer lattices with other random numbers.
    nested : float
        The same by nested sampling, less the reference's.
    nested_error : float
    lattice : float
        Largest difference of the halves of a lattice that counts.
    n_coefficients : int
    seconds : float
        Of CPU.
    """

    log_bayes_factor: float
    error: float
    by_shape: list[float]
    best: list[float]
    at_best: list[float]
    again: float
    nested: float
    nested_error: float
    lattice: float
    n_coefficients: int
    seconds: float

    def as_dict(self) -> dict[str, object]:
        """As plain data."""
        return asdict(self)


def nothing_added(problem: HierarchicalProblem, law: Law, seed: int) -> tuple[Reference, Setting]:
    """The base law alone, and what candidates can refer to; its typical front is the reference's own."""
    plain = Reference(problem, law, None, seed)
    at = plain.at(0.0)
    envelope = population_envelope(at.found.draws, len(law.mechanisms))
    best = [cloud.points[int(np.argmax(cloud.heights(envelope)))] for cloud in at.resolved.clouds]
    speeds = extended(problem, law).speeds(np.array(best), np.empty(0))
    return plain, setting_of(problem, law, typical_speed(speeds))


def reference_factor(
    plain: Reference,
    setting: Setting,
    mechanism: Mechanism,
    shapes: Sequence[Shape],
    *,
    n_live: int = 150,
) -> ReferenceFactor:
    """Log Bayes factor of a mechanism of some shapes against nothing, averaged over them.

    Parameters
    ----------
    plain : Reference
        With nothing added.
    n_live : int
        Live points of the nested sampling that checks it; 0 for none.
    """
    started = time.process_time()
    nothing = plain.at(0.0)
    found: list[tuple[Reference, Curve]] = []
    for number, shape in enumerate(shapes):
        missing = placed(mechanism, setting, shape)
        one = Reference(plain.problem, plain.law, missing.direction, plain.seed + 1000 * (number + 1))
        found.append((one, curve(one, nothing, missing.scale, missing.added.either_sign)))
    factors = np.array([one.log_bayes_factor for _, one in found]) + np.log(shares(list(shapes)))
    total = float(np.logaddexp.reduce(factors))
    tops = [float(one.coefficients[int(np.argmax(one.log_evidence))]) for _, one in found]
    leading, leader = found[int(np.argmax(factors))]
    top = tops[int(np.argmax(factors))]
    at_top = nothing if top == 0.0 else leading.at(top)
    again = _again(plain, leading, top, nothing, at_top) if top != 0.0 else 0.0
    nested, nested_error = math.nan, math.nan
    if n_live and top != 0.0:
        a, b = plain.nested(0.0, n_live), leading.nested(top, n_live)
        nested = (b[0] - a[0]) - (at_top.found.log_evidence - nothing.found.log_evidence)
        nested_error = math.hypot(a[1], b[1])
    return ReferenceFactor(
        log_bayes_factor=total,
        # A second computation differs by the errors of two, those of nodes included.
        error=math.hypot(nothing.found.error, at_top.found.error / 2.0, again / math.sqrt(2.0)),
        by_shape=[one.log_bayes_factor for _, one in found],
        best=tops,
        at_best=[float(one.log_evidence.max()) for _, one in found],
        again=again,
        nested=nested,
        nested_error=nested_error,
        lattice=max(nothing.resolved.disagreement, at_top.resolved.disagreement),
        n_coefficients=sum(len(one.coefficients) for _, one in found),
        seconds=time.process_time() - started,
    )


def _again(plain: Reference, added: Reference, top: float, nothing: At, at_top: At) -> float:
    """Change of the evidence at the top, relative to nothing, when computed anew and finer."""
    parts = [
        Reference(one.problem, one.law, one.direction, one.seed + 7, _FINER).at(at)
        for one, at in ((plain, 0.0), (added, top))
    ]
    second = parts[1].found.log_evidence - parts[0].found.log_evidence
    return second - (at_top.found.log_evidence - nothing.found.log_evidence)
