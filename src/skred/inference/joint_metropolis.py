"""PyMC's Metropolis with a joint, adapted proposal, several moves a draw inside numba.

PyMC's own moves one scalar at a time and evaluates the density twice a move; on the strongly
correlated parameters of a friction law its chains crawl. Here all parameters move together, with
the covariance of the chain so far (Haario, Saksman and Tamminen, 2001, doi 10.2307/3318737) and a
scale driven to the acceptance that is best in few dimensions (Roberts and Rosenthal, 2001, doi
10.1214/ss/1015346320). Adaptation ends with tuning; the draws come from a fixed kernel.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pymc as pm
from numba import njit
from numpy.typing import NDArray
from pymc.blocking import RaveledVars
from pymc.pytensorf import compile as compile_pytensor
from pymc.pytensorf import join_nonshared_inputs
from pymc.step_methods.metropolis import MetropolisState
from pymc.step_methods.state import dataclass_state

FloatArray = NDArray[np.float64]
MOVES_PER_DRAW = 10
"""Moves between two draws that are kept; the others would be all but copies."""
TARGET_ACCEPTANCE = {1: 0.44, 2: 0.35}
_TARGET_ELSE = 0.25
_FORGET_UNTIL = 10
"""Adaptation steps after which the chain's past counts in full (the start is forgotten)."""


@njit(error_model="numpy")
def _run_moves(density, q, log_density, factor, normals, log_uniforms):  # type: ignore[no-untyped-def]
    """Metropolis moves in place; returns (log density, moves accepted, mean acceptance)."""
    n_moves, n = normals.shape
    accepted = 0
    acceptance = 0.0
    proposal = np.empty(n)
    for move in range(n_moves):
        for i in range(n):
            proposal[i] = q[i]
            for j in range(i + 1):
                proposal[i] += factor[i, j] * normals[move, j]
        proposed = density(proposal)[0].item()
        difference = proposed - log_density
        if np.isnan(difference):
            difference = -np.inf
        acceptance += np.exp(min(difference, 0.0))
        if log_uniforms[move] < difference:
            q[:] = proposal
            log_density = proposed
            accepted += 1
    return log_density, accepted, acceptance / n_moves


@dataclass_state
class JointMetropolisState(MetropolisState):
    """PyMC's state and what the adaptation has learnt."""

    mean: np.ndarray
    covariance: np.ndarray
    adaptations: int
    log_scale: float


class JointMetropolis(pm.Metropolis):  # type: ignore[misc]
    """Random-walk Metropolis on all variables at once.

    Parameters
    ----------
    vars : list, optional
        Variables to sample; all continuous ones by default.
    moves_per_draw : int
        Metropolis moves between two draws.
    model, rng, initial_point :
        As in `pymc.Metropolis`.
    """

    name = "joint_metropolis"
    default_blocked = True  # as a class attribute: PyMC reads it before __init__
    _state_class = JointMetropolisState

    def __init__(
        self,
        vars: list[Any] | None = None,
        *,
        moves_per_draw: int = MOVES_PER_DRAW,
        model: pm.Model | None = None,
        rng: Any = None,
        initial_point: dict[str, Any] | None = None,
        **kwargs: Any,
    ) -> None:
        model = pm.modelcontext(model)
        initial_point = model.initial_point() if initial_point is None else initial_point
        super().__init__(
            vars, model=model, rng=rng, initial_point=initial_point, **{**kwargs, "blocked": True}
        )
        if self.any_discrete:
            raise ValueError("JointMetropolis samples continuous variables only")
        self.elemwise_update = False
        self.moves_per_draw = moves_per_draw
        self._density = self._compile_density(model, initial_point)
        size = sum(int(np.prod(initial_point[v.name].shape)) for v in self.vars)
        self._start = 0.1 * np.eye(size)
        self.reset_tuning()

    def _compile_density(self, model: pm.Model, point: dict[str, Any]) -> Callable[..., Any]:
        """Compiled log density of the raveled variables, callable from numba."""
        shared = {}
        [log_density], raveled = join_nonshared_inputs(
            point=point, outputs=[model.logp()], inputs=self.vars, shared_inputs=shared
        )
        function = compile_pytensor([raveled], log_density, mode="NUMBA")
        density: Callable[..., Any] = function.vm.jit_fn
        return density

    def reset_tuning(self) -> None:
        """Forget what was learnt."""
        super().reset_tuning()
        if hasattr(self, "_start"):
            self.mean, self.covariance = np.zeros(len(self._start)), self._start.copy()
            self.adaptations, self.log_scale = 0, 0.0
            self._factor = np.linalg.cholesky(self.covariance)

    def astep(self, q0: RaveledVars) -> tuple[RaveledVars, list[dict[str, float]]]:
        """One draw: some moves and, while tuning, one step of adaptation."""
        q = np.array(q0.data, dtype=float)
        size = len(q)
        normals = self.rng.standard_normal((self.moves_per_draw, size))
        log_uniforms = np.log(self.rng.random(self.moves_per_draw))
        factor = np.exp(self.log_scale) * self._factor
        log_density, accepted, acceptance = _run_moves(
            self._density, q, float(self._density(q)[0]), factor, normals, log_uniforms
        )
        if self.tune:
            self._adapt(q, acceptance)
        stats = {
            "scaling": float(np.exp(self.log_scale)),
            "accept": acceptance,
            "accepted": accepted / self.moves_per_draw,
        }
        return RaveledVars(q, q0.point_map_info), [stats]

    def _adapt(self, q: FloatArray, acceptance: float) -> None:
        """Recursive covariance, and Robbins-Monro on the scale."""
        size = len(q)
        self.adaptations += 1
        weight = 1.0 / min(self.adaptations + 1, max(_FORGET_UNTIL, self.adaptations / 2))
        if self.adaptations == 1:
            self.mean = q.copy()
        deviation = q - self.mean
        self.mean = self.mean + weight * deviation
        self.covariance = (1 - weight) * (self.covariance + weight * np.outer(deviation, deviation))
        self.log_scale += (acceptance - TARGET_ACCEPTANCE.get(size, _TARGET_ELSE)) / self.adaptations**0.6
        proposal = 2.38**2 / size * self.covariance + 1e-10 * np.trace(self.covariance) * np.eye(size)
        self._factor = np.linalg.cholesky(proposal)
