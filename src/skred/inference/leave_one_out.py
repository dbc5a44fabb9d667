"""Leave-one-event-out: by smoothed weights, and exactly, the posterior refitted without each event."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import arviz_stats as az
import numpy as np
import pymc as pm
import pytensor.tensor as pt
import xarray as xr
from pymc.blocking import DictToArrayBijection
from scipy.special import logsumexp

from skred.arrays import FloatArray
from skred.inference.gate import R_HAT_LIMIT
from skred.inference.joint_metropolis import JointMetropolis
from skred.parallel.threads import side_by_side

Samples = dict[str, FloatArray]
REFIT_CHAINS, REFIT_DRAWS, REFIT_BURN = 4, 500, 100
"""Draws of models of one or two parameters; chains of more are longer."""
_LONGER = 4
"""How many times as long chains are that are run once more, because they had not converged."""
_BATCHES = 5
"""Batches of each chain from whose means the Monte Carlo error is taken."""


@dataclass(frozen=True)
class ExactLoo:
    """Expected log predictive density of each event from the posterior without it.

    Attributes
    ----------
    pointwise : (n,) array
        Of the events that were left out, in their order.
    mcse : float
        Monte Carlo standard error of the sum.
    failed : tuple of str
        Events whose refit did not converge; a comparison must not hang on them.
    draws : (n, n_chains, n_draws, n_q) array
        Raveled values of the (transformed) variables by the other events, see `samples_of`.
    """

    pointwise: FloatArray
    mcse: float
    failed: tuple[str, ...]
    draws: FloatArray = field(default_factory=lambda: np.empty(0), repr=False)

    @property
    def elpd(self) -> float:
        """Sum over events."""
        return float(self.pointwise.sum())

    @property
    def se(self) -> float:
        """Standard error of the sum over events like these."""
        return float(np.sqrt(len(self.pointwise) * np.var(self.pointwise, ddof=1)))


def exact_leave_one_out(
    model: pm.Model,
    step: JointMetropolis,
    events: Sequence[str],
    seed: int,
    which: Sequence[int] | None = None,
    near: Mapping[str, FloatArray] | None = None,
) -> ExactLoo:
    """Refit without each event and predict it; chains go in threads, each with random numbers of its own.

    Each chain of a refit starts from another draw of the posterior of all events. From one start in common
    all could stay at a mode that few draws lead out of, and would agree.

    Parameters
    ----------
    model : pymc.Model
    step : JointMetropolis
        Made with ``pointwise="recordings"``.
    events : sequence of str
        Ids, in the order of the pointwise terms.
    seed : int
    which : sequence of int, optional
        Numbers of the events to leave out; by default all.
    near : mapping, optional
        Draws of the posterior of all events by name of parameter, (n,) each; where there are none, chains
        start where a model's do by default.
    """
    left_out = list(range(len(events)) if which is None else which)
    rng = np.random.default_rng([seed, 2])
    starts = _starts(model, step, near, rng)
    # Proposals adapt to the posterior of all events for as long as a chain is: 500 are too few for
    # seven parameters, whose refits then converge only now and then.
    step.adapt(starts[0], _n_draws(starts[0]), rng)
    draws, densities = _refits(step, starts, left_out, rng, 1)
    r_hat = _r_hat(draws)
    again = np.flatnonzero(~(r_hat <= R_HAT_LIMIT))
    if len(again):
        longer = _refits(step, starts, [left_out[k] for k in again], rng, _LONGER)
        r_hat[again] = _r_hat(longer[0])
        draws[again], densities[again] = (values[:, :, ::_LONGER] for values in longer)
    failed = tuple(events[k] for k, value in zip(left_out, r_hat, strict=True) if not value <= R_HAT_LIMIT)
    pointwise = logsumexp(densities, axis=(1, 2)) - np.log(densities[0].size)
    return ExactLoo(pointwise, float(np.sqrt(np.sum(_mcse(densities) ** 2))), failed, draws)


def samples_of(model: pm.Model, step: JointMetropolis, draws: FloatArray) -> tuple[Samples, ...]:
    """Draws of refits, as `ExactLoo` has them, as arrays by name of parameter for each event.

    Every parameter is a scalar, and none's range depends on another.
    """
    columns = draws.reshape(len(draws), -1, draws.shape[-1])
    result: list[Samples] = [{} for _ in columns]
    for k, value in enumerate(step.vars):
        variable = model.values_to_rvs[value]
        transform, found = model.rvs_to_transforms[variable], columns[:, :, k]
        if transform is not None:
            # Compiled as quickly as can be: it runs once.
            untransformed = transform.backward(pt.as_tensor(found), *variable.owner.inputs)
            found = np.asarray(untransformed.eval(mode="FAST_COMPILE"))
        for samples, values in zip(result, found, strict=True):
            samples[variable.name] = values
    return tuple(result)


def _starts(
    model: pm.Model, step: JointMetropolis, near: Mapping[str, FloatArray] | None, rng: np.random.Generator
) -> FloatArray:
    """Where the chains of a refit start, (n_chains, n_q): raveled values of the (transformed) variables."""
    if near is None:
        point = DictToArrayBijection.map(model.initial_point()).data.astype(float)
        return np.tile(point, (REFIT_CHAINS, 1))
    columns = list[FloatArray]()
    chosen = rng.choice(len(next(iter(near.values()))), REFIT_CHAINS, replace=False)
    for value in step.vars:
        variable = model.values_to_rvs[value]
        transform, found = model.rvs_to_transforms[variable], near[variable.name][chosen]
        if transform is not None:
            transformed = transform.forward(pt.as_tensor(found), *variable.owner.inputs)
            found = np.asarray(transformed.eval(mode="FAST_COMPILE"))
        columns.append(found)
    return np.column_stack(columns)


def _refits(
    step: JointMetropolis,
    starts: FloatArray,
    left_out: Sequence[int],
    rng: np.random.Generator,
    longer: int,
) -> tuple[FloatArray, FloatArray]:
    """Draws without each event, (n, n_chains, n_draws, n_q), and its log density there."""
    numbers = np.repeat(left_out, REFIT_CHAINS)
    begin = np.tile(starts, (len(left_out), 1))
    jobs = list(zip(begin, numbers.tolist(), rng.spawn(len(numbers)), strict=True))
    chains = side_by_side(lambda job: _refit(step, *job, longer), jobs)
    draws, densities = (np.array(parts) for parts in zip(*chains, strict=True))
    shape = len(left_out), REFIT_CHAINS
    return draws.reshape(*shape, *draws.shape[1:]), densities.reshape(*shape, *densities.shape[1:])


def _refit(
    step: JointMetropolis, q: FloatArray, number: int, rng: np.random.Generator, longer: int
) -> tuple[FloatArray, FloatArray]:
    """A chain without an event: its draws, and the event's log density there."""
    weights = np.ones(step.n_terms)
    weights[number] = 0.0
    step.run(q, longer * REFIT_BURN, rng, weights)
    draws, terms = step.run(q, longer * _n_draws(q), rng, weights)
    return draws, terms[:, number].copy()  # a view would keep the terms of all events


