"""All that is known of readings in one array, for compiled code."""

from __future__ import annotations

import math

import numpy as np

from skred.parallel.compile_cache import inner

OBSERVED, VELOCITY, VALUE, RELATIVE, ABSOLUTE, LEAST, MOST = range(7)
"""What is known of a reading, as `tabled` has it: two flags, its value, its error's parts and its bounds."""

_WITHIN = 4.0
"""Standard deviations inside a bound beyond which its probability does not change any more."""


@inner()
def tabled(readings):  # type: ignore[no-untyped-def]
    """All readings in one array, (n_events, n_sensors, 7).

    Reading an array out of a tuple counts a reference up and down; done for each reading of each front that
    took about as long as the density itself.
    """
    least, most = readings.least, readings.most
    values, observed, stated_sd = readings.values, readings.observed, readings.stated_sd
    relative_sd, absolute_sd = readings.relative_sd, readings.absolute_sd
    is_velocity = readings.is_velocity
    n_events, n_sensors = values.shape
    table = np.zeros((n_events, n_sensors, 7))
    for event in range(n_events):
        for j in range(n_sensors):
            stated = stated_sd[event, j] > 0.0
            table[event, j, OBSERVED] = 1.0 if observed[event, j] else 0.0
            table[event, j, VELOCITY] = 1.0 if is_velocity[j] else 0.0
            table[event, j, VALUE] = values[event, j]
            table[event, j, LEAST], table[event, j, MOST] = least[event, j], most[event, j]
            table[event, j, RELATIVE] = 0.0 if stated else relative_sd[j]
            table[event, j, ABSOLUTE] = stated_sd[event, j] if stated else absolute_sd[j]
    return table


@inner()
def reading_sd(table, event, j, prediction):  # type: ignore[no-untyped-def]
    """Standard deviation of a reading [m/s or m]."""
    relative, absolute = table[event, j, RELATIVE] * prediction, table[event, j, ABSOLUTE]
    return math.sqrt(relative * relative + absolute * absolute)


@inner()
def is_bounded(table, event, j):  # type: ignore[no-untyped-def]
    """Whether bounds are all that is known of a reading."""
    return table[event, j, LEAST] > -np.inf or table[event, j, MOST] < np.inf


@inner()
def bounded_events(table):  # type: ignore[no-untyped-def]
    """Of which events bounds are known, (n_events,)."""
    found = np.zeros(table.shape[0], dtype=np.bool_)
    for event in range(table.shape[0]):
        for j in range(table.shape[1]):
            found[event] |= is_bounded(table, event, j)
    return found


@inner()
def flatten(table, event, j, sd, corners):  # type: ignore[no-untyped-def]
    """Take from predictions, in place, what is well within the bounds: there they may change as they like."""
    first, last = table[event, j, LEAST] + _WITHIN * sd, table[event, j, MOST] - _WITHIN * sd
    if first > last:
        first = last = 0.5 * (first + last)
    for corner in range(corners.shape[0]):
        corners[corner, j] -= min(max(corners[corner, j], first), last)
