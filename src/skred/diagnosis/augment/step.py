"""What comes of adding mechanisms to a law: the steps, or why there are none."""

from __future__ import annotations

from dataclasses import dataclass

from skred.diagnosis.check.bootstrap_test import BootstrapTest
from skred.diagnosis.compare.candidate import Candidate
from skred.diagnosis.compare.comparison import Comparison
from skred.inference.calibrate import Calibration


@dataclass(frozen=True, eq=False)
class Step:
    """One mechanism added.

    Attributes
    ----------
    candidate : Candidate
        The one that was added.
    tied : tuple of str
        Ids that the recordings cannot tell from it.
    comparison : Comparison
        In which it led.
    calibration : Calibration
        Of the augmented law.
    check : BootstrapTest
        The bootstrap test of the augmented law.
    """

    candidate: Candidate
    tied: tuple[str, ...]
    comparison: Comparison
    calibration: Calibration
    check: BootstrapTest


@dataclass(frozen=True)
class Left:
    """What a last comparison, of the augmented law, found and was not added.

    Attributes
    ----------
    comparison : Comparison
    reason : str
        Why what it would name was not added.
    """

    comparison: Comparison
    reason: str = ""


@dataclass(frozen=True, eq=False)
class Augmented:
    """A law with mechanisms added.

    Attributes
    ----------
    steps : tuple of Step
        One or two, in order of discovery.
    reference : Calibration
        Of the base law under the error model of the last step, so that before and after differ by what was
        added alone.
    left : Left or None
        None where there was no comparison after the last addition.
    """

    steps: tuple[Step, ...]
    reference: Calibration
    left: Left | None = None


@dataclass(frozen=True, eq=False)
class NotAugmented:
    """What the comparison named could not be added: a calibration did not converge.

    Attributes
    ----------
    reason : str
    left : Left or None
        As of a law with mechanisms added, where it got so far.
    """

    reason: str
    left: Left | None = None
