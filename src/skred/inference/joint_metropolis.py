"""PyMC's Metropolis with joint, adapted proposals, several moves a draw inside numba.

PyMC's own moves one scalar at a time and evaluates the density twice a move. Here all parameters
move together (`metropolis_chain`), with the mean and covariance of the chain so far (Haario,
Saksman and Tamminen, 2001, doi 10.2307/3318737) and a scale of the walks driven to the acceptance
that is best in few dimensions (Roberts and Rosenthal, 2001, doi 10.1214/ss/1015346320). Adaptation
ends with tuning; the draws come from a fixed kernel.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
import pymc as pm
import pytensor.tensor as pt
from numba import typeof, types
from pymc.blocking import RaveledVars
from pymc.logprob.transforms import LogTransform
from pymc.pytensorf import compile as compile_pytensor
from pymc.pytensorf import join_nonshared_inputs
from pymc.step_methods.metropolis import MetropolisState
from pymc.step_methods.state import dataclass_state

from skred.arrays import FloatArray
from skred.inference.metropolis_chain import DEGREES_OF_FREEDOM, chain_for

MOVES_PER_DRAW = 4
"""Moves between two draws that are kept, half of them jumps. Draws after fewer moves are nearly copies."""
_BLOCK = 100
"""Draws made in one call after tuning, when proposals are fixed."""
TARGET_ACCEPTANCE = {1: 0.44, 2: 0.35}
"""Acceptance that is best for one and two parameters (Roberts and Rosenthal, 2001, doi
10.1214/ss/1015346320)."""
_TARGET_ELSE = 0.25
"""Acceptance for more parameters: near the best one of many, 0.234 (the same)."""
_FORGET_UNTIL = 10
"""Adaptation steps after which the chain's past counts in full (the start is forgotten)."""


def _moved_themselves(model: pm.Model, values: Sequence[Any], straight: Collection[str]) -> list[bool]:
    """Which values are to be moved themselves, of those that PyMC has as logarithms."""
    variables = [model.values_to_rvs[value] for value in values]
    if unknown := set(straight) - {variable.name for variable in variables}:
        raise ValueError(f"{sorted(unknown)} are no variables that this step samples")
    transforms = [model.rvs_to_transforms[variable] for variable in variables]
    return [
        variable.name in straight and isinstance(transform, LogTransform)
        for variable, transform in zip(variables, transforms, strict=True)
    ]


class _WithoutDensity:
    """A model for PyMC's own step, without a density: PyMC would compile one that is not used here."""

    def __init__(self, model: pm.Model) -> None:
        self._model = model

    def __getattr__(self, name: str) -> Any:
        if name == "_model":  # not there yet: while it is unpickled
            raise AttributeError(name)
        return getattr(self._model, name)

    def logp(self) -> Any:
        """Any scalar that depends on the variables."""
        return pt.add(*(value.sum() for value in self._model.value_vars), 0.0)


@dataclass_state
class JointMetropolisState(MetropolisState):
    """PyMC's state, and that of the adaptation, of each coordinates that moves are made in."""

    mean: np.ndarray
    covariance: np.ndarray
    factor: np.ndarray
    log_scale: np.ndarray
    adaptations: int


