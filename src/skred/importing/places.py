"""Places as people give them, turned into arc length along the track."""

from dataclasses import dataclass

import numpy as np

from skred.campaign import Track
from skred.campaign.cells import CellError

# Two places closer than this are one: an altitude that is exactly a track point's lies on both its segments.
SAME_PLACE_M = 1e-6
SHOWN_PLACES = 5


@dataclass(frozen=True, eq=False)
class Places:
    """Turns places on a track into arc length.

    Attributes
    ----------
    track : Track or None
        None where it could not be read: then only ``s`` and ``reference`` can be turned.
    reference_s_m : float or None
        The campaign's zero, arc length, m.
    """

    track: Track | None
    reference_s_m: float | None

    def arc_length(self, value: float, place: str) -> float:
        """Arc length of a place, m.

        Parameters
        ----------
        value : float
            m.
        place : {"s", "x", "altitude", "reference"}

        Raises
        ------
        CellError
            If the place is not on the track, is on it more than once, or there is no reference.
        """
        if place == "reference":
            if self.reference_s_m is None:
                raise CellError(
                    "a distance from the reference, and no reference is known; declare --reference"
                )
            return self.reference_s_m + value
        if place == "s":
            return value
        if self.track is None:
            raise CellError(
                "the place can be found only on a track that has no problems; correct those first"
            )
        return self._from_x(value, self.track) if place == "x" else self._from_altitude(value, self.track)

    def sd_along(self, value: float, sd: float, place: str) -> float:
        """Standard deviation along the track, m, of one that is given as the place is.

        It is half the length of the stretch within one standard deviation around the place, so that 5 m of
        altitude on gentle ground are the many metres of runout that they are. Where the track ends within
        that stretch, the ground beyond its end is taken to be as the ground on the other side of the place.

        Raises
        ------
        CellError
            As `arc_length`.
        """
        if place in ("s", "reference"):
            return sd
        s_m = self.arc_length(value, place)
        assert self.track is not None
        given = self.track.x_m if place == "x" else self.track.z_m
        return _half_stretch(self.track.s_m, np.asarray(given), s_m, value, sd)

    def _from_x(self, x_m: float, track: Track) -> float:
        first, last = float(track.x_m[0]), float(track.x_m[-1])
        if not first <= x_m <= last:
            raise CellError(
                f"expected a horizontal distance on the track, {first:g} to {last:g} m; correct it"
            )
        return float(np.interp(x_m, track.x_m, track.s_m))

    def _from_altitude(self, altitude_m: float, track: Track) -> float:
        low, high = float(np.min(track.z_m)), float(np.max(track.z_m))
        if not low <= altitude_m <= high:
            raise CellError(f"expected an altitude on the track, {low:g} to {high:g} m; correct it")
        found = _crossings(track.s_m, np.asarray(track.z_m), altitude_m)
        if len(found) == 1:
            return found[0]
        places = ", ".join(f"{s_m:.1f}" for s_m in found[:SHOWN_PLACES])
        more = f" and {len(found) - SHOWN_PLACES} more" if len(found) > SHOWN_PLACES else ""
        raise CellError(
            f"the track has this altitude at several places, s = {places}{more} m; give the place as s or x"
        )


def _crossings(s_m: np.ndarray, z_m: np.ndarray, altitude_m: float) -> list[float]:
    """Every place at which a polyline has an altitude; both ends of a level stretch."""
    found: list[float] = []
    for k in range(len(s_m) - 1):
        above, below = z_m[k] - altitude_m, z_m[k + 1] - altitude_m
        if above == 0 and below == 0:
            found += [float(s_m[k]), float(s_m[k + 1])]
        elif above * below <= 0:
            found.append(float(s_m[k] + (s_m[k + 1] - s_m[k]) * above / (above - below)))
    apart: list[float] = []
    for place in sorted(found):
        if not apart or place - apart[-1] > SAME_PLACE_M:
            apart.append(place)
    return apart


def _half_stretch(s_m: np.ndarray, given: np.ndarray, centre_m: float, value: float, sd: float) -> float:
    """Half the length of the stretch around a place on which a polyline is within sd of its value there."""
    sides = [_side(s_m, given, centre_m, value, sd, step) for step in (-1, 1)]
    whole = [length for length, is_whole in sides if is_whole]
    if len(whole) == 1:
        # The other side is cut off by the polyline's end: it is at least as long as what is seen of it.
        return (whole[0] + max(length for length, _ in sides)) / 2
    return sum(length for length, _ in sides) / 2


def _side(
    s_m: np.ndarray, given: np.ndarray, centre_m: float, value: float, sd: float, step: int
) -> tuple[float, bool]:
    """Length of one side of that stretch, and whether it ends before the polyline does."""
    k = (
        int(np.searchsorted(s_m, centre_m, side="right")) - 1
        if step < 0
        else int(np.searchsorted(s_m, centre_m))
    )
    at_s, at = centre_m, value
    while 0 <= k < len(s_m):
        if abs(given[k] - value) > sd:
            limit = value + sd * np.sign(given[k] - value)
            at_s += (s_m[k] - at_s) * (limit - at) / (given[k] - at)
            return abs(float(at_s) - centre_m), True
        at_s, at = float(s_m[k]), float(given[k])
        k += step
    return abs(at_s - centre_m), False
