"""What a diagnosis returns: what it found, or why there could be none."""

from __future__ import annotations

from dataclasses import dataclass, field

from skred.diagnosis.augment.step import Augmented, Left, NotAugmented, Step
from skred.diagnosis.check.bootstrap_test import BootstrapTest
from skred.diagnosis.check.decision import Decision, alarmed, decide
from skred.diagnosis.compare.comparison import Comparison
from skred.diagnosis.compare.location import Location
from skred.diagnosis.detect.detectability import Identifiability
from skred.diagnosis.evidence.prior_odds import UNLISTED
from skred.diagnosis.influence.influence import Influence
from skred.diagnosis.predict.conditional import BeforeAfter
from skred.diagnosis.predict.held_out import HeldOut
from skred.diagnosis.predict.profile_law import ProfileLaw
from skred.inference.calibrate import Calibration
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.physics.law import Law

Finding = Augmented | NotAugmented | ProfileLaw | None
"""Mechanisms added, none that could be, a force in no list; None where the comparison named nothing."""


@dataclass(frozen=True, eq=False)
class NotDiagnosed:
    """No diagnosis was possible.

    Attributes
    ----------
    problem, law :
        What was asked about.
    reason : str
        Why not.
    calibration : Calibration or None
        Of the base law, as far as one was made before it could not go on.
    converged : bool
        False where numerics are the reason; true where the recordings are too few.
    seconds : dict
        Of each stage.
    """

    problem: HierarchicalProblem
    law: Law
    reason: str
    calibration: Calibration | None = None
    converged: bool = False
    seconds: dict[str, float] = field(default_factory=dict)

    @property
    def decision(self) -> Decision:
        """That the recordings cannot tell."""
        return Decision("cannot_tell", ())

    @property
    def refits_not_converged(self) -> tuple[str, ...]:
        """None: nothing was refitted."""
        return ()


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Everything that a diagnosis found.

    Attributes
    ----------
    problem, law :
        What was asked about.
    calibration : Calibration
        Of the base law.
    table : Identifiability
    check : BootstrapTest
    comparison : Comparison
    decision : Decision
        ``cannot_tell`` also where what the comparison named could not be added.
    location : Location
        Where something is missing; where there is no alarm, the force in which nothing stands out.
    finding : Augmented, NotAugmented, ProfileLaw or None
    before : HeldOut
        Avalanches left out, as the base law predicts them, under the error model of what was added.
    after : HeldOut or None
        The same, as the law with what was added predicts them; None where nothing was added.
    influence : Influence or None
        What the answer hangs on; None where none is given.
    conditional : BeforeAfter or None
        Each reading as predicted by those of the same avalanche above it; None where nothing was added.
    seconds : dict
        Of each stage.
    """

    problem: HierarchicalProblem
    law: Law
    calibration: Calibration
    table: Identifiability
    check: BootstrapTest
    comparison: Comparison
    decision: Decision
    location: Location
    finding: Finding
    before: HeldOut
    after: HeldOut | None = None
    influence: Influence | None = None
    conditional: BeforeAfter | None = None
    seconds: dict[str, float] = field(default_factory=dict)

    @property
    def alarm_by(self) -> str | None:
        """What raised the alarm; None where there is none.

        ``evidence`` where the odds alone suffice, ``check`` where clean campaigns were simulated.
        """
        if not alarmed(self.comparison.probability, self.check.p_value):
            return None
        return "evidence" if self.check.is_bound else "check"

    @property
    def reason(self) -> str:
        """Why what the comparison named could not be added; empty where there is no such reason."""
        return self.finding.reason if isinstance(self.finding, NotAugmented) else ""

    @property
    def refits_not_converged(self) -> tuple[str, ...]:
        """Avalanches whose refit did not converge, before or after, in the order of the campaign."""
        held = (self.before, self.after)
        failed = {event for one in held if one is not None for event in one.not_converged}
        return tuple(event for event in self.problem.campaign.event_ids if event in failed)

    @property
    def converged(self) -> bool:
        """Whether every number of the verdict rests on chains that converged."""
        return not self.refits_not_converged and not self.reason

    @property
    def steps(self) -> tuple[Step, ...]:
        """The mechanisms added, none or more."""
        return self.finding.steps if isinstance(self.finding, Augmented) else ()

    @property
    def added(self) -> tuple[str, ...]:
        """Ids of what was added, in order of discovery."""
        if isinstance(self.finding, ProfileLaw):
            return (UNLISTED,)
        return tuple(step.candidate.mechanism.id for step in self.steps)

    @property
    def not_added(self) -> tuple[str, ...]:
        """What the comparison names where it could not be added: the name that leads, and its ties."""
        if self.steps:
            return ()
        return decide(self.comparison.probability, self.check.p_value, self.table.can_tell).names

    @property
    def reference(self) -> Calibration:
        """The base law's calibration that before refers to."""
        return self.finding.reference if isinstance(self.finding, Augmented) else self.calibration

    @property
    def left(self) -> Left | None:
        """What a last comparison of the augmented law found and was not added."""
        return self.finding.left if isinstance(self.finding, Augmented | NotAugmented) else None


Outcome = Diagnosis | NotDiagnosed
