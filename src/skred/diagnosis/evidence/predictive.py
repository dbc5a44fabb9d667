"""What an avalanche would be read as, by draws of the population that it comes from."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skred.arrays import BoolArray, FloatArray
from skred.diagnosis.evidence.extension import Extension
from skred.inference.error_model import EventReadings
from skred.inference.intervals import ENDS


class Predicted(NamedTuple):
    """Predictions of readings, m/s or m.

    Attributes
    ----------
    mean : (..., n_sensors) array
        Of the readings without errors; of a speed above nil by fronts that come there, as below.
    low, high : (..., n_sensors) arrays
        5 % and 95 % quantiles of the readings with errors.
    """

    mean: FloatArray
    low: FloatArray
    high: FloatArray

    def where(self, seen: BoolArray) -> Predicted:
        """The same, NaN where nothing was seen."""
        return Predicted(*(np.where(seen, values, np.nan) for values in self))

    def covered(self, values: FloatArray, seen: BoolArray) -> FloatArray:
        """1 where the central 90 % of the predictions hold the reading, else 0, NaN where none was seen."""
        return np.where(seen, (values >= self.low) & (values <= self.high), np.nan)


def predict_event(
    extension: Extension,
    event: int,
    means: FloatArray,
    factors: FloatArray,
    added: FloatArray,
    rng: np.random.Generator,
) -> Predicted:
    """Predict one event's readings, one front for each draw of the population.

    Of a speed that was read above nil it is known that the front came: it is predicted by fronts that do.

    Parameters
    ----------
    extension : Extension
        What fronts do.
    event : int
        Its number: from which release, past which sensors.
    means, factors : (n, n_base) and (n, n_base, n_base) arrays
        Of the populations.
    added : (n, n_directions) array
        Strengths of what is added.
    """
    problem = extension.problem
    readings = problem.readings
    normal = rng.standard_normal((len(means), means.shape[1]))
    logs = means + np.einsum("rij,rj->ri", factors, normal)
    points = np.column_stack([logs, rng.standard_normal(len(means))])
    fronts = extension.predict(np.full(len(means), event), points, added)[:, :-1]
    noisy = problem.error_model.draw(fronts, readings.sd(event, fronts), readings.is_velocity, rng)
    known = known_to_come(readings, event, fronts)
    low, high = np.nanquantile(np.where(known, noisy, np.nan), ENDS, axis=0)
    return Predicted(np.nanmean(np.where(known, fronts, np.nan), axis=0), low, high)


def known_to_come(readings: EventReadings, event: int, fronts: FloatArray) -> BoolArray:
    """Which fronts may have given each of an event's readings: all of them but for speeds above nil.

    Where none of them comes, all may.

    Parameters
    ----------
    fronts : (n, n_sensors) array
        What is read of them without errors.
    """
    came = readings.is_velocity & (readings.values[event] > 0.0)
    may = (fronts > 0.0) | ~came
    return np.asarray(may | ~may.any(axis=0))
