"""What was recorded and on which track, as two groups of a DataTree: figures need no campaign beside it."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from skred.campaign import Status
from skred.inference.by_sensor import observed_by_sensor
from skred.inference.problem import Problem


def recorded_groups(problem: Problem) -> dict[str, xr.Dataset]:
    """The recordings and what they were made with.

    Groups
    ------
    observed_data : readings by sensor, see `skred.inference.by_sensor`
    constant_data : ``reading`` (event, sensor), NaN where there is none, status and standard deviation of
        each, sensors, releases, track, terrain, and what the likelihood adds; ``reference_s`` among its
        attributes [m] where the campaign has one
    """
    return {"observed_data": observed_by_sensor(problem), "constant_data": _constant(problem)}


def _constant(problem: Problem) -> xr.Dataset:
    campaign, terrain = problem.campaign, problem.terrain
    sensor = problem.coords["sensor"]
    reading = {"units": "m s-1; m for the runout"}
    reference = campaign.reference_s_m
    return xr.Dataset(
        {
            "reading": (("event", "sensor"), problem.values, reading),
            "status": (
                ("event", "sensor"),
                campaign.status,
                {
                    "flag_values": [int(status) for status in Status],
                    "flag_meanings": " ".join(status.name.lower() for status in Status),
                },
            ),
            "reading_sd": (("event", "sensor"), campaign.reading_sd(), reading),
            "stated_sd": (("event", "sensor"), campaign.stated_sd, reading),
            "quantity": ("sensor", [str(s.quantity) for s in campaign.sensors]),
            "s_from": ("sensor", [s.s_from_m for s in campaign.sensors], {"units": "m"}),
            "s_to": ("sensor", [s.s_to_m for s in campaign.sensors], {"units": "m"}),
            "relative_sd": ("sensor", [s.relative_sd for s in campaign.sensors], {"units": "1"}),
            "absolute_sd": ("sensor", [s.absolute_sd for s in campaign.sensors], reading),
            **_bounds(problem),
            "place_sd": (
                "sensor",
                [np.nan if s.place_sd_m is None else s.place_sd_m for s in campaign.sensors],
                {"units": "m"},
            ),
            "release_s": ("event", [e.release_s_m for e in campaign.events], {"units": "m"}),
            "release_speed": (
                "event",
                [e.release_speed_m_s or 0.0 for e in campaign.events],
                {"units": "m s-1"},
            ),
            **_track(problem),
            "cell_edge": ("edge", terrain.edge_s_m, {"units": "m"}),
            "slope": ("cell", terrain.slope_rad, {"units": "rad"}),
            "curvature": ("cell", terrain.curvature, {"units": "m-1"}),
            **problem.constants(),
        },
        coords={"event": problem.coords["event"], "sensor": sensor, "sensor_bis": sensor},
        attrs={} if reference is None else {"reference_s": float(reference)},
    )


def _bounds(problem: Problem) -> dict[str, Any]:
    """Between what readings lie of which only that is known; nothing where there are no such readings."""
    least, most = problem.campaign.bounds
    if not (np.isfinite(least) | np.isfinite(most)).any():
        return {}
    unit = {"units": "m s-1; m for the runout"}
    return {
        "reading_least": (("event", "sensor"), least, unit),
        "reading_most": (("event", "sensor"), most, unit),
    }


def _track(problem: Problem) -> dict[str, Any]:
    """The track as it was surveyed: along it, horizontally, and its elevation."""
    track = problem.campaign.track
    values = {"track_s": track.s_m, "track_x": track.x_m, "track_z": track.z_m}
    return {name: ("point", value, {"units": "m"}) for name, value in values.items()}
