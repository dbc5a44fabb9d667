"""Places of the campaign's own track that a prediction shows where none are asked for."""

from __future__ import annotations

from dataclasses import dataclass

from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.prediction.track import PredictionTrack
from skred.prediction.wanted import MOST_PLACES, Wanted

Place = tuple[str, float]
"""A name and an arc length [m]."""


@dataclass(frozen=True)
class OwnPlaces:
    """Sensors of speed (spans by their middle) and the reference.

    Attributes
    ----------
    shown : list of (str, float)
        In downhill order, at most `MOST_PLACES`: the reference, and the sensors farthest down the track,
        because few avalanches come there and they are what is asked about.
    left_out : list of (str, float)
        Sensors farther up, in downhill order.
    """

    shown: list[Place]
    left_out: list[Place]


def own_places(problem: HierarchicalProblem, track: PredictionTrack) -> OwnPlaces:
    """Places by default: on the campaign's own track only, on another there are none."""
    if not track.is_own:
        return OwnPlaces([], [])
    sensors = [
        (sensor.id, min(0.5 * (sensor.s_from_m + sensor.s_to_m), track.length_m))
        for sensor in problem.campaign.sensors
        if not sensor.is_runout
    ]
    zero = track.reference_s_m
    reference = [] if zero is None else [("reference", min(zero, track.length_m))]
    downhill = _downhill(sensors)
    first = max(0, len(downhill) - (MOST_PLACES - len(reference)))
    return OwnPlaces(_downhill([*downhill[first:], *reference]), downhill[:first])


def shown_places(problem: HierarchicalProblem, track: PredictionTrack, wanted: Wanted) -> list[Place]:
    """Places of the table in downhill order: those asked for, else the default ones."""
    return _downhill(list(wanted.places)) or own_places(problem, track).shown


def places_left_out(problem: HierarchicalProblem, track: PredictionTrack, wanted: Wanted) -> list[Place]:
    """Sensors that the table has no room for; none where places were asked for."""
    return [] if wanted.places else own_places(problem, track).left_out


def _downhill(places: list[Place]) -> list[Place]:
    return sorted(places, key=lambda place: place[1])
