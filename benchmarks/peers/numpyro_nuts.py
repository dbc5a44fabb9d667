"""NumPyro's NUTS on the same model written in JAX: `lax.scan` over the cells, double precision."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax

jax.config.update("jax_enable_x64", True)  # before anything of JAX is made

# ruff: noqa: E402
import jax.numpy as jnp
import numpy as np
import numpyro
import numpyro.distributions as dist
from jax import lax
from jax.scipy.special import log_ndtr, ndtr
from numpy.typing import NDArray
from numpyro.infer import NUTS, init_to_value
from scipy.special import roots_legendre

from benchmarks.peers.common import PARAMETERS, Drawn, FloatArray, cpu_seconds, near_the_mode
from benchmarks.peers.forward import Track, cross, march_step, read, track_of
from models.pcm import DRAG, DRY
from skred.inference.pooled.problem import PooledProblem

CHAINS = 4
_NODE, _WEIGHT = roots_legendre(40)
_SCALE = {"dry_friction": DRY.strength.prior_scale, "turbulent_drag": DRAG.strength.prior_scale}


def readings(track: Track, mu: Any, drag: Any) -> Any:
    """Readings of one front, (n_sensors,)."""
    # The first cell apart: there, and only there, a front at rest may start.
    v, distance = cross(jnp, jnp.zeros(()), tuple(track.cells[:, 0]), mu, drag)

    def step(carry: Any, cell: Any) -> Any:
        v, s = carry
        ahead = march_step(jnp, v, s, cell, mu, drag)
        return ahead, ahead[0]

    start = (v, track.release + distance)
    (_, runout), speeds = lax.scan(step, start, tuple(jnp.asarray(track.cells[:, 1:])))
    v_at_edges = jnp.concatenate([jnp.zeros(1), v[None], speeds])
    return jnp.append(read(jnp, track, v_at_edges[track.sensor_cell], runout, mu, drag), runout)


def _orthant_of_two(mean: Any, factor: FloatArray) -> Any:
    """Log probability that x = mean + factor z is nowhere positive, by quadrature over the first z."""
    upper = jnp.minimum(-mean[0] / factor[0, 0], 8.5)
    width = jnp.where(upper > 0.0, upper + 8.5, upper + jnp.sqrt(upper * upper + 72.0))
    z = upper - 0.5 * width * (1.0 - _NODE)
    inner = ndtr((-mean[1] - factor[1, 0] * z) / factor[1, 1])
    total = jnp.sum(_WEIGHT * jnp.exp(-0.5 * z * z) * inner)
    return jnp.log(0.5 * width * total / np.sqrt(2.0 * np.pi))


class _Censored(NamedTuple):
    """An event that did not reach some sensors: their latent readings given the observed ones."""

    event: int
    sensors: NDArray[np.int64]
    regression: FloatArray
    factor: FloatArray


def _recordings(problem: PooledProblem) -> tuple[FloatArray, FloatArray, float, list[_Censored]]:
    """Readings, what whitens them, the densities' constant, and the censored events.

    From the recordings and Sigma, not from the arrays of skred's density: a second route.
    """
    sigma, observed = problem.covariance, problem.observed
    whiten = np.zeros((*observed.shape, observed.shape[1]))
    constant, censored = 0.0, []
    for event in range(len(observed)):
        seen, missed = np.flatnonzero(observed[event]), np.flatnonzero(problem.not_reached[event])
        own = np.linalg.cholesky(sigma[np.ix_(seen, seen)])
        whiten[event][np.ix_(np.arange(len(seen)), seen)] = np.linalg.inv(own)
        constant -= np.log(np.diag(own)).sum() + 0.5 * len(seen) * np.log(2.0 * np.pi)
        if len(missed) > 2:
            raise ValueError("this peer knows events that did not reach one or two sensors")
        if len(missed):
            across = sigma[np.ix_(missed, seen)]
            regression = np.zeros((len(missed), observed.shape[1]))
            regression[:, seen] = np.linalg.solve(sigma[np.ix_(seen, seen)], across.T).T
            conditional = sigma[np.ix_(missed, missed)] - regression[:, seen] @ across.T
            censored.append(_Censored(event, missed, regression, np.linalg.cholesky(conditional)))
    return np.where(observed, problem.values, 0.0), whiten, constant, censored


def make_log_density(problem: PooledProblem) -> Callable[[Any, Any], Any]:
    """Log density of all events together as a function of the two strengths."""
    track = track_of(problem)
    values, whiten, constant, censored = _recordings(problem)

    def log_density(mu: Any, drag: Any) -> Any:
        row = readings(track, mu, drag)
        residual = values - row
        whitened = jnp.einsum("eij,ej->ei", whiten, residual)
        total = constant - 0.5 * jnp.sum(whitened * whitened)
        for event, sensors, regression, factor in censored:
            mean = row[sensors] + regression @ residual[event]
            one = len(sensors) == 1
            total += log_ndtr(-mean[0] / factor[0, 0]) if one else _orthant_of_two(mean, factor)
        return total

    return log_density


def log_density(problem: PooledProblem, strengths: FloatArray) -> FloatArray:
    """Log likelihood as this peer has it: (n, 2) to (n,)."""
    return np.array(jax.jit(jax.vmap(make_log_density(problem)))(*np.asarray(strengths).T))


def sample(problem: PooledProblem, seed: int, *, draws: int, tune: int) -> Drawn:
    """Four chains with NumPyro's defaults, started near the mode, one after the other.

    NumPyro's kernel is driven by `lax.scan` here and not by its `MCMC`, which compiles parts anew in
    every run: so the peer pays no compilation under the name of sampling.
    """
    start = near_the_mode(problem)
    started = cpu_seconds()
    log_density = make_log_density(problem)

    def model() -> None:
        strengths = [numpyro.sample(name, dist.HalfNormal(_SCALE[name])) for name in PARAMETERS]
        numpyro.factor("recordings", log_density(*strengths))

    kernel = NUTS(model, init_strategy=init_to_value(values=start))
    keys = jax.random.split(jax.random.key(seed), CHAINS)
    state = kernel.init(keys[0], tune, None, (), {})

    def chain(state: Any) -> Any:
        state = lax.fori_loop(0, tune, lambda _, state: kernel.sample(state, (), {}), state)
        _, kept = lax.scan(lambda state, _: _with_values(kernel.sample(state, (), {})), state, length=draws)
        return kept

    compiled = jax.jit(chain).lower(state).compile()
    ready = cpu_seconds()
    chains = [compiled(state._replace(rng_key=key)) for key in keys]
    drawn = np.exp([np.stack([kept[name] for name in PARAMETERS], axis=-1) for kept in chains])
    return Drawn(drawn, cpu_seconds() - ready, ready - started)


def _with_values(state: Any) -> Any:
    """State, and the log strengths to keep of it."""
    return state, state.z
