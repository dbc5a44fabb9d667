"""Calibrate one law on one campaign: sample, check convergence, gather the results, write them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import arviz_stats as az
import pymc as pm
import xarray as xr

import skred.inference.hierarchical.results  # noqa: F401 - registers what it says of readings
import skred.inference.pooled.results  # noqa: F401 - likewise
from skred.arrays import FloatArray
from skred.inference.along_track import with_along_track
from skred.inference.gate import Gate, check_gate
from skred.inference.intervals import INTERVAL_KIND, INTERVAL_PROBABILITY, interval
from skred.inference.joint_metropolis import JointMetropolis
from skred.inference.log_prior import with_log_prior
from skred.inference.problem import Problem
from skred.inference.results import assemble, draws_by_name, save, summary
from skred.inference.sampling import SamplerSettings, sample_posterior, sample_prior
from skred.output import write_json
from skred.physics.law import Law, Parameter

MORE, LONGER = 4, 2
"""Factor on the number of draws in each further attempt, and the number of such attempts."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """A law calibrated on a campaign.

    Attributes
    ----------
    law, problem, settings :
        The law, the campaign with its likelihood, and how it was sampled.
    tree : DataTree
        See `skred.inference.results.assemble`.
    gate : Gate
    """

    law: Law
    problem: Problem
    settings: SamplerSettings
    tree: xr.DataTree
    gate: Gate

    @cached_property
    def model(self) -> pm.Model:
        """The law's model of the problem."""
        return self.law.build(self.problem)

    @cached_property
    def step(self) -> JointMetropolis:
        """The sampler's step, compiled for the model; every event's term can be weighted."""
        return _step(self.model, self.problem, self.law)

    @cached_property
    def whole_tree(self) -> xr.DataTree:
        """The tree with the densities of the priors, as it is written and handed out."""
        return with_log_prior(self.tree, self.model)

    def __getstate__(self) -> dict[str, Any]:
        """Without compiled functions and what they make; it is made again when it is needed."""
        again = ("model", "step", "whole_tree")
        return {name: value for name, value in vars(self).items() if name not in again}

    def entry(self) -> dict[str, Any]:
        """The calibration as plain data, with units: convergence, parameters, fit and predictions."""
        return {
            "id": self.law.id,
            "title": self.law.title,
            "equation": self.law.equation,
            "changed_priors": dict(self.law.changed_priors),
            "prior_note": self.law.prior_note,
            "gate": self.gate.as_dict(),
            "parameters": _parameter_rows(self.tree, self.problem.parameters(self.law)),
            **summary(self.problem, self.law, self.tree),
        }


def _step(model: pm.Model, problem: Problem, law: Law) -> JointMetropolis:
    return JointMetropolis(model=model, pointwise="recordings", straight=problem.moved_straight(law))


def calibrate(
    problem: Problem, law: Law, settings: SamplerSettings, *, progress: bool = False
) -> Calibration:
    """Sample the posterior of a law and check its convergence."""
    model = law.build(problem)
    prior = sample_prior(model, law, settings.seed)
    step = _step(model, problem, law)
    posterior = sample_posterior(model, law, problem, prior, settings, step=step, progress=progress)
    gate = check_gate(posterior, [parameter.name for parameter in problem.parameters(law)])
    gate = gate.with_numerical_problems(problem.numerical_problems(law, posterior["posterior"].to_dataset()))
    tree = assemble(problem, law, posterior, prior, gate, settings)
    found = Calibration(law, problem, settings, tree, gate)
    vars(found).update(model=model, step=step)  # compiled already
    return found


def calibrate_surely(problem: Problem, law: Law, settings: SamplerSettings) -> Calibration:
    """Calibrate, and repeat it where the convergence criteria are not met.

    First with finer numerics, as long as they are too rough and can be refined: rough numerics can create
    a mode that is not there, in which chains get stuck. The problem of the result is then the refined one.
    Then, as long as chains are too short, with `MORE` times the draws. Chains mix slowly along a curved
    ridge of two coefficients that compensate each other, and need that twice.
    """
    found = calibrate(problem, law, settings)
    while not found.gate.numerics:
        finer = found.problem.finer(law, found.tree["posterior"].to_dataset())
        if finer is None:
            break
        found = calibrate(finer, law, settings)
    for attempt in range(1, LONGER + 1):
        if found.gate.passed or not found.gate.chains_too_short:
            break
        times = MORE**attempt
        more = replace(settings, draws=times * settings.draws, tune=times * settings.tune)
        found = calibrate(found.problem, law, more)
    return found


def posterior_of(calibration: Calibration) -> dict[str, FloatArray]:
    """Draws of a calibration's parameters by name, chain after chain."""
    return draws_by_name(calibration.problem, calibration.law, calibration.tree["posterior"].to_dataset())


def write_calibration(calibration: Calibration, folder: Path) -> None:
    """Write ``posterior.nc`` and ``summary.json``, from which the figures of a calibration are made."""
    tree = with_along_track(calibration.whole_tree, calibration.law, calibration.problem)
    save(tree, folder / "posterior.nc")
    attributes = calibration.tree.attrs
    document = {
        "format": 1,
        "campaign": attributes["campaign"],
        "campaign_fingerprint": attributes["campaign_fingerprint"],
        "likelihood": attributes["likelihood"],
        "smoothing_m": attributes["smoothing_m"],
        "settings": calibration.settings.as_dict(),
        "versions": json.loads(attributes["versions"]),
        "interval": {"kind": INTERVAL_KIND, "probability": INTERVAL_PROBABILITY},
        **calibration.entry(),
    }
    write_json(folder / "summary.json", document)


def _parameter_rows(tree: xr.DataTree, parameters: Sequence[Parameter]) -> list[dict[str, Any]]:
    posterior = tree["posterior"].to_dataset()[[parameter.name for parameter in parameters]]
    bulk, tail = az.ess(posterior, method="bulk"), az.ess(posterior, method="tail")
    r_hat, mcse = az.rhat(posterior), az.mcse(posterior, method="mean")
    rows = []
    for parameter in parameters:
        name = parameter.name
        low, high = interval(posterior[name].values)
        rows.append(
            {
                "name": name,
                "symbol": parameter.symbol,
                "paper_symbol": parameter.paper_symbol,
                "unit": parameter.unit,
                "mean": float(posterior[name].mean()),
                "sd": float(posterior[name].std(ddof=1)),
                "low": low,
                "high": high,
                "ess_bulk": float(bulk[name]),
                "ess_tail": float(tail[name]),
                "r_hat": float(r_hat[name]),
                "mcse_mean": float(mcse[name]),
            }
        )
    return rows
