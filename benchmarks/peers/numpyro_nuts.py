"""NumPyro's NUTS on the same model written in JAX: `lax.scan` over the cells, double precision."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax

jax.config.update("jax_enable_x64", True)  # before anything of JAX is made

# ruff: noqa: E402
import jax.numpy as jnp
import numpy as np
import numpyro
import numpyro.distributions as dist
from jax import lax
from jax.scipy.special import log_ndtr, ndtr
from numpyro.infer import MCMC, NUTS, init_to_value
from scipy.special import roots_legendre

from models.pcm import DRAG, DRY
from peers.common import PARAMETERS, Drawn, FloatArray, cpu_seconds
from peers.forward import Track, cross, march_step, read, track_of
from skred.inference.problem import PooledProblem

CHAINS = 4
UNROLL = 1
_NODE, _WEIGHT = roots_legendre(24)
_SCALE = {"dry_friction": DRY.strength.prior_scale, "turbulent_drag": DRAG.strength.prior_scale}


def readings(track: Track, mu: Any, drag: Any) -> Any:
    """Readings of one front, (n_sensors,)."""
    # The first cell apart: there, and only there, a front at rest may start.
    v, distance = cross(jnp, jnp.zeros(()), tuple(track.cells[:, 0]), mu, drag)

    def step(carry: Any, cell: Any) -> Any:
        ahead = march_step(jnp, *carry, cell, mu, drag)
        return ahead, ahead[0]

    start = (v, track.release + distance)
    (_, runout), speeds = lax.scan(step, start, tuple(jnp.asarray(track.cells[:, 1:])), unroll=UNROLL)
    v_at_edges = jnp.concatenate([jnp.zeros(1), v[None], speeds])
    return jnp.append(read(jnp, track, v_at_edges[track.sensor_cell], runout, mu, drag), runout)


def _orthant_of_two(mean: Any, factor: FloatArray) -> Any:
    """Log probability that x = mean + factor z is nowhere positive; skred's quadrature, in JAX."""
    upper = jnp.minimum(-mean[0] / factor[0, 0], 8.5)
    width = jnp.where(upper > 0.0, upper + 8.5, upper + jnp.sqrt(upper * upper + 72.0))
    z = upper - 0.5 * width * (1.0 - _NODE)
    inner = ndtr((-mean[1] - factor[1, 0] * z) / factor[1, 1])
    total = jnp.sum(_WEIGHT * jnp.exp(-0.5 * z * z) * inner)
    return jnp.log(0.5 * width * total / np.sqrt(2.0 * np.pi))


def make_log_density(problem: PooledProblem) -> Callable[[Any, Any], Any]:
    """Log density of all events together as a function of the two strengths."""
    track, data = track_of(problem), problem.arrays
    if data.n_stopped.max() > 2:
        raise ValueError("this peer knows events that did not reach one or two sensors")
    censored = np.flatnonzero(data.n_stopped)

    def log_density(mu: Any, drag: Any) -> Any:
        row = readings(track, mu, drag)
        residual = data.readings - row
        whitened = jnp.einsum("eij,ej->ei", data.whiten, residual)
        total = data.constant.sum() - 0.5 * jnp.sum(whitened * whitened)
        for event in censored:
            size = data.n_stopped[event]
            mean = row[data.stopped[event, :size]] + data.regression[event, :size] @ residual[event]
            factor = data.factor[event]
            total += log_ndtr(-mean[0] / factor[0, 0]) if size == 1 else _orthant_of_two(mean, factor)
        return total

    return log_density


def log_density(problem: PooledProblem, strengths: FloatArray) -> FloatArray:
    """Log likelihood as this peer has it: (n, 2) to (n,)."""
    return np.array(jax.jit(jax.vmap(make_log_density(problem)))(*np.asarray(strengths).T))


def sample(problem: PooledProblem, seed: int, *, draws: int, tune: int) -> Drawn:
    """Four chains with NumPyro's defaults, from PyMC's initial point.

    Forward-mode derivatives, the better choice with two parameters, and chains one after the other:
    both were tried against their alternatives. The run is made twice, so that the time of the
    first beyond that of the second is the compilation.
    """
    log_density = make_log_density(problem)

    def model() -> None:
        strengths = [numpyro.sample(name, dist.HalfNormal(_SCALE[name])) for name in PARAMETERS]
        numpyro.factor("recordings", log_density(*strengths))

    started = cpu_seconds()
    kernel = NUTS(model, forward_mode_differentiation=True, init_strategy=init_to_value(values=_SCALE))
    sampler = MCMC(
        kernel,
        num_warmup=tune,
        num_samples=draws,
        num_chains=CHAINS,
        chain_method="sequential",
        progress_bar=False,
    )
    sampler.run(jax.random.key(seed + 1000))
    jax.block_until_ready(sampler.get_samples())
    ready = cpu_seconds()
    sampler.run(jax.random.key(seed))
    samples = sampler.get_samples(group_by_chain=True)
    drawn = np.stack([np.asarray(samples[name]) for name in PARAMETERS], axis=-1)
    sampling = cpu_seconds() - ready
    return Drawn(drawn, sampling, max(ready - started - sampling, 0.0))
