"""A campaign in memory: track, sensors, events and what was recorded."""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skred.arrays import FloatArray

Covariate = float | str | None
Quantity = Literal["front_velocity", "runout"]
Origin = Literal["measured", "simulated"]


class Status(IntEnum):
    """What is known of one event at one sensor."""

    OBSERVED = 0
    NOT_REACHED = 1
    MISSING = 2
    AT_LEAST = 3
    AT_MOST = 4
    BETWEEN = 5

    @property
    def is_bound(self) -> bool:
        """Whether the reading is known by its bounds only."""
        return self >= Status.AT_LEAST


_READINGS = ("values", "stated_sd", "values_to")
"""Arrays of a campaign with one number for each event and sensor."""


def _frozen(values: ArrayLike, dtype: type[np.generic] = np.float64) -> NDArray[np.generic]:
    """Copy the values into an array that cannot be written to."""
    array = np.array(values, dtype=dtype)
    array.setflags(write=False)
    return array


@dataclass(frozen=True, eq=False)
class Track:
    """The thalweg as a polyline, downhill.

    Parameters
    ----------
    x_m : (n_points,) array
        Horizontal distance, m, strictly increasing.
    z_m : (n_points,) array
        Elevation, m.
    width_m : (n_points,) array or None
        Width of the flow, m, where it is known.
    """

    x_m: FloatArray
    z_m: FloatArray
    width_m: FloatArray | None = None

    def __post_init__(self) -> None:
        """Take read-only copies and compare their lengths."""
        for name in ("x_m", "z_m", "width_m"):
            values = getattr(self, name)
            if values is not None:
                object.__setattr__(self, name, _frozen(values))
                if getattr(self, name).shape != (len(self.x_m),):
                    raise ValueError(f"{name} needs one value for each of the {len(self.x_m)} track points")

    @cached_property
    def s_m(self) -> FloatArray:
        """Arc length of the polyline at its points, m; the first point is 0."""
        steps = np.hypot(np.diff(self.x_m), np.diff(self.z_m))
        s_m = np.concatenate(([0.0], np.cumsum(steps)))
        s_m.setflags(write=False)
        return s_m

    @property
    def length_m(self) -> float:
        """Arc length from the first point to the last, m."""
        return float(self.s_m[-1])


@dataclass(frozen=True)
class Sensor:
    """A place where something is recorded.

    Parameters
    ----------
    id : str
        Unique in the campaign.
    quantity : {"front_velocity", "runout"}
        Front velocity in m/s, or runout as arc length in m.
    s_from_m, s_to_m : float
        Equal for a point, different for a mean velocity over that span, NaN for a runout.
    relative_sd, absolute_sd : float
        Standard deviation of a reading: a share of its value, and a part in the unit of the value.
    place_sd_m : float or None
        How well its place along the track is known, m; None where that was not stated. The odds of a
        diagnosis allow for it.
    """

    id: str
    quantity: Quantity
    s_from_m: float
    s_to_m: float
    relative_sd: float
    absolute_sd: float
    place_sd_m: float | None = None

    @property
    def is_runout(self) -> bool:
        """Whether the sensor records where the avalanche stopped."""
        return self.quantity == "runout"

    @property
    def is_span(self) -> bool:
        """Whether the sensor records a mean velocity over a stretch."""
        return self.s_to_m > self.s_from_m


@dataclass(frozen=True)
class Event:
    """An avalanche.

    Parameters
    ----------
    id : str
        Unique in the campaign.
    release_s_m : float
        Where the front starts, arc length in m.
    release_sd_m : float or None
        Standard deviation of that place, m, where one is stated.
    covariates : mapping of str to float, str or None
        Further properties; numbers have their unit in the name. None: not known.
    release_speed_m_s, release_speed_sd_m_s : float or None
        Speed of the front there, m/s, and its standard deviation; None where it starts from rest, and where
        the speed is exact.
    """

    id: str
    release_s_m: float
    release_sd_m: float | None
    covariates: Mapping[str, Covariate]
    release_speed_m_s: float | None = None
    release_speed_sd_m_s: float | None = None


