"""How strong a mechanism is that was added, and how well that is known."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np
from numpy.typing import NDArray

from skred.diagnosis.augment.problem import AugmentedProblem
from skred.diagnosis.augment.step import Step
from skred.diagnosis.compare.candidate import Strength
from skred.inference.calibrate import Calibration

FloatArray = NDArray[np.float64]


def augmented_of(calibration: Calibration) -> AugmentedProblem:
    """The problem of an augmented law's calibration."""
    return cast(AugmentedProblem, calibration.problem)


def added_draws(calibration: Calibration) -> FloatArray:
    """Draws of the added strengths, chain after chain, (n_draws, n_added); of a base law none."""
    posterior = calibration.tree["posterior"].to_dataset()
    problem, sizes = calibration.problem, posterior.sizes
    if not isinstance(problem, AugmentedProblem):
        return np.empty((sizes["chain"] * sizes["draw"], 0))
    columns = [posterior[one.name].transpose("chain", "draw").values.ravel() for one in problem.added]
    return np.column_stack(columns)


def strength_of(steps: Sequence[Step], number: int) -> Strength:
    """An added strength, as the last calibration has it, over all places.

    The calibration holds its place at the best one, and shrinks it by its prior.
    """
    calibration = steps[-1].calibration
    name = augmented_of(calibration).added[number].name
    draws = np.asarray(calibration.tree["posterior"].to_dataset()[name].values)
    return steps[number].candidate.over_places(float(draws.mean()), float(draws.std(ddof=1)))
