"""Simulated campaigns for the benchmarks of the hierarchical likelihood.

What the likelihood stands for, drawn event by event: strengths that are log-normal across events; a
release place, where it is uncertain; the kernel's front; the place where it is *seen* to stop, which is
its true stop and one normal deviation of `place_sd` for the event; velocities read at the sensors that
lie above that place and at no others, and the runout always; each reading normal about its prediction with
the standard deviation of the prediction, or as the error model has it.

A front that stops a little above a sensor may so be seen to reach it: its velocity is then read as 0 m/s and
an error, less than 0 as often as not. A campaign's files know no velocity below 0, nor does
`event_readings` count a velocity of 0 as reached. Both are conventions for real recordings and no part
of the likelihood, so simulated readings are not clipped: they are given to the problem as the arrays that
the likelihood reads, with what was reached as it was drawn.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pymc as pm
from numpy.typing import NDArray

import skred.inference
import skred.physics
from skred.campaign import Event, Sensor, Status, find_campaign, read_campaign
from skred.inference.error_model import OUTLIER_FACTOR, Errors, EventReadings
from skred.inference.hierarchical.population import correlation_parameters, population_of, spread_parameters
from skred.inference.hierarchical.problem import HierarchicalProblem, hierarchical_problem
from skred.physics.kernel.fronts import simulate
from skred.physics.law import Law

FloatArray = NDArray[np.float64]

FIRST_GATE_M, LAST_GATE_M = 200.0, 2250.0
GATE_RELATIVE_SD, GATE_ABSOLUTE_SD = 0.07, 0.5
TYPICAL = {"pcm": (0.287, 0.00226), "coulomb": (0.531,), "constant": (4.66,), "voellmy": (0.3, 4500.0)}
"""Medians near what Ryggfonn's recordings say."""
TYPICAL_SPREAD = 0.13
_DECISIVE = (
    "bisection", "error_model", "event_density", "event_draws", "hierarchical", "integrated_op",
    "joint_metropolis", "population", "reading_density", "rough_population", "sampling", "surface",
)  # fmt: skip


# Designs: who is where, and how well it reads


def sparse_design(
    n_events: int, error_model: str = "robust", release_sd_m: float = 0.0
) -> HierarchicalProblem:
    """Ryggfonn's three velocities and the runout; no recordings yet."""
    return _design(list(_RYGGFONN.sensors), n_events, error_model, release_sd_m)


def dense_design(
    n_events: int, n_gates: int = 40, error_model: str = "robust", release_sd_m: float = 0.0
) -> HierarchicalProblem:
    """Front velocities at evenly spaced gates of Ryggfonn's track, and the runout; no recordings yet."""
    places = np.linspace(FIRST_GATE_M, LAST_GATE_M, n_gates)
    gates = [
        Sensor(f"gate{k}", "front_velocity", place, place, GATE_RELATIVE_SD, GATE_ABSOLUTE_SD)
        for k, place in enumerate(places.round(1).tolist())
    ]
    runouts = [sensor for sensor in _RYGGFONN.sensors if sensor.is_runout]
    return _design(gates + runouts, n_events, error_model, release_sd_m)


_RYGGFONN = read_campaign(find_campaign("ryggfonn"))


def _design(
    sensors: list[Sensor], n_events: int, error_model: str, release_sd_m: float
) -> HierarchicalProblem:
    # An uncertain release is normal, cut off where the track begins; well inside it, it is just normal.
    release, sd = (3.0 * release_sd_m, release_sd_m) if release_sd_m > 0.0 else (0.0, None)
    shape = (n_events, len(sensors))
    campaign = replace(
        _RYGGFONN,
        name="simulated",
        origin="simulated",
        sensors=tuple(sensors),
        events=tuple(Event(f"event{k}", release, sd, {}) for k in range(n_events)),
        values=np.zeros(shape),
        status=np.full(shape, Status.OBSERVED, dtype=np.int8),
        stated_sd=np.full(shape, np.nan),
    )
    return hierarchical_problem(campaign, error_model=error_model)


# What is recorded


class Simulated(NamedTuple):
    """A simulated campaign.

    Attributes
    ----------
    problem : HierarchicalProblem
        With the recordings.
    strengths : (n_events, n_strengths) array
        True ones of the events.
    stops : (n_events,) array, m
        Where their fronts stop.
    """

    problem: HierarchicalProblem
    strengths: FloatArray
    stops: FloatArray