@dataclass(frozen=True, eq=False)
class Campaign:
    """Everything recorded on one avalanche path.

    Two campaigns are the same where their `fingerprint` is.

    Parameters
    ----------
    name, description, source : str
        What it is and where it comes from.
    origin : {"measured", "simulated"}
        Whether the recordings are real.
    reference_s_m : float or None
        A zero for reports, arc length in m.
    track : Track
        The thalweg.
    sensors : tuple of Sensor
        The columns of the arrays below.
    events : tuple of Event
        The rows of the arrays below.
    values : (n_events, n_sensors) array
        Readings, m/s or m; NaN where there is none. Where only bounds are known, the bound, or the lower one.
    status : (n_events, n_sensors) int8 array
        A `Status` for each reading.
    stated_sd : (n_events, n_sensors) array
        Standard deviation that overrides the sensor's; NaN where none is stated.
    values_to : (n_events, n_sensors) array
        Upper bounds of readings that lie between two, m/s or m; NaN elsewhere, and by default everywhere.
    """

    name: str
    description: str
    source: str
    origin: Origin
    reference_s_m: float | None
    track: Track
    sensors: tuple[Sensor, ...]
    events: tuple[Event, ...]
    values: FloatArray
    status: NDArray[np.int8]
    stated_sd: FloatArray
    values_to: FloatArray = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        """Take read-only copies and compare their shapes."""
        object.__setattr__(self, "sensors", tuple(self.sensors))
        object.__setattr__(self, "events", tuple(self.events))
        if not np.isfinite(self.values_to).any():  # then it fits arrays of any shape
            object.__setattr__(self, "values_to", np.full((self.n_events, self.n_sensors), np.nan))
        for name in (*_READINGS, "status"):
            dtype: type[np.generic] = np.int8 if name == "status" else np.float64
            object.__setattr__(self, name, _frozen(getattr(self, name), dtype))
            if getattr(self, name).shape != (self.n_events, self.n_sensors):
                raise ValueError(f"{name} needs the shape {self.n_events, self.n_sensors}: events, sensors")

    def __repr__(self) -> str:
        """One line."""
        return (
            f"<Campaign {self.name}: {self.n_events} events, {self.n_sensors} sensors"
            f" ({', '.join(self.sensor_ids)!s:.60}), track of {self.track.length_m:.0f} m>"
        )

    @property
    def n_events(self) -> int:
        """Number of avalanches."""
        return len(self.events)

    @property
    def n_sensors(self) -> int:
        """Number of sensors."""
        return len(self.sensors)

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Between what readings lie that are known by bounds only, (n_events, n_sensors) each.

        Minus and plus infinity where there is no such bound, and for all other readings.
        """
        below = np.isin(self.status, (Status.AT_LEAST, Status.BETWEEN))
        least = np.where(below, self.values, -np.inf)
        most = np.where(self.status == Status.AT_MOST, self.values, np.inf)
        return least, np.where(self.status == Status.BETWEEN, self.values_to, most)

    @property
    def event_ids(self) -> tuple[str, ...]:
        """Ids of the avalanches, in the order of the rows."""
        return tuple(event.id for event in self.events)

    @property
    def sensor_ids(self) -> tuple[str, ...]:
        """Ids of the sensors, in the order of the columns."""
        return tuple(sensor.id for sensor in self.sensors)

    def stated_or_usual_sd(self) -> FloatArray:
        """Give the standard deviation of each reading or bound, (n_events, n_sensors).

        The stated one, else sqrt((relative_sd value)^2 + absolute_sd^2), NaN without a value; of an interval
        by its lower bound.
        """
        relative = np.array([sensor.relative_sd for sensor in self.sensors])
        absolute = np.array([sensor.absolute_sd for sensor in self.sensors])
        return np.where(np.isnan(self.stated_sd), np.hypot(relative * self.values, absolute), self.stated_sd)

    def reading_sd(self) -> FloatArray:
        """Give the standard deviation of each reading, (n_events, n_sensors); NaN where none was observed."""
        return np.where(self.status == Status.OBSERVED, self.stated_or_usual_sd(), np.nan)

    def fingerprint(self) -> str:
        """Give the SHA-256 of the content, as hexadecimal digits.

        It does not depend on how the files are formatted, on the order of their rows (except the track's) and
        columns, nor on whether a missing reading is written as a row or left out.
        """
        text = json.dumps(self._content(), sort_keys=True, allow_nan=False, separators=(",", ":"))
        return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()

    def _content(self) -> dict[str, object]:
        """Return the campaign as plain data in a fixed order."""
        columns = {"x_m": self.track.x_m, "z_m": self.track.z_m, "width_m": self.track.width_m}
        track = {
            name: None if values is None else [_plain(value) for value in values.tolist()]
            for name, values in columns.items()
        }
        sensors = {
            sensor.id: [sensor.quantity]
            + [_plain(v) for v in (sensor.s_from_m, sensor.s_to_m, sensor.relative_sd, sensor.absolute_sd)]
            + ([] if sensor.place_sd_m is None else [_plain(sensor.place_sd_m)])
            for sensor in self.sensors
        }
        events = {
            event.id: {
                "release": _release(event),
                "covariates": {k: _plain(v) for k, v in event.covariates.items() if _plain(v) is not None},
            }
            for event in self.events
        }
        readings: dict[str, dict[str, object]] = {event_id: {} for event_id in self.event_ids}
        for i, event_id in enumerate(self.event_ids):
            for j, sensor_id in enumerate(self.sensor_ids):
                reading = [_plain(float(self.values[i, j])), _plain(float(self.stated_sd[i, j]))]
                if np.isfinite(self.values_to[i, j]):
                    reading.append(_plain(float(self.values_to[i, j])))
                if self.status[i, j] != Status.MISSING or reading != [None, None]:
                    readings[event_id][sensor_id] = [int(self.status[i, j]), *reading]
        return {
            "format": 1,
            "text": [self.name, self.description, self.source, self.origin],
            "reference_s_m": _plain(self.reference_s_m),
            "track": track,
            "sensors": sensors,
            "events": events,
            "readings": readings,
        }


def _release(event: Event) -> list[Covariate]:
    """Where and how an event starts; a campaign without speeds keeps the fingerprint that it always had."""
    place = [_plain(event.release_s_m), _plain(event.release_sd_m)]
    speed = [_plain(event.release_speed_m_s), _plain(event.release_speed_sd_m_s)]
    return place if speed == [None, None] else [*place, *speed]


def _plain(value: Covariate) -> Covariate:
    """Return a value as JSON can hold it: no NaN, and no difference between 0 and -0 or 1 and 1.0."""
    if value is None or isinstance(value, str):
        return value
    return None if math.isnan(value) else float(value) + 0.0
