"""The rule that no front is faster than a body that falls down the track without friction.

Whatever brakes an avalanche only makes it slower: gravity is its one engine. What lies above is in another
unit (km/h) or a slip.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import erfc, hypot, inf, lgamma, log, sqrt

import numpy as np

from skred.campaign.order_rules import LARGEST_SDS, has_speed, release_reach
from skred.campaign.problems import Problem
from skred.campaign.records import Sensor, Track
from skred.campaign.rules import FASTEST_M_S, RECORDINGS, problem_at
from skred.campaign.tables import Row

GRAVITY = 9.81


@dataclass(frozen=True)
class _Fall:
    """A reading of speed beside the free fall to its place.

    Attributes
    ----------
    row : Row
    limit : float
        Speed of the fall, m/s.
    sds : float
        Standard deviations by which the reading is faster.
    """

    row: Row
    limit: float
    sds: float


def fall_problems(
    rows: Sequence[Row], sensors: Mapping[str, Sensor], releases: Mapping[str, Row], track: Track
) -> list[Problem]:
    """Check that no speeds are those of fronts with an engine.

    Parameters
    ----------
    rows : sequence of Row
        The readings.
    sensors : mapping of str to Sensor
        The sensors without a problem.
    releases : mapping of str to Row
        The events' rows, as far as their releases could be read.
    track : Track

    Returns
    -------
    list of Problem
        At most one, at the reading that is the farthest off: a wrong unit is wrong in all of them.
    """
    falls = sorted(_falls(rows, sensors, releases, track), key=lambda fall: -fall.sds)
    count = _impossible(falls)
    if count == 0:
        return []
    worst = falls[0]
    sensor = worst.row.word("sensor")
    many = "" if count == 1 else f", and {count} of {len(falls)} speeds are too high in this way"
    message = (
        f"no front is that fast: a fall without friction down the track reaches sensor '{sensor}' with "
        f"{worst.limit:.3g} m/s{many}; are speeds in km/h? Write m/s, or import them as km/h: skred import"
        " FOLDER --set velocity.unit=km/h --out NEW"
    )
    return [problem_at(RECORDINGS, worst.row, "value", message)]


def _impossible(falls: Sequence[_Fall]) -> int:
    """How many readings, the farthest off first, are together too far off for errors; 0 where none are.

    Some readings are above a limit by chance. What is refused is rarer than one reading that is
    `LARGEST_SDS` standard deviations off, even if every front fell without friction: at most C(n, k) p^k is
    the probability that k of n readings are off by so much that one is with probability p.
    """
    n, rare, found = len(falls), log(_tail(LARGEST_SDS)), 0
    for k, fall in enumerate(falls, start=1):
        if fall.sds <= 0:
            break
        ways = lgamma(n + 1) - lgamma(k + 1) - lgamma(n - k + 1)
        tail = _tail(fall.sds)
        if tail == 0 or ways + k * log(tail) < rare:
            found = k
    return found


def _tail(sds: float) -> float:
    """Probability that a normal error is larger than this."""
    return 0.5 * erfc(sds / sqrt(2.0))


def _falls(
    rows: Sequence[Row], sensors: Mapping[str, Sensor], releases: Mapping[str, Row], track: Track
) -> Iterator[_Fall]:
    """Every reading that says that a front moved, beside its limit."""
    drops = {one.id: _Drop(track, one) for one in sensors.values() if _has_place(one, track)}
    for row in rows:
        if not row.has("event", "sensor", "status") or not has_speed(row):
            continue
        drop, release = drops.get(row.word("sensor")), releases.get(row.word("event"))
        value = row.number("value")
        if drop is None or release is None or value > FASTEST_M_S:
            continue
        limit = drop.speed(release)
        stated = row.number_or_none("sd")
        # As in a likelihood, the relative part is of what the speed can be and not of what was read.
        sd = hypot(drop.sensor.relative_sd * limit, drop.sensor.absolute_sd) if stated is None else stated
        excess = value - limit
        yield _Fall(row, limit, excess / sd if sd > 0 else inf if excess > 0 else -inf)


def _has_place(sensor: Sensor, track: Track) -> bool:
    return not sensor.is_runout and 0.0 <= sensor.s_from_m <= sensor.s_to_m <= track.length_m


class _Drop:
    """How deep a front may have fallen where a sensor is, at most."""

    def __init__(self, track: Track, sensor: Sensor) -> None:
        self.track, self.sensor = track, sensor
        reach = LARGEST_SDS * (sensor.place_sd_m or 0.0)
        self._end_m = sensor.s_to_m + reach
        self._lowest_m = self._between(sensor.s_from_m - reach, self._end_m).min()
        self._highest_m = self._between(0.0, self._end_m).max()

    def speed(self, release: Row) -> float:
        """Speed of a free fall there, m/s.

        From rest it may begin anywhere above: a release may not be where it was noted, which is what a
        diagnosis is to find. A speed at the release is known there and nowhere else. Where the track begins
        near an uncertain release, its first slope goes on above.
        """
        start = release.number_or_none("release_speed_m_s") or 0.0
        release_m = release.number("release_s_m") - release_reach(release)
        highest_m = self._highest_m
        if start > 0:
            highest_m = self._between(release_m, self._end_m).max()
            start += LARGEST_SDS * (release.number_or_none("release_speed_sd_m_s") or 0.0)
        if release_m < 0.0:
            (first_m, second_m), (top_m, next_m) = self.track.s_m[:2], self.track.z_m[:2]
            highest_m = max(highest_m, top_m - release_m * (top_m - next_m) / (second_m - first_m))
        return sqrt(start**2 + 2.0 * GRAVITY * max(float(highest_m - self._lowest_m), 0.0))

    def _between(self, from_m: float, to_m: float) -> np.ndarray:
        """Heights of the track's points between two places, and at these."""
        s_m, z_m = self.track.s_m, np.asarray(self.track.z_m)
        inside = z_m[(s_m > from_m) & (s_m < to_m)]
        return np.concatenate((np.interp([from_m, to_m], s_m, z_m), inside))
