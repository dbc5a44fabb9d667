"""The base law under the error model of what was added: before and after then differ by that alone."""

from __future__ import annotations

from collections.abc import Callable

from skred.inference.calibrate import Calibration, calibrate_surely
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.parallel.processes import meanwhile


class Reference:
    """Calibrated by a helper while something else is done, if there is one.

    Parameters
    ----------
    calibration : Calibration
        Of the base law, under its own error model.
    """

    def __init__(self, calibration: Calibration) -> None:
        self._own = calibration
        self._begun: dict[str, Callable[[], Calibration]] = {}

    def begin(self, problem: HierarchicalProblem) -> None:
        """Have the base law calibrated on a problem that will probably be asked for."""
        if not self._is_own(problem) and problem.error_model.id not in self._begun:
            self._begun[problem.error_model.id] = self._asked(problem)

    def on(self, problem: HierarchicalProblem) -> tuple[Calibration, str]:
        """The base law calibrated on a problem, or as it is and why, if that cannot be trusted."""
        if self._is_own(problem):
            return self._own, ""
        name = problem.error_model.id
        again = (self._begun.get(name) or self._asked(problem))()
        if again.gate.passed:
            return again, ""
        why = f"the gate of {self._own.law.id} under {name} errors failed: {'; '.join(again.gate.problems)}"
        return self._own, why

    def _asked(self, problem: HierarchicalProblem) -> Callable[[], Calibration]:
        return meanwhile(calibrate_surely, problem, self._own.law, self._own.settings)

    def _is_own(self, problem: HierarchicalProblem) -> bool:
        own = self._own.problem
        assert isinstance(own, HierarchicalProblem)
        return problem.error_model.id == own.error_model.id
