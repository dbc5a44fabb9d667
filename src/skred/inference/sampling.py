"""Drawing from the posterior of a law."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
import pymc as pm
import xarray as xr

from skred.inference.joint_metropolis import JointMetropolis
from skred.inference.problem import Problem
from skred.physics.law import Law

Sampler = Literal["metropolis", "nuts", "smc"]
KINKED = (
    "NUTS: the likelihood has kinks where a front just stops or just comes, which gradients do not see."
    " Chains may diverge or get stuck there; compare with the default sampler."
)
"""To be told where NUTS is asked for."""
TUNE = {"pooled": 500, "hierarchical": 1000}
"""Adaptation draws where none are asked for: more parameters take longer to adapt to."""
PRIOR_DRAWS = 1000
"""Draws of the prior that are kept for figures and starting points."""
_STARTS_TRIED = {"pooled": 250, "hierarchical": 20}
"""Draws of the prior among which a chain's start is the most probable one. A response of all avalanches may
have several modes, as where it stops between two sensors: of few draws none may lie near the largest."""


@dataclass(frozen=True)
class SamplerSettings:
    """How to sample.

    Attributes
    ----------
    sampler : {"metropolis", "nuts", "smc"}
    draws, tune, chains : int
        Draws kept per chain, adaptation draws before them, number of chains.
    seed : int
    """

    sampler: Sampler = "metropolis"
    draws: int = 1000
    tune: int = 500
    chains: int = 4
    seed: int = 0

    def as_dict(self) -> dict[str, Any]:
        """Plain data for files."""
        return asdict(self)


def sample_prior(model: pm.Model, law: Law, seed: int, draws: int = PRIOR_DRAWS) -> xr.Dataset:
    """Prior draws of the free random variables, (chain, draw)."""
    names = [variable.name for variable in model.free_RVs]
    with quiet_pymc():
        tree = pm.sample_prior_predictive(draws, model, var_names=names, random_seed=seed)
    return tree["prior"].to_dataset()


def sample_posterior(
    model: pm.Model,
    law: Law,
    problem: Problem,
    prior: xr.Dataset,
    settings: SamplerSettings,
    *,
    step: JointMetropolis | None = None,
    progress: bool = False,
) -> xr.DataTree:
    """Posterior and sample_stats of a law's model.

    Chains of Metropolis and NUTS start each from the most likely of some draws of its own: of the prior, so
    that starts are overdispersed and yet not on the plateau where no front moves, or of what the problem
    knows already of the posterior (`Problem.to_start_from`).
    `step` is for Metropolis, if there is one compiled already.
    """
    with model, quiet_pymc():
        if settings.sampler == "smc":
            return pm.sample_smc(
                draws=settings.draws,
                chains=settings.chains,
                cores=1,
                random_seed=settings.seed,
                progressbar=progress,
                compute_convergence_checks=False,
            )
        if settings.sampler == "nuts":
            step = pm.NUTS(model=model)
        tree = pm.sample(
            draws=settings.draws,
            tune=settings.tune,
            chains=settings.chains,
            cores=1,  # a chain takes less time than starting a process
            step=step or JointMetropolis(model=model),
            initvals=starting_points(law, problem, prior, settings),
            random_seed=settings.seed,
            progressbar=progress,
            compute_convergence_checks=False,
        )
    sizes = tree["posterior"].sizes
    if (sizes["chain"], sizes["draw"]) != (settings.chains, settings.draws):
        raise KeyboardInterrupt  # PyMC swallows it and hands over what there is, as if it were whole
    return tree


def starting_points(
    law: Law, problem: Problem, prior: xr.Dataset, settings: SamplerSettings
) -> list[dict[str, Any]]:
    """One starting point for each chain: the most probable of some draws that are its own.

    Parameters
    ----------
    law : Law
    problem : Problem
    prior : Dataset
        Draws of the prior, (chain, draw).
    settings : SamplerSettings
        Number of chains, and the seed of what the problem knows already.
    """
    samples = {str(name): variable.values.ravel() for name, variable in prior.data_vars.items()}
    chains = settings.chains
    n = min(_STARTS_TRIED[problem.likelihood], prior.sizes["chain"] * prior.sizes["draw"] // chains)
    first = {name: values[: n * chains] for name, values in samples.items()}
    first = problem.to_start_from(law, first, settings.seed)
    log_density = problem.log_likelihood(law, first).sum(axis=1).reshape(chains, n)
    best = np.nan_to_num(log_density, nan=-np.inf).argmax(axis=1) + n * np.arange(chains)
    return [{name: first[name][i] for name in first} for i in best]


@contextmanager
def quiet_pymc() -> Iterator[None]:
    """Silence PyMC's log of its stages; the commands say in their own words what goes on."""
    logger = logging.getLogger("pymc")
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        yield
    finally:
        logger.setLevel(level)
