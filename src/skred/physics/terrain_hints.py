"""What smoothing makes of a track: whether the ground that fronts run on is the one that was surveyed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skred.arrays import FloatArray
from skred.campaign import Campaign, Problem, Track
from skred.physics.terrain import Terrain

TRACK = "track.csv"
MOST_LONGER = 0.01
"""Share by which the given polyline may be longer than the smoothed track: more is noise of the survey."""
MOST_LOST = 0.02
"""Share of the fall between two places that smoothing may change."""
_LEAST_OF_DROP = 0.002
"""Share of the track's whole drop below which a change of fall is no loss: level ground has none to lose."""


def terrain_hints(track: Track, terrain: Terrain, places_m: FloatArray, file: str = TRACK) -> list[Problem]:
    """What is odd about a smoothed track.

    Parameters
    ----------
    track : Track
    terrain : Terrain
        Made from it.
    places_m : (n,) array, m
        Places between which the fall counts: sensors and releases.
    file : str
        The track's file, for the messages.
    """
    return [
        *_longer(track, terrain, file),
        *_lost_fall(track, terrain, places_m, file),
    ]


def campaign_places(campaign: Campaign) -> FloatArray:
    """Places of a campaign between which the fall of the track counts [m], increasing."""
    sensors = [s for s in campaign.sensors if not s.is_runout]
    places = [event.release_s_m for event in campaign.events]
    places += [place for sensor in sensors for place in (sensor.s_from_m, sensor.s_to_m)]
    return np.unique(np.array(places, dtype=float))


def _longer(track: Track, terrain: Terrain, file: str) -> list[Problem]:
    """Whether the polyline zigzags about the smoothed track."""
    smooth = _smoothed_length_m(track, terrain)
    if track.length_m <= (1.0 + MOST_LONGER) * smooth:
        return []
    more = 100.0 * (track.length_m / smooth - 1.0)
    message = (
        f"the polyline is {more:.1f} % longer than the track smoothed over {terrain.smoothing_m:.3g} m:"
        " places s are too large by that; give fewer points, or smoother ones"
    )
    return [Problem(file, None, None, None, message)]


def _smoothed_length_m(track: Track, terrain: Terrain) -> float:
    """Length of the smoothed track [m]."""
    x = np.interp(terrain.edge_s_m, track.s_m, track.x_m)
    return float(np.hypot(np.diff(x), terrain.sin_slope * np.diff(terrain.edge_s_m)).sum())


@dataclass(frozen=True)
class SmoothingCost:
    """What smoothing changes of a track.

    Attributes
    ----------
    smoothing_m : float
    change_of_fall_m : float
        Largest change of the fall between two places.
    change_of_length_m : float
        By which the polyline that places are counted along is longer.
    steepest_deg, steepest_smoothed_deg : float
        Largest slope angle, as given and smoothed.
    """

    smoothing_m: float
    change_of_fall_m: float
    change_of_length_m: float
    steepest_deg: float
    steepest_smoothed_deg: float


def smoothing_cost(track: Track, terrain: Terrain, places_m: FloatArray) -> SmoothingCost:
    """What smoothing changes of a track.

    Parameters
    ----------
    track : Track
    terrain : Terrain
        Made from it.
    places_m : (n,) array, m
        Places between which the fall counts: sensors and releases.
    """
    given, smoothed = _elevations(track, terrain, places_m)
    slopes = np.arctan2(-np.diff(track.z_m), np.diff(track.x_m))
    return SmoothingCost(
        terrain.smoothing_m,
        float(np.ptp(smoothed - given)) if given.size else 0.0,
        track.length_m - _smoothed_length_m(track, terrain),
        float(np.degrees(slopes.max())),
        float(np.degrees(terrain.slope_rad.max())),
    )


def _elevations(track: Track, terrain: Terrain, places_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Elevations of places, as given and smoothed [m]."""
    fallen = np.concatenate([[0.0], np.cumsum(terrain.sin_slope * np.diff(terrain.edge_s_m))])
    smoothed = track.z_m[0] - np.interp(places_m, terrain.edge_s_m, fallen)
    return np.interp(places_m, track.s_m, track.z_m), smoothed


def _lost_fall(track: Track, terrain: Terrain, places_m: FloatArray, file: str) -> list[Problem]:
    """Whether fronts fall as far between two places as the survey says; the worst pair."""
    given, smoothed = _elevations(track, terrain, places_m)
    fall, change = np.subtract.outer(given, given), np.subtract.outer(smoothed, smoothed)
    change = np.abs(change - fall)
    lost = change - np.maximum(MOST_LOST * np.abs(fall), _LEAST_OF_DROP * np.ptp(track.z_m))
    if lost.size == 0 or lost.max() <= 0.0:
        return []
    first, last = sorted(divmod(int(lost.argmax()), len(places_m)))
    message = (
        f"between s = {places_m[first]:.4g} m and s = {places_m[last]:.4g} m the track"
        f" falls {fall[first, last]:.3g} m, but smoothed over {terrain.smoothing_m:.3g} m "
        f"{fall[first, last] + _signed(smoothed, fall, first, last):.3g} m: forces will be found there that"
        " are none; take a smaller --smoothing, and compare"
    )
    return [Problem(file, None, None, None, message)]


def _signed(smoothed: FloatArray, fall: FloatArray, first: int, last: int) -> float:
    """Change of the fall from one place to another."""
    return float(smoothed[first] - smoothed[last] - fall[first, last])
