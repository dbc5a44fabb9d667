"""Detectability: what these recordings can tell, before any residual is looked at.

For each mechanism: how much of its information is retained once base strengths, their scatter and releases
have had their share; the smallest strength that would be found in 90 % of cases; what it is confounded with;
and the one extra sensor that would help most. It depends on track, sensors and number of events, and on
where the events' modes are, not on whether the readings fit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import ndtr, ndtri

from skred.arrays import FloatArray
from skred.campaign import Sensor, Status
from skred.diagnosis.detect.score_test import ScoreTest
from skred.diagnosis.evidence.coefficient import Base
from skred.diagnosis.evidence.conditional_map import Modes, campaign_rows
from skred.diagnosis.evidence.extension import extended
from skred.diagnosis.evidence.linear_mixed_model import Scores
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.inference.intervals import INTERVAL_PROBABILITY
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.placed import added_of
from skred.physics.mechanisms.spec import BoundTo, Group, Mechanism
from skred.physics.mechanisms.stretches import shares

LIMIT_Z = 2.85
"""Score above which a mechanism counts as seen: the largest of `_CALCULATED_FOR` is above it in about 3 of a
hundred clean campaigns."""
_CALCULATED_FOR = 13
"""Mechanisms in the list that `LIMIT_Z` was calculated for."""
ALIKE = 0.9
"""Size of the cosine between two efficient scores above which mechanisms look alike: then four fifths of the
information about one is information about the other."""
NO_LIMIT = 20.0
"""Scales of a mechanism from which on a detection limit is none: no strength that could be is so large."""
_PLACES = 12
"""Places tried for one more sensor: close enough to each other for what a reading there says to change little
between them."""


@dataclass(frozen=True, eq=False)
class Detectability:
    """What the recordings can tell of one mechanism.

    Attributes
    ----------
    mechanism : Mechanism
    kept : float
        Share of its information left, at its typical place.
    limit : float
        Strength found in 90 % of cases, at its typical place, in its unit; infinite from `NO_LIMIT` on.
    limit_m : (float, float) or None
        The stretch where that limit is lowest.
    best_limit : float
        The limit there.
    power : float
        Probability that a relevant strength is found, over its shapes by their prior probability.
    alike : tuple of str
        Ids that it cannot be told from.
    """

    mechanism: Mechanism
    kept: float
    limit: float
    best_limit: float
    limit_m: tuple[float, float] | None
    power: float
    alike: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """As documents have it; null where there is no limit."""
        limit, best = (one if np.isfinite(one) else None for one in (self.limit, self.best_limit))
        return {
            "id": self.mechanism.id,
            "kept": self.kept,
            "limit": limit,
            "best_limit": best,
            "best_stretch_m": self.limit_m,
            "relevant": added_of(self.mechanism).relevant,
            "unit": self.mechanism.strength.unit,
            "power": self.power,
            "alike": list(self.alike),
        }


@dataclass(frozen=True, eq=False)
class Identifiability:
    """The table, and the sensor that would help most.

    Attributes
    ----------
    rows : tuple of Detectability
    sensor_m : float
        Where one more velocity sensor raises the power most.
    power : float
        Mean power over the listed physics.
    power_with : float
        The same with that sensor.
    """

    rows: tuple[Detectability, ...]
    sensor_m: float
    power: float
    power_with: float

    @property
    def more_with_sensor(self) -> bool:
        """Whether that sensor raises the power as it is told, in percent."""
        return round(100.0 * self.power_with) > round(100.0 * self.power)

    @property
    def lacks_room(self) -> bool:
        """Whether nothing is looked for on a stretch: what is recorded is shorter than the shortest one."""
        return not any(added_of(row.mechanism).bound_to is BoundTo.PLACE for row in self.rows)

    @property
    def can_tell(self) -> bool:
        """Whether a relevant strength of what is listed would be found in at least half of the cases."""
        return self.power >= 0.5


def identify(base: Base) -> Identifiability:
    """What the recordings can tell around a fitted law."""
    score_test = ScoreTest(base)
    scores = score_test.scores(base.rows, base.fit.points, base.population)
    table = told(score_test, scores)
    places, with_each = extra_sensors(base)
    power = mean_power(table)
    powers = [mean_power(told(score_test, one)) for one in with_each]
    best = int(np.argmax(powers))
    return Identifiability(tuple(table), float(places[best]), power, powers[best])


def limit_z(n_mechanisms: int) -> float:
    """Score above which a mechanism of a library of so many counts as seen.

    In a longer list more of them stand out by chance. The limit rises with its length, so that some mechanism
    stands out in as many clean campaigns as with the list that `LIMIT_Z` was calculated for.
    """
    return -float(ndtri(ndtr(-LIMIT_Z) * _CALCULATED_FOR / n_mechanisms))


def mean_power(table: list[Detectability]) -> float:
    """Mean power over the listed physics."""
    powers = [row.power for row in table if row.mechanism.group is Group.PHYSICS]
    return float(np.mean(powers)) if powers else 0.0


def told(score_test: ScoreTest, scores: Scores) -> list[Detectability]:
    """One row for each mechanism."""
    _, (information,), (raw,) = score_test.of_candidates(scores)
    placed, order = score_test.placed_mechanisms, score_test.order
    scales, relevant = np.array([(one.scale, one.relevant) for one in placed]).T
    z, at = limit_z(len(mechanisms())), ndtri(INTERVAL_PROBABILITY)
    own = np.sqrt(information)
    found = ndtr(own * relevant - z)
    cosine = np.abs(scores.information[0][np.ix_(order, order)]) / np.outer(own, own)
    seen = (z + at) / own < NO_LIMIT * scales
    limits = np.where(seen, (z + at) / own, np.inf)
    look_alike = (cosine > ALIKE) & np.outer(seen, seen)
    ids = np.array([one.mechanism.id for one in placed])
    table = []
    for name in dict.fromkeys(ids.tolist()):
        members = np.flatnonzero(ids == name)
        in_order = members[np.argsort(information[members])]
        typical, best = in_order[(len(members) - 1) // 2], in_order[-1]
        mechanism, shape = placed[best].mechanism, placed[best].shape
        stretch = None if shape.s_from_m is None or shape.s_to_m is None else (shape.s_from_m, shape.s_to_m)
        kept = information[typical] / raw[typical] if seen[typical] else 0.0
        table.append(
            Detectability(
                mechanism,
                float(np.clip(kept, 0.0, 1.0)),
                float(limits[typical]),
                float(limits[best]),
                stretch,
                float(np.average(found[members], weights=shares([placed[k].shape for k in members]))),
                tuple(sorted(set(ids[look_alike[best]].tolist()) - {name})),
            )
        )
    return table


def places_of_a_sensor(problem: HierarchicalProblem, recorded_m: tuple[float, float]) -> FloatArray:
    """Places to try for one more velocity sensor: evenly over the recorded part and a little above.

    No higher than halfway from the releases: fronts that have hardly begun to move tell nothing.
    """
    first, last = recorded_m
    release = float(problem.releases.mean.max())
    low = max(first - 0.5 * max(first - release, 0.0), first - 0.5 * (last - first))
    return np.linspace(low, min(last, float(problem.terrain.middle_s_m[-1])), _PLACES)


def extra_sensors(base: Base) -> tuple[FloatArray, list[Scores]]:
    """Places for one more velocity sensor, and the information with each."""
    places = places_of_a_sensor(base.problem, base.setting.recorded_m)
    problem = with_sensors(base.problem, places)
    setting = replace(
        base.setting,
        sensors=tuple(problem.campaign.sensor_ids),
        velocities=(*base.setting.velocities, *[False] * len(places)),
    )
    rows = campaign_rows(extended(problem, base.law))
    wide = ScoreTest(replace(base, problem=problem, setting=setting, rows=rows))
    around = wide.around(rows, base.fit.points)
    columns = range(base.problem.campaign.n_sensors, problem.campaign.n_sensors)
    return places, [
        wide.scores_around(_also_reading(around, problem, column), rows, base.population)
        for column in columns
    ]


def _also_reading(modes: Modes, problem: HierarchicalProblem, column: int) -> Modes:
    """Modes with a reading, as expected, at one more sensor wherever the front comes."""
    curvature = modes.curvature.copy()
    readings, speed = problem.readings, modes.predictions[:, column]
    sd = np.hypot(readings.relative_sd[column] * speed, readings.absolute_sd[column])
    curvature[:, column] = np.where(speed > 0.0, sd**-2.0, 0.0)
    return modes._replace(curvature=curvature)


def with_sensors(problem: HierarchicalProblem, places: FloatArray) -> HierarchicalProblem:
    """The problem with more velocity sensors that have read nothing, as good as the campaign's usual one."""
    campaign = problem.campaign
    relative, absolute = _usual_errors(problem)
    taken = set(campaign.sensor_ids)
    new = tuple(
        Sensor(_free_name(k, taken), "front_velocity", float(s), float(s), relative, absolute)
        for k, s in enumerate(places)
    )
    empty = np.full((campaign.n_events, len(new)), np.nan)
    return replace(
        problem,
        campaign=replace(
            campaign,
            sensors=(*campaign.sensors, *new),
            values=np.column_stack([campaign.values, empty]),
            status=np.column_stack([campaign.status, np.full(empty.shape, int(Status.MISSING))]),
            stated_sd=np.column_stack([campaign.stated_sd, empty]),
            values_to=np.column_stack([campaign.values_to, empty]),
        ),
    )


def _usual_errors(problem: HierarchicalProblem) -> tuple[float, float]:
    """Relative and absolute standard deviation [m/s] of the campaign's usual velocity sensor."""
    readings = problem.readings
    if not readings.is_velocity.any():
        return 0.1, 0.5
    relative, absolute = (
        float(np.median(sd[readings.is_velocity])) for sd in (readings.relative_sd, readings.absolute_sd)
    )
    return (relative, absolute) if max(relative, absolute) > 0.0 else (0.0, 0.5)


def _free_name(number: int, taken: set[str]) -> str:
    name = f"extra {number + 1}"
    while name in taken:
        name += "'"
    return name