def simulated(
    problem: HierarchicalProblem, law: Law, population: Mapping[str, float], rng: np.random.Generator
) -> Simulated:
    """Draw a campaign of the problem's design from a population."""
    [mean], [factor] = population_of(law, {name: np.array([value]) for name, value in population.items()})
    n_events = problem.campaign.n_events
    strengths = np.exp(mean + rng.standard_normal((n_events, len(mean))) @ factor.T)
    fronts = problem.fronts(law.mechanisms)
    releases = _releases(fronts.releases, rng)
    predictions = simulate(strengths, releases, fronts.path, fronts.law, fronts.sensors)
    readings = _recorded(problem, predictions, rng)
    return Simulated(with_readings(problem, readings), strengths, predictions[:, -1])


def with_readings(problem: HierarchicalProblem, readings: EventReadings) -> HierarchicalProblem:
    """The same design with other recordings, which need not be such as a campaign can hold."""
    fresh = replace(problem)
    fresh.__dict__["readings"] = readings
    return fresh


def _releases(releases: Any, rng: np.random.Generator) -> FloatArray:
    result = releases.mean + releases.sd * rng.standard_normal(len(releases.mean))
    while (outside := (releases.sd > 0.0) & ((result < 0.0) | (result > releases.length))).any():
        again = releases.mean + releases.sd * rng.standard_normal(len(result))
        result = np.where(outside, again, result)
    return np.asarray(result)


def _recorded(
    problem: HierarchicalProblem, predictions: FloatArray, rng: np.random.Generator
) -> EventReadings:
    empty, sensors = problem.readings, problem.campaign.sensors
    n_events = len(predictions)
    places = np.array([np.nan if sensor.is_runout else sensor.s_to_m for sensor in sensors], dtype=float)
    seen_stops = predictions[:, -1] + problem.place_sd_m * rng.standard_normal(n_events)
    above = places < seen_stops[:, None]  # False for the runout
    below = empty.is_velocity & ~above
    observed = above | ~empty.is_velocity
    errors = _standardised_errors(problem.error_model.errors, empty.is_velocity, n_events, rng)
    sd = np.hypot(empty.relative_sd * predictions[:, :-1], empty.absolute_sd)
    return empty._replace(
        values=np.where(observed, predictions[:, :-1] + sd * errors, 0.0),
        observed=observed,
        reached=np.where(above, places, -np.inf).max(axis=1),
        not_reached=np.where(below, places, np.inf).min(axis=1),
    )


def _standardised_errors(
    errors: Errors, is_velocity: NDArray[np.bool_], n_events: int, rng: np.random.Generator
) -> FloatArray:
    """Errors in stated standard deviations, (n_events, n_sensors)."""
    shape = (n_events, len(is_velocity))
    case = rng.choice(len(errors.weights), size=n_events, p=errors.weights)
    outlying = rng.random(shape) < errors.shares[case][:, None]
    z = rng.standard_normal(shape)
    if errors.degrees > 0.0:
        z = z / np.sqrt(rng.chisquare(errors.degrees, shape) / errors.degrees)
    common = np.sqrt(errors.common) * rng.standard_normal((n_events, 1))
    z = np.where(is_velocity, np.sqrt(1.0 - errors.common) * z + common, z)
    return np.asarray(z * errors.scales[case][:, None] * np.where(outlying, OUTLIER_FACTOR, 1.0))


def typical_population(law: Law) -> dict[str, float]:
    """A population like Ryggfonn's."""
    population = dict(zip(law.parameter_names, TYPICAL[law.id], strict=True))
    population |= {p.name: TYPICAL_SPREAD for p in spread_parameters(law.mechanisms)}
    return population | {p.name: 0.0 for p in correlation_parameters(law.mechanisms)}


# Posteriors


def parameter_names(problem: HierarchicalProblem, law: Law) -> list[str]:
    """The law's own parameters, spreads, correlations."""
    return [parameter.name for parameter in problem.parameters(law)]


def set_surfaces(model: pm.Model, problem: HierarchicalProblem, law: Law) -> None:
    """Give a model the recordings of another campaign with as many events."""
    nodes = problem.surfaces(law.mechanisms).nodes
    pm.set_data({f"surface_{name}": value for name, value in nodes._asdict().items()}, model=model)


def source_fingerprint() -> str:
    """Of the files that decide a hierarchical posterior: figures of different ones are not to be mixed."""
    inference = Path(skred.inference.__path__[0])
    files = sorted(Path(skred.physics.__path__[0]).rglob("*.py"))
    files += [inference / f"{name}.py" for name in _DECISIVE]
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()[:16]
