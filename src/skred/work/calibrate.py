"""Calibrate one law on one campaign: sample, gate, gather, write."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import arviz as az
import numpy as np
import pymc as pm
import xarray as xr

from skred.inference.gate import Gate, check_gate
from skred.inference.joint_metropolis import JointMetropolis
from skred.inference.problem import PooledProblem
from skred.inference.results import assemble, save
from skred.inference.sampling import SamplerSettings, sample_posterior, sample_prior
from skred.physics.law import Law
from skred.work.output import write_json

INTERVAL_KIND, INTERVAL_PROBABILITY = "equal-tailed", 0.9


@dataclass(frozen=True, eq=False)
class Calibration:
    """A law calibrated on a campaign.

    Attributes
    ----------
    law, problem, settings :
        What was asked for.
    model : pymc.Model
    step : JointMetropolis
        Compiled for this model, its event terms weightable.
    tree : DataTree
        See `skred.inference.results.assemble`.
    gate : Gate
    """

    law: Law
    problem: PooledProblem
    settings: SamplerSettings
    model: pm.Model
    step: JointMetropolis
    tree: xr.DataTree
    gate: Gate

    def entry(self) -> dict[str, Any]:
        """The calibration as plain data: gate, parameters and mean response, with units."""
        return {
            "id": self.law.id,
            "title": self.law.title,
            "equation": self.law.equation,
            "gate": self.gate.as_dict(),
            "parameters": _parameter_rows(self.tree, self.law),
            "response": _response_rows(self.tree, self.problem),
        }


def calibrate(
    problem: PooledProblem, law: Law, settings: SamplerSettings, *, progress: bool = False
) -> Calibration:
    """Sample the pooled posterior of a law and diagnose it."""
    model = law.build(problem)
    prior = sample_prior(model, law, settings.seed)
    step = JointMetropolis(model=model, pointwise="recordings")
    posterior = sample_posterior(model, law, problem, prior, settings, step=step, progress=progress)
    gate = check_gate(posterior, law.parameter_names)
    tree = assemble(problem, law, posterior, prior, gate, settings)
    return Calibration(law, problem, settings, model, step, tree, gate)


def write_calibration(calibration: Calibration, folder: Path) -> None:
    """Write ``posterior.nc``, ``summary.json`` and the figures of one calibration."""
    from skred.report.figures import save_model_figures

    save(calibration.tree, folder / "posterior.nc")
    save_model_figures(calibration.tree, calibration.law, calibration.problem, folder)
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


def _interval(values: Any) -> tuple[float, float]:
    """Equal-tailed interval."""
    tail = 0.5 * (1.0 - INTERVAL_PROBABILITY)
    low, high = np.quantile(np.ravel(values), [tail, 1.0 - tail])
    return float(low), float(high)


def _parameter_rows(tree: xr.DataTree, law: Law) -> list[dict[str, Any]]:
    posterior = tree["posterior"].to_dataset()[law.parameter_names]
    bulk, tail = az.ess(posterior, method="bulk"), az.ess(posterior, method="tail")
    r_hat, mcse = az.rhat(posterior), az.mcse(posterior, method="mean")
    rows = []
    for parameter in law.parameters:
        name = parameter.name
        low, high = _interval(posterior[name].values)
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


def _response_rows(tree: xr.DataTree, problem: PooledProblem) -> list[dict[str, Any]]:
    """Mean response at each sensor, averaged over the events, beside the recordings' mean."""
    response = tree["posterior_predictive"].to_dataset()["mean_response"]
    mean_over_events = response.isel(release=problem.release_of_event).mean("release")
    rows = []
    for number, sensor in enumerate(problem.campaign.sensors):
        values = np.asarray(mean_over_events.isel(sensor=number).to_numpy(), dtype=float)
        low, high = _interval(values)
        recorded = int(problem.observed[:, number].sum())
        rows.append(
            {
                "sensor": sensor.id,
                "unit": "m" if sensor.is_runout else "m/s",
                "mean": float(values.mean()),
                "sd": float(values.std(ddof=1)),
                "low": low,
                "high": high,
                "recorded_mean": float(problem.recorded_mean[number]),
                "recorded_se": float(np.sqrt(problem.covariance[number, number] / problem.campaign.n_events)),
                "n_recorded": recorded,
            }
        )
    return rows
