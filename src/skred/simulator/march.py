"""Fronts in time: an embedded Runge-Kutta pair with dense output, compiled (Dormand and Prince 1980).

Coefficients and the continuous extension are those of DOPRI5 (Hairer, Norsett and Wanner, Solving Ordinary
Differential Equations I, section II.6, doi 10.1007/978-3-540-78862-1).
"""

from __future__ import annotations

import numpy as np

from skred.simulator.compiled import compiled
from skred.simulator.forces import acceleration

LONGEST_STEP_M = 25.0
LONGEST_TIME_S = 900.0
BEYOND_M = 4000.0
"""How far beyond the track's end a front is followed [m]."""


@compiled
def _step(s, u, t, h, k1, release, table, grid, law, terms):  # type: ignore[no-untyped-def]
    """One step: new place and speed, their error estimates, the new slope, and dense coefficients."""
    u2 = u + h * 0.2 * k1
    k2 = acceleration(s + h * 0.2 * u, u2, t + 0.2 * h, release, table, grid, law, terms)
    s3, u3 = s + h * (3 / 40 * u + 9 / 40 * u2), u + h * (3 / 40 * k1 + 9 / 40 * k2)
    k3 = acceleration(s3, u3, t + 0.3 * h, release, table, grid, law, terms)
    s4 = s + h * (44 / 45 * u - 56 / 15 * u2 + 32 / 9 * u3)
    u4 = u + h * (44 / 45 * k1 - 56 / 15 * k2 + 32 / 9 * k3)
    k4 = acceleration(s4, u4, t + 0.8 * h, release, table, grid, law, terms)
    a1, a2, a3, a4 = 19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729
    s5 = s + h * (a1 * u + a2 * u2 + a3 * u3 + a4 * u4)
    u5 = u + h * (a1 * k1 + a2 * k2 + a3 * k3 + a4 * k4)
    k5 = acceleration(s5, u5, t + 8 / 9 * h, release, table, grid, law, terms)
    a1, a2, a3, a4, a5 = 9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656
    s6 = s + h * (a1 * u + a2 * u2 + a3 * u3 + a4 * u4 + a5 * u5)
    u6 = u + h * (a1 * k1 + a2 * k2 + a3 * k3 + a4 * k4 + a5 * k5)
    k6 = acceleration(s6, u6, t + h, release, table, grid, law, terms)
    b1, b3, b4, b5, b6 = 35 / 384, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84
    s7 = s + h * (b1 * u + b3 * u3 + b4 * u4 + b5 * u5 + b6 * u6)
    u7 = u + h * (b1 * k1 + b3 * k3 + b4 * k4 + b5 * k5 + b6 * k6)
    k7 = acceleration(s7, u7, t + h, release, table, grid, law, terms)
    e1, e3, e4, e5, e6, e7 = 71 / 57600, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40
    error_s = h * (e1 * u + e3 * u3 + e4 * u4 + e5 * u5 + e6 * u6 + e7 * u7)
    error_u = h * (e1 * k1 + e3 * k3 + e4 * k4 + e5 * k5 + e6 * k6 + e7 * k7)
    d1, d3, d4 = -12715105075 / 11282082432, 87487479700 / 32700410799, -10690763975 / 1880347072
    d5, d6, d7 = 701980252875 / 199316789632, -1453857185 / 822651844, 69997945 / 29380423
    last_s = h * (d1 * u + d3 * u3 + d4 * u4 + d5 * u5 + d6 * u6 + d7 * u7)
    last_u = h * (d1 * k1 + d3 * k3 + d4 * k4 + d5 * k5 + d6 * k6 + d7 * k7)
    return s7, u7, error_s, error_u, k7, last_s, last_u


@compiled
def _dense(theta, y0, y1, slope0, slope1, last):  # type: ignore[no-untyped-def]
    """Value at the share `theta` of a step; slopes are multiplied by the step's length."""
    change = y1 - y0
    bend = slope0 - change
    return y0 + theta * (
        change + (1.0 - theta) * (bend + theta * (change - slope1 - bend + (1.0 - theta) * last))
    )


