"""Readings by sensor, one variable each, so that ArviZ's predictive checks take a result as it is.

A variable has the name of its sensor and a dimension of its own, the avalanches of which it is known what the
sensor reads: ArviZ's plots do not expect gaps. A front that is known not to have come reads 0, in what was
observed as in what is predicted. Readings that are known by their bounds only are left out.
"""

from __future__ import annotations

import re
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from skred.arrays import FloatArray, IntArray
from skred.inference.problem import Problem

JOINT = "recordings"
"""Of the group log_likelihood: all readings of an avalanche together."""
_TAKEN = frozenset(("chain", "draw", "event", "sensor", JOINT))


class SensorReadings(NamedTuple):
    """The readings of one sensor.

    Attributes
    ----------
    name, dim : str
        Of its variable, and of the dimension of the avalanches.
    column : int
        Which of the campaign's sensors it is.
    events : (n,) integer array
        Which avalanches.
    attributes : dict
        ``units``, and the sensor's id as ``long_name``.
    """

    name: str
    dim: str
    column: int
    events: IntArray
    attributes: dict[str, str]


def sensors_with_readings(problem: Problem) -> list[SensorReadings]:
    """The sensors of which something is known, in the order of the campaign.

    Names are the ids, without blanks and what else netCDF or xarray's coordinates do not take; an underscore
    is added where one is taken already.
    """
    found, taken = list[SensorReadings](), set(_TAKEN)
    for column, sensor in enumerate(problem.campaign.sensors):
        name = re.sub(r"[^\w.-]+", "_", sensor.id).strip(".-") or "sensor"
        while {name, f"event_{name}"} & taken:
            name += "_"
        taken |= {name, f"event_{name}"}
        events = np.flatnonzero(problem.observed[:, column] | problem.not_reached[:, column])
        attributes = {"units": "m" if sensor.is_runout else "m s-1", "long_name": sensor.id}
        if len(events):
            found.append(SensorReadings(name, f"event_{name}", column, events, attributes))
    return found


def observed_by_sensor(problem: Problem) -> xr.Dataset:
    """What each sensor recorded, (event,); 0 where the front is known not to have come."""
    recorded = np.where(problem.not_reached, 0.0, problem.values)
    return xr.Dataset(
        {
            one.name: (one.dim, recorded[one.events, one.column], one.attributes)
            for one in sensors_with_readings(problem)
        },
        coords=_events(problem),
    )


def predicted_by_sensor(problem: Problem, readings: FloatArray, draws: dict[str, Any]) -> xr.Dataset:
    """What each sensor would record of the same avalanches.

    Parameters
    ----------
    problem : Problem
    readings : (n_chains, n_draws, n_events, n_sensors) array, m/s or m
        0 where a front does not come.
    draws : dict
        Coordinates of the chains and draws.
    """
    return xr.Dataset(
        {
            one.name: (
                ("chain", "draw", one.dim),
                readings[:, :, one.events, one.column],
                one.attributes,
            )
            for one in sensors_with_readings(problem)
        },
        coords={**draws, **_events(problem)},
    )


def joint_terms(problem: Problem, log_likelihood: FloatArray, draws: dict[str, Any]) -> xr.Dataset:
    """The group log_likelihood: ``recordings``, and by the names of the sensors the same of their avalanches.

    An avalanche is left out as a whole, whichever of its sensors is looked at: a sensor's terms are those of
    all readings of its avalanches together. They are coordinates, so that ``recordings`` is the one variable
    and `arviz.loo` needs no name.

    Parameters
    ----------
    problem : Problem
    log_likelihood : (n_chains, n_draws, n_events) array, nat
    draws : dict
        Coordinates of the chains and draws.
    """
    terms = {
        one.name: (("chain", "draw", one.dim), log_likelihood[:, :, one.events], {"units": "nat"})
        for one in sensors_with_readings(problem)
    }
    return xr.Dataset(
        {JOINT: (("chain", "draw", "event"), log_likelihood, {"units": "nat"})},
        coords={**draws, "event": problem.coords["event"], **_events(problem), **terms},
    )


def _events(problem: Problem) -> dict[str, Any]:
    """Ids of each sensor's avalanches."""
    ids = np.array(problem.coords["event"])
    return {one.dim: ids[one.events] for one in sensors_with_readings(problem)}
