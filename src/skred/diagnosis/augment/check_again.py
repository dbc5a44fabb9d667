"""Whether anything is wrong with an augmented law: the same question as of the base law, by the same odds.

A comparison takes long, and mostly nothing more is found. So the odds are computed by fronts first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from skred.diagnosis.augment.coefficient import augmented_of, multiples_of_events
from skred.diagnosis.check.bootstrap_test import BootstrapTest, odds_of_recordings, odds_test
from skred.diagnosis.compare.between import or_none
from skred.diagnosis.compare.comparison import Comparison, compare
from skred.diagnosis.effort import Run
from skred.diagnosis.evidence.coefficient import Base, Curve
from skred.diagnosis.evidence.conditional_map import Population, campaign_rows
from skred.diagnosis.evidence.extension import extended, setting_of, typical_speed
from skred.diagnosis.evidence.population_draws import population_draws, typical
from skred.diagnosis.evidence.refit import Rounds, refit
from skred.inference.calibrate import Calibration, posterior_of


def check_again(
    base: Base, calibration: Calibration, chosen: Sequence[Curve], run: Run
) -> tuple[BootstrapTest, Comparison | None]:
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
        Whether anything is wrong with it.
    comparison : Comparison or None
        Of everything else with it; None where no second mechanism is asked for, nothing more is more
        probable by fronts, or the numerics broke down.
    """
    seed = run.seed + 1
    run.clock.stage("check again", "is anything wrong with the augmented law: clean campaigns refitted")
    draws, comparison = population_draws(calibration, seed), None
    again = _augmented(base, calibration, chosen, typical(draws))
    log_odds = odds_of_recordings(again, seed)
    if run.effort.max_mechanisms > 1 and log_odds > 0.0:
        run.clock.stage("compare again", "what could be missing still: every candidate refitted once more")
        comparison = or_none(compare, again, run.clock.progress, run.clock.tell)
        log_odds = log_odds if comparison is None else comparison.log_odds
        run.clock.stage("check again", "is that more than clean campaigns of the augmented law have")
    return odds_test(again, draws, seed, log_odds, run.clock.progress), comparison


def _augmented(base: Base, calibration: Calibration, chosen: Sequence[Curve], population: Population) -> Base:
    """The law with its added strengths held at their means, each avalanche's own where they differ."""
    own = multiples_of_events(calibration)
    directions = tuple(one.direction for one in chosen)
    if own is not None:
        directions = tuple(replace(one, own=own[:, k]) for k, one in enumerate(directions))
    strengths = augmented_of(calibration).added_rows(posterior_of(calibration)).mean(axis=0)
    extension = extended(base.problem, base.law, directions)
    rows = campaign_rows(extension)
    fit = refit(extension, rows, strengths[None, :], (population, base.fit.points), Rounds(least=4))[0]
    setting = setting_of(base.problem, base.law, typical_speed(extension.speeds(fit.points, strengths)))
    # What acts along the track cannot be missing from it a second time.
    along_the_track = [one.mechanism.id for one in chosen if one.shape.place_m is None]
    setting = replace(setting, base=(*base.setting.base, *along_the_track))
    return Base(base.problem, base.law, setting, rows, fit, directions, strengths)
