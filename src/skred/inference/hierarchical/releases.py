"""Where the events' fronts start, how fast they are there, and how well that is known."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import ndtr, ndtri

from skred.arrays import BoolArray, FloatArray, IntArray
from skred.campaign import Event
from skred.physics.terrain import Terrain

_ABOVE = 4.0
"""Standard deviations above its noted place up to which a release may be, where the track begins there."""
_LEAST_SD = 1e-12
"""Standard deviation that an exact release counts with where something is divided by it."""


class Releases(NamedTuple):
    """Releases of the events. What is not known of one is one number: its deviation, in sds.

    The deviation moves the place where that is uncertain, else the speed. It is standard normal, cut off
    where the terrain ends and where a speed would fall below 0.

    Attributes
    ----------
    mean, sd : (n_events,) arrays, m
        Place of each release, and its standard deviation; 0 where it is exact.
    first, length : float, m
        Ends of the terrain: of `terrain_with_releases`, and of the track.
    speed, speed_sd : (n_events,) arrays, m/s
        How fast the front is there, 0 from rest, and the standard deviation of that; 0 where it is exact, and
        where the place is not.
    """

    mean: FloatArray
    sd: FloatArray
    first: float
    length: float
    speed: FloatArray
    speed_sd: FloatArray

    @property
    def uncertain(self) -> BoolArray:
        """Of which something is not known, (n_events,)."""
        return (self.sd > 0.0) | (self.speed_sd > 0.0)

    def take(self, events: IntArray) -> Releases:
        """Those of some events."""
        return self._replace(
            **{name: getattr(self, name)[events] for name in ("mean", "sd", "speed", "speed_sd")}
        )

    def places(self, events: IntArray, deviation: FloatArray) -> FloatArray:
        """Places [m] of events' releases, on the terrain; both (..., n)."""
        return np.clip(self.mean[events] + self.sd[events] * deviation, self.first, self.length)

    def speeds(self, events: IntArray, deviation: FloatArray) -> FloatArray:
        """Speeds [m/s] of events' fronts at their releases; both (..., n)."""
        return np.maximum(self.speed[events] + self.speed_sd[events] * deviation, 0.0)

    @property
    def limits(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest deviation of each event."""
        wide, fast = np.maximum(self.sd, _LEAST_SD), np.maximum(self.speed_sd, _LEAST_SD)
        of_speed = self.speed_sd > 0.0
        low = np.where(of_speed, -self.speed / fast, (self.first - self.mean) / wide)
        return low, np.where(of_speed, np.inf, (self.length - self.mean) / wide)

    def drawn(self, events: IntArray, uniforms: FloatArray) -> FloatArray:
        """Deviations from uniform numbers; both (..., n). 0 where the release is exact."""
        low, high = (ndtr(limit[events]) for limit in self.limits)
        with np.errstate(invalid="ignore"):
            deviation = ndtri(low + (high - low) * uniforms)
        return np.where(self.uncertain[events], deviation, 0.0)


def terrain_with_releases(track: Terrain, events: Sequence[Event]) -> Terrain:
    """A track's terrain, continued up its first slope as far as uncertain releases may be above it.

    A track is often recorded from the release on. Cut off there, an uncertain release could only be farther
    down, and fronts that are faster than from its first point would speak against whatever retards.
    """
    above = [(one.release_s_m or 0.0) - _ABOVE * one.release_sd_m for one in events if one.release_sd_m]
    return track.continued_up(max(min([0.0, *above]), -track.length_m))


def releases_of(events: Sequence[Event], terrain: Terrain) -> Releases:
    """Releases of a campaign's events on a terrain.

    An event that states how well it knows both place and speed counts with the place alone.
    """

    def numbers(name: str) -> FloatArray:
        return np.array([getattr(event, name) or 0.0 for event in events], dtype=float)

    sd = numbers("release_sd_m")
    speed_sd = np.where(sd > 0.0, 0.0, numbers("release_speed_sd_m_s"))
    first, length = float(terrain.edge_s_m[0]), terrain.length_m
    return Releases(numbers("release_s_m"), sd, first, length, numbers("release_speed_m_s"), speed_sd)