def _n_draws(q: FloatArray) -> int:
    """Draws of a chain, by the number of parameters."""
    return REFIT_DRAWS * max(1, (len(q) + 1) // 2)


def _r_hat(draws: FloatArray) -> FloatArray:
    """Largest r-hat over parameters of (event, chain, draw, parameter) draws, for each event."""
    array = xr.DataArray(draws, dims=("refit", "chain", "draw", "q"), name="q_value")
    r_hat: FloatArray = az.rhat(array.to_dataset())["q_value"].max("q").values
    return r_hat


def _mcse(densities: FloatArray) -> FloatArray:
    """Standard error of each event's log mean density, from batches of its chains."""
    relative = np.exp(densities - densities.max(axis=(1, 2), keepdims=True))
    batches = np.array(np.split(relative, _BATCHES, axis=2)).mean(axis=3)
    n_batches = _BATCHES * densities.shape[1]
    spread = batches.std(axis=(0, 2), ddof=1) / np.sqrt(n_batches)
    error: FloatArray = spread / batches.mean(axis=(0, 2))
    return error


@contextmanager
def large_k_shown_elsewhere() -> Iterator[None]:
    """Silence ArviZ's warnings of large Pareto k: tables show them, and such events are refitted."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Estimated shape parameter", category=UserWarning)
        yield
