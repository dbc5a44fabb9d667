"""PyMC's Metropolis with joint, adapted proposals, several moves a draw inside numba.

PyMC's own moves one scalar at a time and evaluates the density twice a move. Here all parameters
move together, by turns in two ways: a random walk with the covariance of the chain so far (Haario,
Saksman and Tamminen, 2001, doi 10.2307/3318737) and a scale driven to the acceptance that is best in
few dimensions (Roberts and Rosenthal, 2001, doi 10.1214/ss/1015346320), which gets anywhere; and a
jump to an independent draw from a Student t with the chain's mean and covariance (Tierney, 1994, doi
10.1214/aos/1176325750), which forgets at once where the posterior is nearly normal. Adaptation
ends with tuning; the draws come from a fixed kernel.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from functools import cache
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
from pytensor.graph.replace import graph_replace

from skred.arrays import FloatArray
from skred.parallel.compile_cache import compiled, inner

MOVES_PER_DRAW = 4
"""Moves between two draws that are kept, half of them jumps. Draws after fewer moves are nearly copies."""
DEGREES_OF_FREEDOM = 6.0
"""Degrees of freedom of the jumps. Their tails must be heavier than the posterior's, or chains get stuck."""
_BLOCK = 100
"""Draws made in one call after tuning, when proposals are fixed."""
TARGET_ACCEPTANCE = {1: 0.44, 2: 0.35}
"""Acceptance that is best for one and two parameters (Roberts and Rosenthal, 2001, doi
10.1214/ss/1015346320)."""
_TARGET_ELSE = 0.25
"""Acceptance for more parameters: near the best one of many, 0.234 (the same)."""
_FORGET_UNTIL = 10
"""Adaptation steps after which the chain's past counts in full (the start is forgotten)."""


@inner()
def _weighted_sum(rest, pointwise, weights):  # type: ignore[no-untyped-def]
    """Log density of the model with every pointwise term weighted; NaN becomes -inf."""
    total = rest.item()
    for i in range(weights.size):
        if weights[i] != 0.0:
            total += weights[i] * pointwise[i]
    return -np.inf if np.isnan(total) else total


@inner()
def _log_t(z):  # type: ignore[no-untyped-def]
    """Log density of a multivariate Student t at standardised z, but for its constant."""
    square = 0.0
    for i in range(z.size):
        square += z[i] * z[i]
    return -0.5 * (DEGREES_OF_FREEDOM + z.size) * np.log1p(square / DEGREES_OF_FREEDOM)


@inner()
def _standardise(x, mean, factor, z):  # type: ignore[no-untyped-def]
    """Solve x = mean + factor z."""
    for i in range(x.size):
        z[i] = x[i] - mean[i]
        for j in range(i):
            z[i] -= factor[i, j] * z[j]
        z[i] /= factor[i, i]


@inner()
def _add_product(start, factor, z, result):  # type: ignore[no-untyped-def]
    """Write start + factor z to `result`."""
    for i in range(z.size):
        result[i] = start[i]
        for j in range(i + 1):
            result[i] += factor[i, j] * z[j]


def _run_chain(  # type: ignore[no-untyped-def]
    density, data, weights, q, mean, factor, scale, noise, log_uniforms, draws, terms
):
    """Metropolis moves, (n_draws, n_moves) of them: walks and jumps by turns.

    `q` is left at the last state; the state after each n_moves is stored in `draws`, and the
    pointwise terms there in `terms` unless that is empty. Returns the share of all moves that was
    accepted and the mean probability of acceptance of the walks.
    """
    # Eleven parameters: compiled for a signature of plain arrays, some of which it fills.
    n_draws, n_moves, n = noise.shape
    accepted, acceptance, n_walks = 0, 0.0, 0
    proposal, z = np.empty(n), np.empty(n)
    walk = scale * factor
    rest, pointwise = density((q, *data))
    current = _weighted_sum(rest, pointwise, weights)
    for draw in range(n_draws):
        for move in range(n_moves):
            is_walk = move % 2 == 0
            correction = 0.0
            if is_walk:
                _add_product(q, walk, noise[draw, move], proposal)
            else:
                _add_product(mean, factor, noise[draw, move], proposal)
                _standardise(q, mean, factor, z)
                correction = _log_t(z) - _log_t(noise[draw, move])
            rest, pointwise = density((proposal, *data))
            proposed = _weighted_sum(rest, pointwise, weights)
            # Both -inf: accept, so that a chain can leave a place of no density.
            difference = proposed - current + correction if proposed > -np.inf or current > -np.inf else 0.0
            if is_walk:
                n_walks += 1
                acceptance += np.exp(min(difference, 0.0))
            if log_uniforms[draw, move] < difference:
                for i in range(n):
                    q[i] = proposal[i]
                current = proposed
                accepted += 1
        for i in range(n):
            draws[draw, i] = q[i]
        if terms.size > 0:
            _, pointwise = density((q, *data))
            for i in range(pointwise.size):
                terms[draw, i] = pointwise[i]
    return accepted / (n_draws * n_moves), acceptance / n_walks


