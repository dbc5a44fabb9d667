"""The one more sensor that would say most: that splits a tie, or that sees what these recordings cannot."""

from __future__ import annotations

from typing import Any

import numpy as np

from skred.diagnosis.augment.step import Step
from skred.diagnosis.compare.candidate import Candidate
from skred.diagnosis.detect.detectability import Identifiability, places_of_a_sensor, with_sensors
from skred.diagnosis.evidence.extension import extended
from skred.diagnosis.outcome import Diagnosis
from skred.diagnosis.verdict.mechanisms import candidates_of


def next_sensor(found: Diagnosis) -> dict[str, Any] | None:
    """One more velocity sensor to set up, in the words of the campaign format; None where none would help.

    The one that splits a tie best, where one can; else the one that raises the power most.
    """
    if found.steps and (rival := _rival(found.steps[0])) is not None:
        named = found.steps[0].candidate
        return _sensor(_splitting(found, named, rival), [named.mechanism.id, rival.mechanism.id])
    return detection_sensor(found.table)


def detection_sensor(table: Identifiability) -> dict[str, Any] | None:
    """The one that raises the power over the listed mechanisms most; None where none does by a percent."""
    if not table.more_with_sensor:
        return None
    return _sensor(table.sensor_m, [], table.power_with)


def _rival(step: Step) -> Candidate | None:
    """The first of those tied that a speed could split off: listed, and another term."""
    known, named = candidates_of(step.comparison), step.candidate.mechanism.id
    rivals = [known[name] for name in step.tied if name in known]
    return next((one for one in rivals if one.mechanism.same_term_as != named), None)


def _sensor(place: float, splits: list[str], power_with: float | None = None) -> dict[str, Any]:
    at = {"quantity": "front_velocity", "s_from_m": place, "s_to_m": place}
    return at | {"splits": splits, "power_with": power_with}


def _splitting(found: Diagnosis, first: Candidate, second: Candidate) -> float:
    """Where two fitted candidates differ most in what one more sensor would read, in its standard deviations.

    Each with the events' modes and the strength that fit the recordings best under it.
    """
    recorded = found.steps[0].comparison.under_each[0].base.setting.recorded_m
    places = places_of_a_sensor(found.problem, recorded)
    places = places[places >= recorded[0]]  # what is read above, each front's release follows
    problem = with_sensors(found.problem, places)
    columns = np.arange(len(places)) + found.problem.campaign.n_sensors
    speeds = []
    for candidate in (first, second):
        curve = candidate.best
        strength, fit = curve.top
        direction = curve.direction.with_more_sensors(len(places))
        extension = extended(problem, found.law, [direction])
        events = np.arange(len(fit.points))
        speeds.append(extension.predict(events, fit.points, np.array([strength]))[:, columns])
    readings = problem.readings
    typical = 0.5 * (speeds[0] + speeds[1])
    sd = np.hypot(readings.relative_sd[columns] * typical, readings.absolute_sd[columns])
    distance = (((speeds[0] - speeds[1]) / sd) ** 2).sum(axis=0)
    return float(places[int(np.argmax(distance))])