@compiled
def _crossing(target, low, high, y0, y1, slope0, slope1, last):  # type: ignore[no-untyped-def]
    """Share of a step at which a component crosses `target`, known to lie between `low` and `high`."""
    at_low = _dense(low, y0, y1, slope0, slope1, last) - target
    for _ in range(60):
        middle = 0.5 * (low + high)
        at_middle = _dense(middle, y0, y1, slope0, slope1, last) - target
        if (at_middle > 0.0) == (at_low > 0.0):
            low = middle
        else:
            high = middle
        if high - low < 1e-11:
            break
    return 0.5 * (low + high)


@compiled
def _stop_in(u, u_new, h_k, h_k_new, last_u):  # type: ignore[no-untyped-def]
    """Share of the step at which the speed falls to zero; 2 where it does not."""
    low = 0.0
    for j in range(1, 9):
        theta = j / 8.0
        if j == 8 and u_new <= 0.0 or _dense(theta, u, u_new, h_k, h_k_new, last_u) <= 0.0:
            if u <= 0.0 and low == 0.0:
                low = 1e-9  # a front that has just been released
            return _crossing(0.0, low, theta, u, u_new, h_k, h_k_new, last_u)
        low = theta
    return 2.0


@compiled
def front(release, table, grid, law, terms, places, rtol, arrival, speed):  # type: ignore[no-untyped-def]
    """Follow one front from rest until it stops; arrival [s] and speed [m/s] at places go into the arrays.

    Returns
    -------
    tuple of float
        Runout [m], duration [s], highest speed [m/s].
    """
    arrival[:], speed[:] = np.nan, 0.0
    s, u, t, peak = release, 0.0, 0.0, 0.0
    k = acceleration(s, u, t, release, table, grid, law, terms)
    if k <= 1e-9:
        return s, t, peak
    following = 0
    while following < places.size and places[following] <= release:
        following += 1
    end = grid * table.shape[0] + BEYOND_M
    h = 0.02
    while t < LONGEST_TIME_S and s < end:
        h = min(h, LONGEST_STEP_M / (u + max(k, 0.0) * h + 0.1))
        s1, u1, error_s, error_u, k1, last_s, last_u = _step(s, u, t, h, k, release, table, grid, law, terms)
        error = max(abs(error_s) / (100.0 * rtol * (1.0 + abs(u1))), abs(error_u) / (rtol * (1.0 + abs(u1))))
        if error > 1.0:
            h *= max(0.2, 0.9 * error**-0.2)
            continue
        stop = 2.0
        if u1 <= 0.0 or (k < 0.0 and min(u, u1) < 5.0):
            stop = _stop_in(u, u1, h * k, h * k1, last_u)
        until = _dense(stop, s, s1, h * u, h * u1, last_s) if stop <= 1.0 else s1
        while following < places.size and places[following] <= until:
            theta = _crossing(places[following], 0.0, min(stop, 1.0), s, s1, h * u, h * u1, last_s)
            arrival[following] = t + theta * h
            speed[following] = max(_dense(theta, u, u1, h * k, h * k1, last_u), 0.0)
            following += 1
        if stop <= 1.0:
            return until, t + stop * h, max(peak, u)
        s, u, t, k = s1, u1, t + h, k1
        peak = max(peak, u)
        h *= min(4.0, 0.9 * max(error, 1e-6) ** -0.2)
    return s, t, peak


@compiled
def fronts(releases, table, grid, laws, terms, places, rtol):  # type: ignore[no-untyped-def]
    """Follow many fronts; `terms` is (n_runs, n_terms, 12), places ascending [m].

    Returns
    -------
    tuple of array
        Arrival times and speeds (n_runs, n_places); runout, duration and highest speed (n_runs, 3).
    """
    n = releases.size
    arrival, speed = np.empty((n, places.size)), np.empty((n, places.size))
    ends = np.empty((n, 3))
    for i in range(n):
        ends[i] = front(releases[i], table, grid, laws[i], terms[i], places, rtol, arrival[i], speed[i])
    return arrival, speed, ends