class JointMetropolis(pm.Metropolis):
    """Metropolis on all variables at once, random walk and independent jumps by turns.

    Parameters
    ----------
    vars : list, optional
        Variables to sample; all continuous ones by default.
    moves_per_draw : int
        Metropolis moves between two draws; every second one is a jump. At least two in each coordinates.
    pointwise : str, optional
        Observed variable whose terms `run` can weigh one by one, as exact leave-one-out needs.
    straight : collection of str
        Positive variables that half of the moves are made in themselves, not in their logarithms: where one
        takes over from another in a straight line, the logarithm of what is left of it falls without bound.
    model, rng, initial_point :
        As in `pymc.Metropolis`.

    Attributes
    ----------
    moved : (n,) bool array
        Which of the raveled values are moved themselves, too.

    Raises
    ------
    ValueError
        For discrete variables, and names in `straight` of none that are sampled.
    """

    name = "joint_metropolis"
    default_blocked = True  # as a class attribute: PyMC reads it before __init__
    _state_class = JointMetropolisState

    def __init__(
        self,
        vars: list[Any] | None = None,
        *,
        moves_per_draw: int = MOVES_PER_DRAW,
        pointwise: str | None = None,
        straight: Collection[str] = (),
        model: pm.Model | None = None,
        rng: Any = None,
        initial_point: dict[str, Any] | None = None,
        **kwargs: Any,
    ) -> None:
        model = pm.modelcontext(model)
        initial_point = model.initial_point() if initial_point is None else initial_point
        kwargs["blocked"] = True
        super().__init__(vars, model=_WithoutDensity(model), rng=rng, initial_point=initial_point, **kwargs)
        if self.any_discrete:
            raise ValueError("JointMetropolis samples continuous variables only")
        self.elemwise_update = False
        moved = _moved_themselves(model, self.vars, straight)
        self.moved = np.repeat(moved, [initial_point[v.name].size for v in self.vars])
        self._n_coordinates = 2 if self.moved.any() else 1
        self.moves_per_draw = max(moves_per_draw, 2 * (self._n_coordinates - 1))
        self._density, self._data = self._compile_density(model, initial_point, pointwise)
        data = self._data_values()
        self.n_terms = len(self._density(np.zeros(len(self.moved)), *data)[1])
        [signature] = self._density.nopython_signatures
        self._chain = chain_for(types.FunctionType(signature), typeof(data))
        self.reset_tuning()

    def _compile_density(
        self, model: pm.Model, point: dict[str, Any], pointwise: str | None
    ) -> tuple[Any, list[Any]]:
        """(log density without the pointwise terms, those terms) of the raveled variables, in numba.

        And the containers of its further arguments: variables that another step samples, and data
        that may be set anew (`pymc.Data`).
        """
        observed = model[pointwise] if pointwise else None
        others = [v for v in model.basic_RVs if v is not observed]
        rest = model.logp(vars=[*others, *model.potentials])
        terms = model.logp(vars=observed, sum=False)[0].ravel() if pointwise else pt.zeros(0)
        elsewhere = {v: self.shared[v.name] for v in model.value_vars if v.name in self.shared}
        outputs, raveled = join_nonshared_inputs(
            point=point, outputs=[rest, terms], inputs=self.vars, shared_inputs=elsewhere
        )
        function = compile_pytensor([raveled], outputs, mode="NUMBA")
        return function.vm.jit_fn, function.input_storage[1:]

    def _data_values(self) -> tuple[Any, ...]:
        # No copies, or tables of many nodes would be copied for each draw of the tuning.
        return tuple(np.require(container.storage[0], requirements=("C", "W")) for container in self._data)

    def reset_tuning(self) -> None:
        """Reset the adaptation."""
        super().reset_tuning()
        if hasattr(self, "moved"):
            self.adaptations, self.log_scale = 0, np.zeros(self._n_coordinates)
            self._begin_with(np.ones((2, len(self.moved))))
            self.mean = np.zeros((self._n_coordinates, len(self.moved)))
            self._forget_block()

    def _begin_with(self, sizes: FloatArray) -> None:
        """Proposals of a third of some sizes, (2, n)."""
        steps = 0.1 * sizes[: self._n_coordinates, :, None] ** 2
        self.covariance = steps * np.eye(sizes.shape[1])
        self.factor = np.linalg.cholesky(self.covariance)

    def _forget_block(self) -> None:
        """Drop draws that were made in advance."""
        self._block, self._used = np.empty((0, len(self.moved))), 0
        self._stood, self._stats = np.empty(0), {"accept": 0.0, "accepted": 0.0}

    def _coordinates(self, q: FloatArray) -> FloatArray:
        """Raveled values of the variables in each coordinates, (n_coordinates, n)."""
        return np.array([q, np.exp(q, out=q.copy(), where=self.moved)][: self._n_coordinates])

    def astep(self, q0: RaveledVars) -> tuple[RaveledVars, list[dict[str, float]]]:
        """One draw: some moves and, while tuning, one step of adaptation."""
        q = np.array(q0.data, dtype=float)
        if self.tune:
            self._stats = self._tuned(q, self.rng)
        else:
            q = self._next_of_block(q)
        stats = {"scaling": float(np.exp(self.log_scale[0])), **self._stats}
        return RaveledVars(q, q0.point_map_info), [stats]

    def _next_of_block(self, q: FloatArray) -> FloatArray:
        """The draw after q, from the present block of draws, or from a new block if q was changed."""
        if self._used >= len(self._block) or not np.array_equal(q, self._stood):
            self._block, _, accepted, acceptance = self._run(q, _BLOCK, self.rng, with_terms=False)
            self._stats = {"accept": float(acceptance.mean()), "accepted": accepted}
            self._used = 0
        self._stood = self._block[self._used]
        self._used += 1
        return self._stood.copy()

    def adapt(self, q: FloatArray, n_draws: int, rng: np.random.Generator) -> None:
        """Forget, then adapt over `n_draws` draws from `q`, which is changed in place."""
        self.reset_tuning()
        for _ in range(n_draws):
            self._tuned(q, rng)

    def run(
        self, q: FloatArray, n_draws: int, rng: np.random.Generator, weights: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Draw with the present proposal, without adapting; may be called from several threads.

        Parameters
        ----------
        q : (n,) array, changed in place
            Raveled values of the (transformed) variables.
        n_draws : int
        rng : numpy Generator
        weights : (n_terms,) array, optional
            Of the pointwise terms; by default all are 1.

        Returns
        -------
        draws : (n_draws, n) array
        terms : (n_draws, n_terms) array
            The pointwise log densities, unweighted.
        """
        return self._run(q, n_draws, rng, with_terms=True, weights=weights)[:2]

    def _run(
        self,
        q: FloatArray,
        n_draws: int,
        rng: np.random.Generator,
        *,
        with_terms: bool,
        weights: FloatArray | None = None,
    ) -> tuple[FloatArray, FloatArray, float, FloatArray]:
        shape = (n_draws, self.moves_per_draw)
        noise, log_uniforms = rng.standard_normal((*shape, len(q))), np.log(rng.random(shape))
        jumps = noise[:, 1::2]
        jumps /= np.sqrt(rng.chisquare(DEGREES_OF_FREEDOM, jumps.shape[:2]) / DEGREES_OF_FREEDOM)[..., None]
        draws = np.empty((n_draws, len(q)))
        terms = np.empty((n_draws if with_terms else 0, self.n_terms))
        acceptance = np.zeros(self._n_coordinates)
        accepted = self._chain(
            self._density,
            self._data_values(),
            np.ones(self.n_terms) if weights is None else weights,
            self.moved,
            q,
            self.mean,
            self.factor,
            2.38 / np.sqrt(len(q)) * np.exp(self.log_scale),
            noise,
            log_uniforms,
            draws,
            terms,
            acceptance,
        )
        return draws, terms, accepted, acceptance

    def _tuned(self, q: FloatArray, rng: np.random.Generator) -> dict[str, float]:
        """One draw and one step of adaptation; statistics of the draw."""
        if not self.adaptations:
            self._begin_with(np.exp(np.multiply.outer((0.0, 1.0), np.where(self.moved, q, 0.0))))
        _, _, accepted, acceptance = self._run(q, 1, rng, with_terms=False)
        self._adapt(self._coordinates(q), acceptance)
        return {"accept": float(acceptance.mean()), "accepted": accepted}

    def _adapt(self, here: FloatArray, acceptance: FloatArray) -> None:
        """Recursive covariances, and Robbins-Monro on the scales."""
        size = here.shape[1]
        self.adaptations += 1
        weight = 1.0 / min(self.adaptations + 1, max(_FORGET_UNTIL, self.adaptations / 2))
        if self.adaptations == 1:
            self.mean = here
        away = here - self.mean
        self.mean = self.mean + weight * away
        self.covariance = (1 - weight) * (self.covariance + weight * away[:, :, None] * away[:, None, :])
        step = (acceptance - TARGET_ACCEPTANCE.get(size, _TARGET_ELSE)) / self.adaptations**0.6
        self.log_scale = self.log_scale + step
        floor = 1e-10 * self.covariance * np.eye(size)
        self.factor = np.linalg.cholesky(self.covariance + floor)
