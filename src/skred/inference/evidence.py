"""Evidence by sequential Monte Carlo, over several seeds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pymc as pm
from numpy.typing import NDArray

from skred.inference.sampling import quiet_pymc

SMC_DRAWS = 1000
"""Particles of sequential Monte Carlo: half of PyMC's default; what they leave open shows between seeds."""
_CHAINS = 2
"""Independent runs for each seed: the fewest that show whether they agree."""


@dataclass(frozen=True)
class Evidence:
    """Log marginal likelihood of the recordings under a law.

    Attributes
    ----------
    log_evidence : tuple of float
        One for each seed.
    """

    log_evidence: tuple[float, ...]

    @property
    def mean(self) -> float:
        """Mean over seeds."""
        return float(np.mean(self.log_evidence))

    @property
    def spread(self) -> float:
        """Largest minus smallest over seeds."""
        return float(np.ptp(self.log_evidence))


def evidence(model: pm.Model, seeds: Sequence[int], draws: int = SMC_DRAWS) -> Evidence:
    """Estimate the evidence, each seed with two independent chains."""
    estimates = []
    for seed in seeds:
        with model, quiet_pymc():
            tree = pm.sample_smc(
                draws=draws,
                chains=_CHAINS,
                cores=1,
                random_seed=seed,
                progressbar=False,
                compute_convergence_checks=False,
            )
        estimates.append(_log_evidence(tree["sample_stats"]["log_marginal_likelihood"].values))
    return Evidence(tuple(estimates))


def _log_evidence(values: NDArray[Any]) -> float:
    """Last finite value of each chain (PyMC pads an array of objects), averaged as evidence."""
    chains = []
    for chain in values:
        numbers = np.hstack([np.ravel(np.asarray(value, dtype=float)) for value in np.ravel(chain)])
        chains.append(numbers[np.isfinite(numbers)][-1])
    return float(np.logaddexp.reduce(chains) - np.log(len(chains)))