@cache
def _chain_for(density: types.FunctionType, data: types.BaseTuple) -> Callable[..., tuple[float, float]]:
    """`_run_chain` for densities of a signature, which it calls through a pointer.

    Given the density itself numba would compile chain and kernel into one, 5 to 10 s for each model
    and no faster to run.
    """
    scalar, vector, matrix, cube = (types.Array(types.float64, n, "C") for n in range(4))
    signature = (
        density, data, vector, vector, vector, matrix, types.float64, cube, matrix, matrix, matrix
    )  # fmt: skip
    chain: Callable[..., tuple[float, float]] = compiled(signature)(_run_chain)
    return chain


def _is_moved_itself(model: pm.Model, value: Any, straight: Collection[str]) -> bool:
    """Whether a value that PyMC has as a logarithm is to be moved itself."""
    variable = model.values_to_rvs[value]
    return variable.name in straight and isinstance(model.rvs_to_transforms[variable], LogTransform)


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
    """PyMC's state, and the state of the adaptation."""

    mean: np.ndarray
    covariance: np.ndarray
    factor: np.ndarray
    adaptations: int
    log_scale: float


class JointMetropolis(pm.Metropolis):
    """Metropolis on all variables at once, random walk and independent jumps by turns.

    Parameters
    ----------
    vars : list, optional
        Variables to sample; all continuous ones by default.
    moves_per_draw : int
        Metropolis moves between two draws; every second one is a jump.
    pointwise : str, optional
        Observed variable whose terms `run` can weigh one by one, as exact leave-one-out needs.
    straight : collection of str
        Positive variables that proposals move themselves, not their logarithms: where one takes over from
        another in a straight line, the logarithm of what is left of it falls without bound.
    model, rng, initial_point :
        As in `pymc.Metropolis`.

    Raises
    ------
    ValueError
        For discrete variables.
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
        self.moves_per_draw = moves_per_draw
        moved = [_is_moved_itself(model, v, straight) for v in self.vars]
        self._density, self._data = self._compile_density(model, initial_point, pointwise, moved)
        self._moved = np.repeat(moved, [initial_point[v.name].size for v in self.vars])
        data = self._data_values()
        self.n_terms = len(self._density(np.ones(len(self._moved)), *data)[1])
        [signature] = self._density.nopython_signatures
        self._chain = _chain_for(types.FunctionType(signature), typeof(data))
        self.reset_tuning()

    def _compile_density(
        self, model: pm.Model, point: dict[str, Any], pointwise: str | None, moved: Sequence[bool]
    ) -> tuple[Any, list[Any]]:
        """(log density without the pointwise terms, those terms) of the raveled coordinates, in numba.

        And the containers of its further arguments: variables that another step samples, and data
        that may be set anew (`pymc.Data`).
        """
        observed = model[pointwise] if pointwise else None
        others = [v for v in model.basic_RVs if v is not observed]
        rest = model.logp(vars=[*others, *model.potentials])
        terms = model.logp(vars=observed, sum=False)[0].ravel() if pointwise else pt.zeros(0)
        elsewhere = {v: self.shared[v.name] for v in model.value_vars if v.name in self.shared}
        itself = {v: v.clone() for v, is_moved in zip(self.vars, moved, strict=True) if is_moved}
        if itself:
            logarithms = {v: pt.log(x) for v, x in itself.items()}
            rest, terms = graph_replace([rest, terms], logarithms)
            rest = rest - sum(x.sum() for x in logarithms.values())  # a density of the variables themselves
        inputs = [itself.get(v, v) for v in self.vars]
        outputs, raveled = join_nonshared_inputs(
            point=point, outputs=[rest, terms], inputs=inputs, shared_inputs=elsewhere
        )
        function = compile_pytensor([raveled], outputs, mode="NUMBA")
        return function.vm.jit_fn, function.input_storage[1:]

    def _data_values(self) -> tuple[Any, ...]:
        # No copies, or tables of many nodes would be copied for each draw of the tuning.
        return tuple(np.require(container.storage[0], requirements=("C", "W")) for container in self._data)

    def reset_tuning(self) -> None:
        """Reset the adaptation."""
        super().reset_tuning()
        if hasattr(self, "_moved"):
            self.mean = np.zeros(len(self._moved))
            self.adaptations, self.log_scale = 0, 0.0
            self._begin_around(np.ones(len(self._moved)))
            self._forget_block()

    def _begin_around(self, moved: FloatArray) -> None:
        """Steps to begin with: a third, of variables that are moved themselves a third of their size."""
        self.covariance = 0.1 * np.diag(np.where(self._moved, moved, 1.0) ** 2)
        self.factor = np.linalg.cholesky(self.covariance)

    def _forget_block(self) -> None:
        """Drop draws that were made in advance."""
        self._block, self._used = np.empty((0, len(self._moved))), 0
        self._stood, self._stats = np.empty(0), {"accept": 0.0, "accepted": 0.0}

    def _coordinates(self, q: FloatArray) -> FloatArray:
        """What proposals move, from raveled values of the variables; a copy."""
        return np.asarray(np.exp(q, out=np.array(q, dtype=float), where=self._moved))

    def _values(self, moved: FloatArray) -> FloatArray:
        """Raveled values of the variables, from what proposals move; a copy."""
        return np.asarray(np.log(moved, out=np.array(moved), where=self._moved))

    def astep(self, q0: RaveledVars) -> tuple[RaveledVars, list[dict[str, float]]]:
        """One draw: some moves and, while tuning, one step of adaptation."""
        q = np.array(q0.data, dtype=float)
        if self.tune:
            moved = self._coordinates(q)
            self._stats = self._tuned(moved, self.rng)
            q = self._values(moved)
        else:
            q = self._next_of_block(q)
        stats = {"scaling": float(np.exp(self.log_scale)), **self._stats}
        return RaveledVars(q, q0.point_map_info), [stats]

    def _next_of_block(self, q: FloatArray) -> FloatArray:
        """The draw after q, from the present block of draws, or from a new block if q was changed."""
        if self._used >= len(self._block) or not np.array_equal(q, self._stood):
            draws, _, accepted, acceptance = self._run(
                self._coordinates(q), _BLOCK, self.rng, with_terms=False
            )
            self._block = self._values(draws)
            self._stats = {"accept": acceptance, "accepted": accepted}
            self._used = 0
        self._stood = self._block[self._used]
        self._used += 1
        return self._stood.copy()

    def adapt(self, q: FloatArray, n_draws: int, rng: np.random.Generator) -> None:
        """Forget, then adapt over `n_draws` draws from `q`, which is changed in place."""
        self.reset_tuning()
        moved = self._coordinates(q)
        for _ in range(n_draws):
            self._tuned(moved, rng)
        q[:] = self._values(moved)

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
        moved = self._coordinates(q)
        draws, terms, _, _ = self._run(moved, n_draws, rng, with_terms=True, weights=weights)
        q[:] = self._values(moved)
        return self._values(draws), terms

    def _run(
        self,
        q: FloatArray,
        n_draws: int,
        rng: np.random.Generator,
        *,
        with_terms: bool,
        weights: FloatArray | None = None,
    ) -> tuple[FloatArray, FloatArray, float, float]:
        shape = (n_draws, self.moves_per_draw)
        noise, log_uniforms = rng.standard_normal((*shape, len(q))), np.log(rng.random(shape))
        jumps = noise[:, 1::2]
        jumps /= np.sqrt(rng.chisquare(DEGREES_OF_FREEDOM, jumps.shape[:2]) / DEGREES_OF_FREEDOM)[..., None]
        draws = np.empty((n_draws, len(q)))
        terms = np.empty((n_draws if with_terms else 0, self.n_terms))
        scale = 2.38 / np.sqrt(len(q)) * float(np.exp(self.log_scale))
        accepted, acceptance = self._chain(
            self._density,
            self._data_values(),
            np.ones(self.n_terms) if weights is None else weights,
            q,
            self.mean,
            self.factor,
            scale,
            noise,
            log_uniforms,
            draws,
            terms,
        )
        return draws, terms, accepted, acceptance

    def _tuned(self, moved: FloatArray, rng: np.random.Generator) -> dict[str, float]:
        """One draw and one step of adaptation; statistics of the draw."""
        if not self.adaptations:
            self._begin_around(moved)
        _, _, accepted, acceptance = self._run(moved, 1, rng, with_terms=False)
        self._adapt(moved, acceptance)
        return {"accept": acceptance, "accepted": accepted}

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
        floor = 1e-10 * np.trace(self.covariance) * np.eye(size)
        self.factor = np.linalg.cholesky(self.covariance + floor)
