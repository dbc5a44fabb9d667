"""Calibrate one law on one campaign: sample, gate, gather, write."""

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

from skred.inference.along_track import with_along_track
from skred.inference.gate import Gate, check_gate
from skred.inference.intervals import INTERVAL_KIND, INTERVAL_PROBABILITY, interval
from skred.inference.joint_metropolis import JointMetropolis
from skred.inference.problem import Problem
from skred.inference.results import assemble, save
from skred.inference.sampling import SamplerSettings, sample_posterior, sample_prior
from skred.output import write_json
from skred.physics.law import Law, Parameter

MORE, LONGER = 4, 2
"""How many times the draws a further attempt makes, and how many attempts with more there are."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """A law calibrated on a campaign.

    Attributes
    ----------
    law, problem, settings :
        What was asked for.
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
        """Compiled for the model, its event terms weightable."""
        return JointMetropolis(model=self.model, pointwise="recordings")

    def __getstate__(self) -> dict[str, Any]:
        """Without what is compiled: it is compiled anew where it is asked for."""
        return {name: value for name, value in vars(self).items() if name not in ("model", "step")}

    def entry(self) -> dict[str, Any]:
        """The calibration as plain data: gate, parameters and mean response, with units."""
        return {
            "id": self.law.id,
            "title": self.law.title,
            "equation": self.law.equation,
            "gate": self.gate.as_dict(),
            "parameters": _parameter_rows(self.tree, self.problem.parameters(self.law)),
            **self.problem.summary(self.law, self.tree),
        }


def calibrate(
    problem: Problem, law: Law, settings: SamplerSettings, *, progress: bool = False
) -> Calibration:
    """Sample the posterior of a law and diagnose it."""
    model = law.build(problem)
    prior = sample_prior(model, law, settings.seed)
    step = JointMetropolis(model=model, pointwise="recordings")
    posterior = sample_posterior(model, law, problem, prior, settings, step=step, progress=progress)
    gate = check_gate(posterior, [parameter.name for parameter in problem.parameters(law)])
    gate = gate.with_numerical_problems(problem.numerical_problems(law, posterior["posterior"].to_dataset()))
    tree = assemble(problem, law, posterior, prior, gate, settings)
    found = Calibration(law, problem, settings, tree, gate)
    vars(found).update(model=model, step=step)  # there already: not to be compiled again
    return found


def calibrate_surely(problem: Problem, law: Law, settings: SamplerSettings) -> Calibration:
    """As `calibrate`, and again where the gate failed.

    With finer numerics as long as those were too rough and can be made finer: the calibration's problem is
    then another than was given. Chains can be stuck in a mode that only rough numerics make. Then, as long as
    chains are too short, with `MORE` times the draws: along a bent ridge of two strengths that stand for each
    other chains go slowly, and need that twice.
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


def write_calibration(calibration: Calibration, folder: Path) -> None:
    """Write ``posterior.nc`` and ``summary.json``, from which the figures of a calibration are made."""
    tree = with_along_track(calibration.tree, calibration.law, calibration.problem)
    save(tree, folder / "posterior.nc")
    attributes = calibration.tree.attrs
    summary = {
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
    write_json(folder / "summary.json", summary)


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
