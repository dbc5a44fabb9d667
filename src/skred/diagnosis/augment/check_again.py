"""Whether anything is wrong with an augmented law, and that law as a base for another comparison."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from skred.diagnosis.augment.coefficient import augmented_of, multiples_of_events
from skred.diagnosis.check.bootstrap_test import BootstrapTest, linear_test
from skred.diagnosis.effort import Run
from skred.diagnosis.evidence.coefficient import Base, Curve, fit_base
from skred.diagnosis.evidence.population_draws import population_draws, typical
from skred.inference.calibrate import Calibration, posterior_of


def check_again(
    base: Base, calibration: Calibration, chosen: Sequence[Curve], run: Run
) -> tuple[BootstrapTest, Base]:
    """Ask a law with mechanisms added once more.

    Parameters
    ----------
    base : Base
        The law that the last mechanism was added to.
    calibration : Calibration
        Of the law with all that were chosen.

    Returns
    -------
    check : BootstrapTest
        Whether anything is wrong with it, by the linear model.
    base : Base
        That law, its added strengths held at their means, each avalanche's own where they differ: for another
        comparison.
    """
    own = multiples_of_events(calibration)
    directions = tuple(one.direction for one in chosen)
    if own is not None:
        directions = tuple(replace(one, own=own[:, k]) for k, one in enumerate(directions))
    strengths = augmented_of(calibration).added_rows(posterior_of(calibration)).mean(axis=0)
    draws = population_draws(calibration, run.effort.replicas, run.seed + 1)
    again = fit_base(base.problem, base.law, typical(draws), base.fit.points, directions, strengths)
    # What acts along the track cannot be missing from it a second time.
    along_the_track = [one.mechanism.id for one in chosen if one.shape.place_m is None]
    setting = replace(again.setting, base=(*base.setting.base, *along_the_track))
    again = replace(again, setting=setting)
    return linear_test(again, draws, run.seed + 1, run.effort.replicas), again
