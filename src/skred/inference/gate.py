"""Convergence criteria: whether the chains of a calibration found the posterior.

They say nothing of fit, which `skred.inference.fit` checks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import arviz_stats as az
import numpy as np
import xarray as xr

R_HAT_LIMIT = 1.01
"""As recommended by Vehtari and others, 2021, doi 10.1214/20-BA1221."""
ESS_LIMIT = 400.0
"""As recommended by Vehtari and others, 2021, doi 10.1214/20-BA1221: 100 for each of four chains."""


@dataclass(frozen=True)
class Gate:
    """Diagnostics over all parameters of a posterior.

    Attributes
    ----------
    r_hat_max : float
        Largest rank-normalised split r-hat (Vehtari and others, 2021, doi 10.1214/20-BA1221).
    ess_bulk_min, ess_tail_min : float
        Smallest effective sample sizes.
    divergences : int
        Of NUTS; 0 for other samplers.
    problems : tuple of str
        What failed and what to do; empty if all criteria are met.
    numerics : bool
        Whether the numerics of the likelihood were good enough.
    """

    r_hat_max: float
    ess_bulk_min: float
    ess_tail_min: float
    divergences: int
    problems: tuple[str, ...]
    numerics: bool = True

    @property
    def passed(self) -> bool:
        """Whether all criteria are met."""
        return not self.problems

    @property
    def chains_too_short(self) -> bool:
        """Whether more draws could help."""
        return not (self.r_hat_max <= R_HAT_LIMIT and min(self.ess_bulk_min, self.ess_tail_min) >= ESS_LIMIT)

    def with_numerical_problems(self, more: Sequence[str]) -> Gate:
        """The same with numerical problems added, if there are any."""
        return replace(self, problems=(*self.problems, *more), numerics=not more)

    def as_dict(self) -> dict[str, Any]:
        """Plain data for files."""
        plain = asdict(self)
        plain.pop("numerics")
        return {"passed": self.passed, **plain, "problems": list(self.problems)}


def check_gate(tree: xr.DataTree, parameters: Sequence[str]) -> Gate:
    """Check the convergence of a posterior.

    Parameters
    ----------
    tree : DataTree
        With a posterior, and sample_stats where the sampler has them.
    parameters : sequence of str
        The free random variables.
    """
    posterior = tree["posterior"].to_dataset()[list(parameters)]
    # Chains that never moved have no variance: NaN, which fails below.
    with np.errstate(divide="ignore", invalid="ignore"):
        r_hat = _extreme(az.rhat(posterior), max)
        ess_bulk = _extreme(az.ess(posterior, method="bulk"), min)
        ess_tail = _extreme(az.ess(posterior, method="tail"), min)
    stats = tree["sample_stats"].to_dataset() if "sample_stats" in tree.children else xr.Dataset()
    divergences = int(stats["diverging"].sum()) if "diverging" in stats else 0
    problems = []
    # Written so that NaN fails too.
    apart = not r_hat <= R_HAT_LIMIT and _at_separate_modes(posterior)
    if apart:
        problems.append(
            f"r-hat {r_hat:.3f} exceeds {R_HAT_LIMIT}: chains have settled at separate modes, and longer ones"
            " would stay there; a calibration by sequential Monte Carlo weighs modes (sampler='smc', or"
            " skred calibrate --sampler smc)"
        )
    elif not r_hat <= R_HAT_LIMIT:
        problems.append(
            f"r-hat {r_hat:.3f} exceeds {R_HAT_LIMIT}: more draws for tuning (tune=, --tune), or look at"
            " the trace for modes"
        )
    for name, size in (("bulk", ess_bulk), ("tail", ess_tail)):
        if not size >= ESS_LIMIT and not apart:
            problems.append(
                f"{name} effective sample size {size:.0f} below {ESS_LIMIT:.0f}: more draws (draws=, --draws)"
            )
    if divergences:
        problems.append(
            f"{divergences} divergent transitions: use Metropolis"
            " (sampler='metropolis', --sampler metropolis)"
        )
    return Gate(r_hat, ess_bulk, ess_tail, divergences, tuple(problems))


def _at_separate_modes(posterior: xr.Dataset) -> bool:
    """Whether each chain has settled by itself, and two have no value of some parameter in common."""
    with np.errstate(divide="ignore", invalid="ignore"):
        by_itself = (posterior - posterior.mean("draw")) / posterior.std("draw")
        settled = _extreme(az.rhat(by_itself), max) <= R_HAT_LIMIT
    gap = posterior.min("draw").max("chain") - posterior.max("draw").min("chain")
    return settled and _extreme(gap, max) > 0.0


def _extreme(dataset: xr.Dataset, choose: Any) -> float:
    """Largest or smallest over all variables; NaN if any is."""
    values = np.concatenate([np.ravel(variable.values) for variable in dataset.data_vars.values()])
    return float("nan") if np.isnan(values).any() else float(choose(values))
