"""Whether anything is wrong with an augmented law, and that law as a base for another comparison."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from skred.diagnosis.augment.coefficient import added_draws
from skred.diagnosis.check.bootstrap_test import BootstrapTest, bootstrap_test
from skred.diagnosis.detect.score_test import ScoreTest
from skred.diagnosis.effort import Run
from skred.diagnosis.evidence.coefficient import Base, Curve, fit_base
from skred.diagnosis.evidence.population_draws import population_draws, typical
from skred.inference.calibrate import Calibration


def check_again(
    base: Base, calibration: Calibration, chosen: Sequence[Curve], run: Run
) -> tuple[BootstrapTest, Base]:
    """The bootstrap test of the augmented law, and that law with its strengths held at their means.

    Parameters
    ----------
    base : Base
        The law that the last mechanism was added to.
    calibration : Calibration
        Of the law with all of them.
    chosen : sequence of Curve
        What was added.
    run : Run
    """
    directions = tuple(one.direction for one in chosen)
    strengths = added_draws(calibration).mean(axis=0)
    draws = population_draws(calibration, run.effort.replicas, run.seed + 1)
    again = fit_base(base.problem, base.law, typical(draws), base.fit.points, directions, strengths)
    setting = replace(again.setting, base=(*base.setting.base, *_global_ids(chosen)))
    again = replace(again, setting=setting)
    score_test = ScoreTest(base.problem, base.law, setting, directions, strengths)
    start = (again.population, again.fit.points)
    check = bootstrap_test(score_test, again.rows, start, draws, run.seed + 1, run.effort.replicas)
    return check, again


def _global_ids(chosen: Sequence[Curve]) -> list[str]:
    """Ids of mechanisms that act alike everywhere: they cannot be missing a second time."""
    return [one.mechanism.id for one in chosen if one.shape.place_m is None]
