"""What is costly and shared: the Ryggfonn problem, compiled models, one calibration, and its quadrature."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import halfnorm

# Two tests at a time fill two cores: threads and processes beside them would wait for each other, and each
# process imports everything anew. Tests of threads and processes say how many they want.
os.environ.setdefault("OMP_NUM_THREADS", "1")


@pytest.fixture(scope="session")
def problem() -> Any:
    """M2 and its peers are calibrated on this."""
    from skred.campaign import find_campaign, read_campaign
    from skred.inference.pooled.problem import pooled_problem

    return pooled_problem(read_campaign(find_campaign("ryggfonn")))


@pytest.fixture(scope="session")
def two_releases(problem: Any) -> Any:
    """The same recordings, every other avalanche from 700 m further down."""
    events = [
        replace(event, release_s_m=700.0 * (number % 2))
        for number, event in enumerate(problem.campaign.events)
    ]
    return replace(problem, campaign=replace(problem.campaign, events=tuple(events)))


@pytest.fixture(scope="session")
def model_of(problem: Any) -> Callable[[str], Any]:
    """A law's model on Ryggfonn, built once."""
    from skred.physics.laws import load_law

    return cache(lambda law_id: load_law(law_id).build(problem))


@pytest.fixture(scope="session")
def calibration(problem: Any) -> Any:
    """M2 as `python -m models.pcm` calibrates it."""
    from skred.inference.calibrate import calibrate
    from skred.inference.sampling import SamplerSettings
    from skred.physics.laws import load_law

    return calibrate(problem, load_law("pcm"), SamplerSettings(draws=1000, tune=500, chains=4, seed=1))


@dataclass(frozen=True, eq=False)
class Quadrature:
    """A posterior summed on a regular grid of its parameters."""

    nodes: np.ndarray
    """(n_nodes, n_parameters)"""
    log_joint: np.ndarray
    """(n_nodes,), prior times likelihood times the volume of a cell."""
    pointwise: np.ndarray
    """(n_nodes, n_events) log likelihood."""

    @property
    def log_evidence(self) -> float:
        return float(logsumexp(self.log_joint))

    @property
    def weights(self) -> np.ndarray:
        return np.asarray(np.exp(self.log_joint - self.log_evidence))

    @property
    def mean(self) -> np.ndarray:
        return self.weights @ self.nodes

    @property
    def sd(self) -> np.ndarray:
        return np.sqrt(self.weights @ (self.nodes - self.mean) ** 2)

    def quantile(self, parameter: int, probability: float) -> float:
        places, cell = np.unique(self.nodes[:, parameter], return_inverse=True)
        below = np.cumsum(np.bincount(cell, self.weights))
        upper_ends = places + 0.5 * (places[1] - places[0])
        return float(np.interp(probability, below, upper_ends))

    @property
    def leave_one_out(self) -> np.ndarray:
        """Log density of each event given all others."""
        return self.log_evidence - logsumexp(self.log_joint[:, None] - self.pointwise, axis=0)


def quadrature(problem: Any, law: Any, upper: list[float], n: int) -> Quadrature:
    """Midpoints of n cells a parameter between 0 and `upper`; the law's priors are half-normal."""
    axes = [(np.arange(n) + 0.5) * end / n for end in upper]
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(upper))
    pointwise = problem.log_density(law.mechanisms, nodes)
    scales = [mechanism.strength.prior_scale for mechanism in law.mechanisms]
    log_joint = pointwise.sum(axis=1) + halfnorm.logpdf(nodes, scale=scales).sum(axis=1)
    return Quadrature(nodes, log_joint + np.log(np.prod(upper) / n ** len(upper)), pointwise)


UPPER = {"pcm": [0.6, 0.012], "coulomb": [1.5], "constant": [12.0]}
"""Ends of the grids, far beyond the posterior (a test looks)."""


@pytest.fixture(scope="session")
def quadrature_of(problem: Any) -> Callable[[str], Quadrature]:
    from skred.physics.laws import load_law

    def of(law_id: str) -> Quadrature:
        return quadrature(problem, load_law(law_id), UPPER[law_id], 400 if law_id == "pcm" else 20_000)

    return cache(of)
