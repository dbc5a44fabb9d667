"""Mechanisms added to a law one after the other: the named one, and a second only if it earns its place.

The law with what was added is asked as the base law was: by a comparison, and by what clean campaigns have.
What is found then and cannot be added is reported.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from skred.diagnosis.augment.augmented import augmented_problem
from skred.diagnosis.augment.check_again import check_again
from skred.diagnosis.augment.reference import reference
from skred.diagnosis.augment.step import Augmented, Left, NotAugmented, Step
from skred.diagnosis.check.decision import decide
from skred.diagnosis.compare.between import or_none
from skred.diagnosis.compare.candidate import Candidate
from skred.diagnosis.compare.comparison import Comparison
from skred.diagnosis.effort import Run
from skred.diagnosis.evidence.coefficient import Base, Curve
from skred.inference.between_events import BetweenEvents
from skred.inference.calibrate import Calibration, calibrate_surely
from skred.inference.sampling import SamplerSettings


def add_mechanisms(
    base: Base, comparison: Comparison, names: Sequence[str], calibration: Calibration, run: Run
) -> Augmented | NotAugmented:
    """Add the named mechanism, check again, and a second one only if it earns its place given the first.

    Parameters
    ----------
    comparison : Comparison
        That named something.
    names : sequence of str
        What is named, and what is tied with it.
    calibration : Calibration
        Of the base law.
    """
    run.clock.stage("augment", f"{base.law.id} + {names[0]}: calibrating the augmented law")
    steps: list[Step] = []
    left: Left | None = None
    chosen = list[Curve]()
    references = dict[str, Callable[[], Calibration]]()
    for number in range(run.effort.max_mechanisms):
        under_errors = comparison.leading(names[0])
        candidate = under_errors.candidates[names[0]]
        chosen.append(candidate.best)
        if under_errors.error_model not in references:
            references[under_errors.error_model] = reference(calibration, under_errors.base.problem)
        augmented, way = calibrated(under_errors.base, candidate, chosen, run.settings)
        if augmented is None or not augmented.gate.passed:
            reason = _failed(f"{base.law.id} + {names[0]}", augmented)
            if left is None:
                return NotAugmented(reason)
            left = replace(left, reason=reason)
            break
        check, again = check_again(under_errors.base, augmented, chosen, run)
        steps.append(Step(candidate, tuple(names[1:]), comparison, augmented, check))
        left, error_model = None, under_errors.error_model
        if again is None:
            break
        comparison, left = again, Left(again)
        if not check.fired:
            left = Left(again, f"no alarm, p = {check.p_value:.2g}")
            break
        more = decide(comparison.probability, check.p_value, True)
        if not more.names:
            break
        if number + 1 == run.effort.max_mechanisms:
            left = Left(comparison, f"no more than {number + 1} are added")
            break
        if way is not BetweenEvents.COMMON:
            left = Left(comparison, f"avalanches differ in {names[0]}, beside which no second one is added")
            break
        names = more.names
        run.clock.stage("augment", f"calibrating with {names[0]} as well")
    # The base law under the same errors as the last step: before and after then differ by what was added.
    same_errors = references[error_model]()
    if not same_errors.gate.passed:
        return NotAugmented(_failed(f"{base.law.id} under {error_model} errors", same_errors), left)
    return Augmented(tuple(steps), same_errors, left)


def calibrated(
    base: Base, candidate: Candidate, chosen: Sequence[Curve], settings: SamplerSettings
) -> tuple[Calibration | None, BetweenEvents]:
    """The law with what is chosen added, calibrated, and how avalanches differ in it.

    They may differ in one that is added: in the most probable way that can be sampled. What cannot be sampled
    so is still an effect with a strength in common. None where the numerics break down for that as well.

    Parameters
    ----------
    candidate : Candidate
        The last that was chosen.
    """
    # Its chains start around the posterior: half the tuning does.
    settings = replace(settings, tune=settings.tune // 2)
    likely = candidate.likely_ways if len(chosen) == 1 else ()
    for way in dict.fromkeys((*likely, BetweenEvents.COMMON)):
        calibration = or_none(_calibrated, base, chosen, way, candidate, settings)
        if calibration is not None and calibration.gate.passed:
            break
    return calibration, way


def _calibrated(
    base: Base, chosen: Sequence[Curve], way: BetweenEvents, candidate: Candidate, settings: SamplerSettings
) -> Calibration:
    problem = augmented_problem(base.plain(), chosen, way, candidate.ways)
    return calibrate_surely(problem, base.law, settings)


def _failed(what: str, calibration: Calibration | None) -> str:
    if calibration is None:
        return f"the numerics broke down as {what} was calibrated"
    return f"the gate of {what} failed: {'; '.join(calibration.gate.problems)}"
