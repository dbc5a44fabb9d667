"""The base law under the error model of what was added: before and after then differ by that alone."""

from __future__ import annotations

from collections.abc import Callable

from skred.inference.calibrate import Calibration, calibrate_surely
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.parallel.processes import meanwhile


def reference(calibration: Calibration, problem: HierarchicalProblem) -> Callable[[], Calibration]:
    """The base law calibrated on a problem, by a helper while something else is done, if there is one.

    Parameters
    ----------
    calibration : Calibration
        Of the base law, under its own error model: the answer if the problem has the same.
    """
    own = calibration.problem
    assert isinstance(own, HierarchicalProblem)
    if problem.error_model.id == own.error_model.id:
        return lambda: calibration
    return meanwhile(calibrate_surely, problem, calibration.law, calibration.settings)
