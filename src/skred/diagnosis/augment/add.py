"""Mechanisms added to a law one after the other: the named one, and a second only if it earns its place.

A second one is looked for where the check of the law with the first raises an alarm, by the limit of any.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from skred.diagnosis.augment.augmented import augmented_problem
from skred.diagnosis.augment.check_again import Again, check_again
from skred.diagnosis.augment.reference import Reference
from skred.diagnosis.augment.step import Augmented, Left, NotAugmented, Step
from skred.diagnosis.check.decision import decide
from skred.diagnosis.compare.candidate import Ways
from skred.diagnosis.compare.comparison import Comparison, compare
from skred.diagnosis.effort import Run
from skred.diagnosis.evidence.coefficient import Base, Curve
from skred.inference.between_events import BetweenEvents
from skred.inference.calibrate import Calibration, calibrate_surely


@dataclass(eq=False)
class Adding:
    """What is computed to add mechanisms to a law: a calibration, a check, another comparison.

    Attributes
    ----------
    reference : Reference
        Asked for the base law under the error model of what is added.
    run : Run
    """

    reference: Reference
    run: Run

    def calibrated(
        self, base: Base, chosen: Sequence[Curve], way: BetweenEvents, ways: Ways | None
    ) -> Calibration:
        """The law with what is chosen added, calibrated; avalanches may differ in it where it is one."""
        problem, settings = augmented_problem(base.plain(), chosen, way, ways), self.run.settings
        # Its chains start around the posterior: half the tuning does.
        return calibrate_surely(problem, base.law, replace(settings, tune=settings.tune // 2))

    def checked(self, base: Base, calibration: Calibration, chosen: Sequence[Curve]) -> Again:
        """Whether anything is wrong with that law, and the law as a base for another comparison."""
        return check_again(base, calibration, chosen, self.run)

    def compared(self, base: Base) -> Comparison:
        """The comparison of all candidates beside it."""
        return compare(base)


def add_mechanisms(
    base: Base, comparison: Comparison, names: Sequence[str], adding: Adding
) -> Augmented | NotAugmented:
    """Add the named mechanism, check again, and a second one only if it earns its place given the first.

    Parameters
    ----------
    comparison : Comparison
        That named something.
    names : sequence of str
        What is named, and what is tied with it.
    """
    run, reference = adding.run, adding.reference
    run.clock.stage("augment", f"{base.law.id} + {names[0]}: calibrating the augmented law")
    steps: list[Step] = []
    left: Left | None = None
    chosen = list[Curve]()
    for number in range(run.effort.max_mechanisms):
        under_errors = comparison.leading(names[0])
        candidate = under_errors.candidates[names[0]]
        chosen.append(candidate.best)
        reference.begin(under_errors.base.problem)
        # What cannot be sampled where avalanches differ is still an effect with a strength in common.
        for way in dict.fromkeys((*(candidate.likely_ways if number == 0 else ()), BetweenEvents.COMMON)):
            calibration = adding.calibrated(under_errors.base, chosen, way, candidate.ways)
            if calibration.gate.passed:
                break
        if not calibration.gate.passed:
            problems = "; ".join(calibration.gate.problems)
            reason = f"the gate of {base.law.id} + {names[0]} failed: {problems}"
            if left is None:
                return NotAugmented(reason)
            left = replace(left, reason=reason)
            break
        run.clock.stage("check again", "is anything wrong with the augmented law")
        again = adding.checked(under_errors.base, calibration, chosen)
        steps.append(Step(candidate, tuple(names[1:]), comparison, calibration, again.check))
        left, problem = None, under_errors.base.problem
        if not again.check.fired or number + 1 == run.effort.max_mechanisms:
            break
        run.clock.stage("second comparison", "something may be left: every candidate refitted again")
        comparison = adding.compared(again.base)
        left = Left(comparison)
        second = decide(comparison.probability, again.check.p_value, True)
        if not second.names:
            break
        if way is not BetweenEvents.COMMON:
            left = Left(comparison, f"avalanches differ in {names[0]}, beside which no second one is added")
            break
        names = second.names
        run.clock.stage("augment", f"calibrating with {names[0]} as well")
    # The base law under the same errors as the last step: before and after then differ by what was added.
    same_errors, reason = reference.on(problem)
    return NotAugmented(reason, left) if reason else Augmented(tuple(steps), same_errors, left)
