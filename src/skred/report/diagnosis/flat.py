"""A diagnosis as one flat record, None where it did not get so far: as the page's template reads it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from skred.diagnosis.compare.decision import Decision
from skred.diagnosis.outcome import NotDiagnosed, Outcome, ProfileAdded

if TYPE_CHECKING:
    from skred.diagnosis.augment.step import Step
    from skred.diagnosis.check.bootstrap_test import BootstrapTest
    from skred.diagnosis.compare.comparison import Comparison
    from skred.diagnosis.compare.location import Location
    from skred.diagnosis.detect.detectability import Identifiability
    from skred.diagnosis.predict.held_out import HeldOut
    from skred.diagnosis.predict.profile_law import ProfileLaw
    from skred.inference.calibrate import Calibration
    from skred.inference.hierarchical.problem import HierarchicalProblem
    from skred.physics.law import Law


@dataclass(frozen=True, eq=False)
class Flat:
    """An outcome in one record; see `skred.diagnosis.outcome`."""

    problem: HierarchicalProblem
    law: Law
    cannot: str
    decision: Decision
    calibration: Calibration | None = None
    table: Identifiability | None = None
    check: BootstrapTest | None = None
    comparison: Comparison | None = None
    location: Location | None = None
    quiet: Location | None = None
    steps: tuple[Step, ...] = ()
    profile: ProfileLaw | None = None
    before: HeldOut | None = None
    after: HeldOut | None = None
    seconds: dict[str, float] = field(default_factory=dict)


def flat(found: Outcome) -> Flat:
    """An outcome in one record; ``location`` where there is an alarm, ``quiet`` where there is none."""
    asked = found.problem, found.law, found.reason, found.decision, found.calibration
    if isinstance(found, NotDiagnosed):
        return Flat(*asked, seconds=found.seconds)
    alarm = found.alarm_by is not None
    return Flat(
        *asked,
        found.table,
        found.check,
        found.comparison,
        found.location if alarm else None,
        None if alarm else found.location,
        found.steps,
        found.finding.law if isinstance(found.finding, ProfileAdded) else None,
        found.before,
        found.after,
        found.seconds,
    )
