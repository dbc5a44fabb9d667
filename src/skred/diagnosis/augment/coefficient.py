"""How strong a mechanism is that was added, and how well that is known."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np

from skred.arrays import FloatArray
from skred.diagnosis.augment.added_strength import components_of
from skred.diagnosis.augment.problem import AugmentedProblem
from skred.diagnosis.augment.step import Step
from skred.diagnosis.compare.candidate import Strength
from skred.inference.calibrate import Calibration, posterior_of

_DRAWS = 400
"""Draws that say what each avalanche has of what is added: probabilities to a hundredth or two."""


def augmented_of(calibration: Calibration) -> AugmentedProblem:
    """The problem of an augmented law's calibration."""
    return cast(AugmentedProblem, calibration.problem)


def multiples_of_events(calibration: Calibration) -> FloatArray | None:
    """What each recorded avalanche has of the added strengths, as multiples, (n_events, n_added).

    Posterior means; None where all have them in common.
    """
    problem = augmented_of(calibration)
    if problem.n_components == 1:
        return None
    samples = some_draws(calibration)
    own, _ = components_of(problem.added, samples)
    shares = problem.probability_of_each(calibration.law, samples)
    strengths = np.einsum("nec,nck->ek", shares, own) / len(own)
    multiples: FloatArray = strengths / problem.added_rows(samples).mean(axis=0)
    return multiples


def some_draws(calibration: Calibration) -> dict[str, FloatArray]:
    """Draws of an augmented law's parameters by name, evenly over all chains."""
    values = posterior_of(calibration)
    n = len(next(iter(values.values())))
    chosen = np.linspace(0, n - 1, min(n, _DRAWS)).round().astype(int)
    return {name: draws[chosen] for name, draws in values.items()}


def strength_of(steps: Sequence[Step], number: int) -> Strength:
    """An added strength, as the last calibration has it, over all places.

    The calibration holds its place at the best one, and shrinks it by its prior.
    """
    calibration = steps[-1].calibration
    name = augmented_of(calibration).added[number].name
    draws = np.asarray(calibration.tree["posterior"].to_dataset()[name].values)
    return steps[number].candidate.over_places(float(draws.mean()), float(draws.std(ddof=1)))
