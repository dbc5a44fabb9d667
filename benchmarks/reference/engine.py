"""What the diagnosis says of the same candidate: the only file that knows how the diagnosis computes it."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from skred.diagnosis.augment.problem import as_diagnosed
from skred.diagnosis.compare.comparison import with_errors
from skred.diagnosis.compare.recomputed import recomputed
from skred.diagnosis.compare.refinement import Kind, Part, candidates_of
from skred.diagnosis.compare.screening import whole_curve
from skred.diagnosis.evidence.coefficient import Base, fit_base
from skred.diagnosis.evidence.conditional_map import Population
from skred.diagnosis.evidence.linear_mixed_model import mean_prior
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.inference.hierarchical.rough_population import rough_population
from skred.physics.law import Law
from skred.physics.mechanisms.placed import placed
from skred.physics.mechanisms.spec import Mechanism, Shape
from skred.physics.mechanisms.stretches import shares

ERRORS = "robust"


def fitted_base(problem: HierarchicalProblem, law: Law) -> Base:
    """The base law as a comparison begins with it; its setting says where candidates may be."""
    problem = as_diagnosed(problem)
    prior = mean_prior(law)
    rough = rough_population(problem.surfaces(law.mechanisms), prior.mean, prior.sd)
    covariance = rough.correlation * rough.spread[:, None] * rough.spread
    start = Population(rough.mean[None], covariance[None])
    return with_errors(fit_base(problem, law, start), ERRORS)


def engine_log_bayes_factor(base: Base, mechanism: Mechanism, shapes: Sequence[Shape]) -> float:
    """Log Bayes factor of a mechanism against nothing, averaged over some shapes alone.

    Screened, and then with more quadrature points, as a comparison does; no shape is parted, and between them
    nothing is interpolated.
    """
    log_shares = np.log(shares(shapes))
    curves = [whole_curve(base, placed(mechanism, base.setting, one)) for one in shapes]
    kinds = [Kind(share, (Part(one),)) for share, one in zip(log_shares, curves, strict=True)]
    candidates = candidates_of(kinds)
    with ThreadPoolExecutor(1) as pool:
        again, _ = recomputed(base, candidates, [], pool)
    return again[mechanism.id].log_bayes_factor
