"""PyMC's NUTS on the joint posterior: every event's strengths are variables of their own, non-centred.

What one would write without surfaces: the forward map as an Op with gradients, and for each event a
standard normal variable for each strength. The likelihood is skred's with normal errors, the relative part of
the prediction, and the same term for where the front stopped.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pymc as pm
import pytensor.tensor as pt
import xarray as xr
from numpy.typing import NDArray

from skred.inference.hierarchical.population import population_variables
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.inference.pooled.forward_op import front_readings
from skred.physics.law import Law

FloatArray = NDArray[np.float64]
_LEAST = 1e-300


class Drawn(NamedTuple):
    """What came of it.

    Attributes
    ----------
    tree : DataTree or None
        Of the chains that made at least half of their draws, as many as all of these have; none if there
        are fewer than two.
    draws : list of int
        How many draws each chain made, tuning apart, before its time was up.
    compile_seconds, seconds : float
    """

    tree: xr.DataTree | None
    draws: list[int]
    compile_seconds: float
    seconds: float


def joint_model(problem: HierarchicalProblem, law: Law) -> pm.Model:
    """The law's priors as in its own model, with explicit strengths of the events.

    Raises
    ------
    ValueError
        For error models other than "normal", uncertain releases, and readings known by bounds only.
    """
    known = not (problem.releases.uncertain.any() or problem.readings.bounded.any())
    if problem.error_model.id != "normal" or not known:
        raise ValueError("normal errors, certain releases and exact readings only")
    return law.build(_Joint(problem))


class _Joint:
    """Stands for the problem in a law's `build`."""

    def __init__(self, problem: HierarchicalProblem) -> None:
        self.problem, self.coords = problem, problem.coords

    def observe(self, mechanisms: Any, strengths: Any) -> Any:
        """Add strengths of the events and their likelihood to the current model."""
        n_events = self.problem.campaign.n_events
        factor = population_variables(mechanisms)
        z = pm.Normal("z", shape=(n_events, len(mechanisms)))
        logs = pt.log(pt.stack(list(strengths))) + z @ factor.T
        return pm.Potential("recordings", log_likelihood(self.problem, mechanisms, logs))


def log_likelihood(problem: HierarchicalProblem, mechanisms: Any, logs: Any) -> Any:
    """Symbolic log likelihood of all events given the logarithms of their strengths."""
    fronts, readings = problem.fronts(mechanisms), problem.readings
    releases = fronts.releases
    predicted = front_readings(
        pt.exp(logs), releases.mean, fronts.path, fronts.law, fronts.sensors, releases.speed
    )
    prediction, stop = predicted[:, :-1], predicted[:, -1]
    variance = pt.square(readings.relative_sd * prediction) + readings.absolute_sd**2
    variance = pt.switch(readings.stated_sd > 0.0, readings.stated_sd**2, variance)
    terms = -0.5 * pt.square(readings.values - prediction) / variance - 0.5 * pt.log(2 * np.pi * variance)
    return pt.switch(readings.observed, terms, 0.0).sum() + _log_stop(stop, readings).sum()


def _log_stop(stop: Any, readings: Any) -> Any:
    """As `skred.inference.reading_density` has it; infinities are kept out of the gradients."""
    far = 1e6

    def below(place: FloatArray) -> Any:
        z = (np.clip(place, -far, far) - stop) / readings.place_sd
        return 0.5 * pt.erfc(-z / np.sqrt(2.0))

    def above(place: FloatArray) -> Any:
        z = (np.clip(place, -far, far) - stop) / readings.place_sd
        return 0.5 * pt.erfc(z / np.sqrt(2.0))

    only_reached = np.isinf(readings.not_reached)
    probability = pt.switch(
        only_reached, above(readings.reached), below(readings.not_reached) - below(readings.reached)
    )
    return pt.log(pt.maximum(probability, _LEAST))


class _Clock:
    """Ends a chain when its time is up, and counts its draws."""

    def __init__(self, budget_s: float) -> None:
        self.ends, self.draws = time.monotonic() + budget_s, 0

    def __call__(self, trace: Any, draw: Any) -> None:
        self.draws += not draw.tuning
        if time.monotonic() > self.ends:
            raise KeyboardInterrupt  # PyMC keeps what there is


def sample(
    problem: HierarchicalProblem,
    law: Law,
    seed: int,
    start: Mapping[str, float],
    *,
    draws: int,
    tune: int,
    chains: int,
    budget_s: float,
) -> Drawn:
    """Chains one after the other with PyMC's defaults, each with its share of the time.

    `start` is a population to begin with, the events' strengths all being its medians.
    """
    logging.getLogger("pymc").setLevel(logging.ERROR)
    started = time.monotonic()
    parts, made = [], []
    with joint_model(problem, law):
        step = pm.NUTS()
        compiled = time.monotonic()
        for chain in range(chains):
            clock = _Clock(budget_s / chains)
            step.reset_tuning()
            try:
                parts.append(
                    pm.sample(
                        draws,
                        tune=tune,
                        chains=1,
                        cores=1,
                        step=step,
                        initvals=dict(start),
                        random_seed=seed + chain,
                        callback=clock,
                        progressbar=False,
                        compute_convergence_checks=False,
                    )
                )
            except ValueError as error:
                if "Not enough samples" not in str(error):
                    raise
            made.append(clock.draws)
    seconds = time.monotonic() - compiled
    parts = [part for part in parts if part["posterior"].sizes["draw"] >= draws // 2]
    if len(parts) < 2:
        return Drawn(None, made, compiled - started, seconds)
    n = min(part["posterior"].sizes["draw"] for part in parts)
    groups = {
        group: xr.concat([part[group].to_dataset().isel(draw=slice(n)) for part in parts], "chain")
        for group in ("posterior", "sample_stats")
    }
    return Drawn(xr.DataTree.from_dict(groups), made, compiled - started, seconds)
