"""What was recorded, on which track, read from a result's netCDF file."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray

from skred.arrays import BoolArray, FloatArray
from skred.campaign import Sensor, Status
from skred.campaign.records import Quantity

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, eq=False)
class Recordings:
    """Readings, sensors and track of a campaign.

    Attributes
    ----------
    event_ids : tuple of str
    sensors : tuple of Sensor
    values, reading_sd : (n_events, n_sensors) arrays, m/s or m
        Readings and their standard deviations, NaN where there is none.
    stated_sd : (n_events, n_sensors) array, m/s or m
        Constant part of a reading's error where its row states one, NaN where it does not.
    status : (n_events, n_sensors) array
        A `Status` for each.
    release_s_m, release_speed_m_s : (n_events,) arrays
        Where fronts start, and how fast; 0 from rest.
    track_s_m, track_z_m : (n_points,) arrays
    edge_s_m : (n_cells + 1,) array
        Ends of the terrain's cells.
    reference_s_m : float or None
        Zero of reported runouts.
    """

    event_ids: tuple[str, ...]
    sensors: tuple[Sensor, ...]
    values: FloatArray
    reading_sd: FloatArray
    stated_sd: FloatArray
    status: NDArray[np.int8]
    release_s_m: FloatArray
    release_speed_m_s: FloatArray
    track_s_m: FloatArray
    track_z_m: FloatArray
    edge_s_m: FloatArray
    reference_s_m: float | None

    @property
    def length_m(self) -> float:
        """Length of the terrain."""
        return float(self.edge_s_m[-1])

    @property
    def n_sensors(self) -> int:
        """Number of sensors."""
        return len(self.sensors)

    @cached_property
    def observed(self) -> BoolArray:
        """Where there is a reading, (n_events, n_sensors)."""
        return np.asarray(self.status == Status.OBSERVED)

    @cached_property
    def not_reached(self) -> BoolArray:
        """Where the front stopped above the sensor, (n_events, n_sensors)."""
        return np.asarray(self.status == Status.NOT_REACHED)

    @cached_property
    def bounded(self) -> BoolArray:
        """Of which readings only bounds are known, (n_events, n_sensors)."""
        return np.asarray(self.status >= Status.AT_LEAST)

    @cached_property
    def missing(self) -> BoolArray:
        """Of which readings nothing is known, (n_events, n_sensors)."""
        return np.asarray(self.status == Status.MISSING)

    @property
    def is_runout(self) -> BoolArray:
        """Which sensors record where an avalanche stopped, (n_sensors,)."""
        return np.array([sensor.is_runout for sensor in self.sensors], dtype=bool)

    def placed(self) -> list[tuple[int, Sensor, float]]:
        """Column, sensor and middle [m] of every sensor of speed."""
        return [(k, s, 0.5 * (s.s_from_m + s.s_to_m)) for k, s in enumerate(self.sensors) if not s.is_runout]

    def elevation(self, s_m: float) -> float:
        """Elevation of the track at a place [m]."""
        return float(np.interp(s_m, self.track_s_m, self.track_z_m))

    def recorded_range(self) -> tuple[float, float] | None:
        """Between which places something was recorded [m]; None where nothing was."""
        places = [place for _, sensor, _ in self.placed() for place in (sensor.s_from_m, sensor.s_to_m)]
        places += self.values[:, self.is_runout][self.observed[:, self.is_runout]].tolist()
        return (min(places), max(places)) if places else None


def recordings_of(tree: xr.DataTree) -> Recordings:
    """The recordings in the group ``constant_data`` of a result.

    Raises
    ------
    KeyError
        If it or a variable is not there.
    """
    constant = tree["constant_data"].to_dataset()
    columns = ("quantity", "s_from", "s_to", "relative_sd", "absolute_sd")
    sensors = zip(constant["sensor"].values, *(constant[name].values for name in columns), strict=True)
    places = {}
    if "place_sd" in constant:
        known = zip(constant["sensor"].values, constant["place_sd"].values, strict=True)
        places = {str(name): float(sd) for name, sd in known if np.isfinite(sd)}
    return Recordings(
        event_ids=tuple(map(str, constant["event"].values)),
        sensors=tuple(
            replace(
                Sensor(str(name), cast(Quantity, str(quantity)), *map(float, numbers)),
                place_sd_m=places.get(str(name)),
            )
            for name, quantity, *numbers in sensors
        ),
        values=_floats(constant["reading"].transpose("event", "sensor")),
        reading_sd=_floats(constant["reading_sd"].transpose("event", "sensor")),
        stated_sd=_floats(constant["stated_sd"].transpose("event", "sensor")),
        status=np.asarray(constant["status"].transpose("event", "sensor").values, dtype=np.int8),
        release_s_m=_floats(constant["release_s"]),
        release_speed_m_s=_floats(constant.get("release_speed", 0.0 * constant["release_s"])),
        track_s_m=_floats(constant["track_s"]),
        track_z_m=_floats(constant["track_z"]),
        edge_s_m=_floats(constant["cell_edge"]),
        reference_s_m=float(constant.attrs["reference_s"]) if "reference_s" in constant.attrs else None,
    )


def _floats(values: xr.DataArray) -> FloatArray:
    return np.asarray(values.values, dtype=float)
