"""Everything that is computed for the comparison with the paper, before a word is written."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import arviz_stats as az
import numpy as np
from numpy.typing import NDArray

from skred.inference.calibrate import calibrate
from skred.inference.evidence import evidence
from skred.inference.gate import Gate
from skred.inference.sampling import SamplerSettings
from skred.physics.laws import load_law
from studies.reproduction.cases import (
    BASELINE,
    LAWS,
    SHORT,
    Case,
    Outcome,
    all_cases,
    baseline_case,
    outcome,
)
from studies.reproduction.facts import fit_means

FloatArray = NDArray[np.float64]
PAPER = {"coulomb": (0.47,), "pcm": (0.2, 3e-3), "constant": (4.5,)}
"""The paper's figures for the laws' strengths."""
LC, CD, B, RUNOUT = range(4)
SPEEDS_FIT = "LC, CD, b"
STOPS_FIT = "LC, CD, b, stops counted as latent speeds"
Tell = Callable[[str], None]


@dataclass(frozen=True)
class ChainCheck:
    """One parameter by both routes: PyMC's Metropolis, and the grid.

    Attributes
    ----------
    law_id, name, unit : str
    mean, mcse_mean, sd, mcse_sd : float
        Of the chains, with Monte Carlo standard errors.
    grid_mean, grid_sd : float
    """

    law_id: str
    name: str
    unit: str
    mean: float
    mcse_mean: float
    sd: float
    mcse_sd: float
    grid_mean: float
    grid_sd: float

    @property
    def z_mean(self) -> float:
        """Difference of the means in Monte Carlo standard errors."""
        return (self.mean - self.grid_mean) / self.mcse_mean

    @property
    def z_sd(self) -> float:
        """Difference of the standard deviations in Monte Carlo standard errors."""
        return (self.sd - self.grid_sd) / self.mcse_sd


@dataclass(frozen=True, eq=False)
class EvidenceCheck:
    """Log evidence by sequential Monte Carlo (one for each seed) and by the grid."""

    law_id: str
    smc: tuple[float, ...]
    grid: float


@dataclass(frozen=True, eq=False)
class Fit:
    """Least squares of a law against the plain means of what was recorded."""

    law_id: str
    what: str
    strengths: FloatArray
    readings: FloatArray


@dataclass(frozen=True, eq=False)
class Study:
    """All results.

    Attributes
    ----------
    cases : list of Case
        The baseline first.
    outcomes : dict
        `Outcome` by case key and law id.
    chains, evidences : list
        The two routes to the baseline.
    gates : dict
        Of the chains, by law id.
    fits : list of Fit
    plain_mean : (n_sensors,) array
        Means of the readings that exist.
    """

    cases: list[Case]
    outcomes: dict[tuple[str, str], Outcome]
    chains: list[ChainCheck]
    evidences: list[EvidenceCheck]
    gates: dict[str, Gate]
    fits: list[Fit]
    plain_mean: FloatArray

    def speeds_fit(self, law_id: str, what: str = SPEEDS_FIT) -> FloatArray:
        """Strengths from least squares of the plain mean speeds, or of other means."""
        return next(f.strengths for f in self.fits if (f.law_id, f.what) == (law_id, what))

    @property
    def base(self) -> Case:
        """The baseline."""
        return self.cases[0]

    @property
    def crown_m(self) -> float:
        """Arc length of the dam's crown, zero of the runouts that are reported."""
        return float(self.base.problem.campaign.reference_s_m or 0.0)

    def baseline(self, law_id: str) -> Outcome:
        """The baseline's posterior of a law."""
        return self.outcomes[BASELINE, law_id]

    def of_law(self, law_id: str) -> list[Outcome]:
        """All outcomes of a law, in the order of the cases."""
        return [self.outcomes[case.key, law_id] for case in self.cases]


def run_study(seed: int, *, quick: bool = False, tell: Tell = lambda line: None) -> Study:
    """Compute everything.

    Parameters
    ----------
    seed : int
        Of the chains; the grid needs none.
    quick : bool
        Coarser grids and fewer draws, to try things out.
    tell : callable
        Told one line for each stage.
    """
    base = baseline_case()
    cells = 101 if quick else None
    cases, outcomes = all_cases(base), {}
    for case in cases:
        tell(case.title)
        for law_id in LAWS:
            # A grid of one parameter is cheap: never coarser.
            outcomes[case.key, law_id] = outcome(case, law_id, cells if law_id == "pcm" else None)
    chains: list[ChainCheck] = []
    evidences, gates = [], {}
    for law_id in LAWS:
        tell(f"{SHORT[law_id]}: Metropolis and sequential Monte Carlo")
        rows, evidence_check, gates[law_id] = _second_route(
            base, outcomes[BASELINE, law_id], seed, quick=quick
        )
        chains += rows
        evidences.append(evidence_check)
    plain_mean = np.nanmean(base.problem.values, axis=0)
    return Study(cases, outcomes, chains, evidences, gates, plain_fits(base, plain_mean), plain_mean)


def _second_route(
    base: Case, grid: Outcome, seed: int, *, quick: bool
) -> tuple[list[ChainCheck], EvidenceCheck, Gate]:
    """The baseline by the chains and by SMC, beside the grid."""
    law = load_law(grid.law_id)
    calibration = calibrate(base.problem, law, SamplerSettings(seed=seed))
    posterior = calibration.tree["posterior"].to_dataset()[law.parameter_names]
    mcse_mean, mcse_sd = az.mcse(posterior, method="mean"), az.mcse(posterior, method="sd")
    rows = [
        ChainCheck(
            law.id,
            parameter.name,
            parameter.unit,
            float(posterior[parameter.name].mean()),
            float(mcse_mean[parameter.name]),
            float(posterior[parameter.name].std(ddof=1)),
            float(mcse_sd[parameter.name]),
            float(grid.posterior.mean[number]),
            float(grid.posterior.sd[number]),
        )
        for number, parameter in enumerate(law.parameters)
    ]
    seeds = [10 * seed + k + 1 for k in range(2 if quick else 4)]
    smc = evidence(calibration.model, seeds, draws=300 if quick else 1000)
    return rows, EvidenceCheck(law.id, smc.log_evidence, grid.posterior.log_evidence), calibration.gate


def plain_fits(base: Case, plain_mean: FloatArray) -> list[Fit]:
    """Least squares against plain means: what an optimisation on the same recordings gives."""
    variance = np.diag(base.problem.covariance)
    speeds = np.array([1.0, 1.0, 1.0, 0.0])
    only = {"LC only": np.eye(4)[LC], "runout only": np.eye(4)[RUNOUT]}
    wanted = {
        SPEEDS_FIT: speeds,
        **only,
        "LC and runout, each over its variance": (only["LC only"] + only["runout only"]) / variance,
        "all four, each over its variance": 1.0 / variance,
    }
    fits = []
    for law_id in LAWS:
        for what, weights in wanted.items():
            if law_id == "pcm" and what in only:
                continue  # one number leaves a curve of (a0, a2), not a point
            strengths, readings = fit_means(base.problem, base.mechanisms(law_id), plain_mean, weights)
            fits.append(Fit(law_id, what, strengths, readings))
        latent = base.problem.recorded_mean
        strengths, readings = fit_means(base.problem, base.mechanisms(law_id), latent, speeds)
        fits.append(Fit(law_id, STOPS_FIT, strengths, readings))
    return fits
