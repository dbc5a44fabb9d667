"""Specific forces on a front [m/s2], in compiled code: base law and what may be hidden.

A hidden term is a row of twelve numbers: its `Kind`, its strength, then what its kind needs. Positive
strengths retard. Shapes are soft and exponents not whole on purpose: the templates of the models under test
are boxes and powers of two.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from skred.simulator.compiled import compiled

GRAVITY = 9.81
TERM_WIDTH = 12


class Kind(IntEnum):
    """What a row means; in brackets what its columns from the third on hold."""

    NONE = 0
    DRY = 1
    """Friction, slightly less than in proportion to the normal force []."""
    CURVATURE = 2
    """Friction of the centrifugal force, saturating []."""
    POWER = 3
    """Power of the speed along the whole track [order of the unit, exponent]."""
    CONSTANT = 4
    """Retardation that varies slowly along the track [wavelength m, phase]."""
    WEAKENING = 5
    """Friction that falls with speed [scale m/s, exponent]."""
    DAM = 6
    """Soft hill of a height in m [place, width above and below m, loss, its height m, share taken]."""
    STRETCH_DRAG = 7
    """Drag on a stretch [from m, to m, edge m, exponent, phase, opposition]."""
    STRETCH_FRICTION = 8
    """Retardation on a stretch [from m, to m, edge m]."""
    EROSION = 9
    """Snow taken up while there is some [from m, to m, edge m, threshold m/s, width m/s, opposition]."""
    TRAVELLED = 10
    """Friction that depends on the distance travelled [scale m, offset]."""
    WAVE = 11
    """Force periodic along the track [wavelength m, phase]."""
    BEND = 12
    """Spreading in bends seen in plan []."""
    AGEING = 13
    """Retardation that depends on the time since release [time s, width s]."""
    PUSH_PULL = 14
    """Retardation on a stretch and push on the next [from m, between m, to m, edge m]."""
    THRESHOLD = 15
    """Drag that sets in above a speed [speed m/s]."""


_DRY, _CURVATURE, _POWER, _CONSTANT, _WEAKENING, _DAM, _STRETCH_DRAG, _STRETCH_FRICTION = range(1, 9)
_EROSION, _TRAVELLED, _WAVE, _BEND, _AGEING, _PUSH_PULL, _THRESHOLD = range(9, 16)


@compiled
def soft_box(s, s_from, s_to, edge):  # type: ignore[no-untyped-def]
    """One between two places, zero far outside, with edges a few `edge` [m] wide."""
    return 0.5 * (np.tanh((s - s_from) / edge) - np.tanh((s - s_to) / edge))


@compiled
def _log_cosh(x):  # type: ignore[no-untyped-def]
    return abs(x) + np.log1p(np.exp(-2.0 * abs(x))) - np.log(2.0)


@compiled
def _dam(p, s, u):  # type: ignore[no-untyped-def]
    """Climb of a soft hill, descent with what of it is given back, and a loss on it in proportion to U^2."""
    height, d = p[1], s - p[2]
    width = p[3] if d < 0.0 else p[4]
    slope = np.tanh(d / width)
    bump = 1.0 - slope * slope
    loss = p[5] * np.tanh(height / p[6])
    if d > 0.0:
        slope *= 1.0 - p[7]
    return 2.0 * GRAVITY * height * slope * bump / width - loss * bump / (p[3] + p[4]) * u * u


@compiled
def _erosion(p, s, u, u_ref):  # type: ignore[no-untyped-def]
    """-(1/m)(dm/ds) U^2 with a supply that thins out downhill and needs speed to be eroded."""
    supply = soft_box(s, p[2], p[3], p[4])
    length = p[3] - p[2]
    mass = 1.0 + abs(p[1]) * 0.5 * (
        p[4] * (_log_cosh((s - p[2]) / p[4]) - _log_cosh((s - p[3]) / p[4])) + length
    )
    thinning = 1.0 - 0.6 * np.tanh((s - 0.5 * (p[2] + p[3])) / (0.5 * length))
    rate = p[1] * supply * thinning / mass
    drag = u * u / (1.0 + np.exp(-(u - p[5]) / p[6]))
    if p[7] != 0.0:
        drag -= p[7] * u_ref * u_ref / (1.0 + np.exp(-(u_ref - p[5]) / p[6]))
    return -rate * drag


@compiled
def _stretch_drag(p, s, u, u_ref):  # type: ignore[no-untyped-def]
    """Drag of patchy forest; the opposition is a relief that equals it at the reference speed."""
    density = soft_box(s, p[2], p[3], p[4])
    if density < 1e-12:
        return 0.0
    density *= 1.0 + 0.35 * np.sin(2.0 * np.pi * (s - p[2]) / (0.7 * (p[3] - p[2])) + p[6])
    drag = (u / 20.0) ** p[5]
    if p[7] != 0.0:
        drag -= p[7] * (u_ref / 20.0) ** p[5]
    return -p[1] * 400.0 * density * drag


@compiled
def _everywhere(kind, p, s, u, cos_slope, curvature):  # type: ignore[no-untyped-def]
    """Hidden terms that act along the whole track and are in the list."""
    if kind == _DRY:
        normal = GRAVITY * cos_slope + curvature * u * u
        normal = 0.5 * (normal + np.sqrt(normal * normal + 0.25))
        return -p[1] * GRAVITY**0.08 * normal**0.92
    if kind == _CURVATURE:
        thrust = curvature * u * u
        return -p[1] * thrust / (1.0 + abs(thrust) / (3.0 * GRAVITY))
    if kind == _POWER:
        return -p[1] * 25.0 ** p[2] * (u / 25.0) ** p[3]
    if kind == _CONSTANT:
        return -p[1] * (1.0 + 0.2 * np.sin(2.0 * np.pi * s / p[2] + p[3]))
    return -p[1] * GRAVITY * cos_slope * np.exp(-((u / p[2]) ** p[3]))


@compiled
def _unlisted(kind, p, s, u, t, travelled, cos_slope, bend):  # type: ignore[no-untyped-def]
    """Hidden terms that no list has."""
    if kind == _TRAVELLED:
        return -p[1] * GRAVITY * cos_slope * (np.exp(-((travelled / p[2]) ** 2)) - p[3])
    if kind == _WAVE:
        return -p[1] * np.sin(2.0 * np.pi * s / p[2] + p[3])
    if kind == _BEND:
        return -p[1] * abs(bend) * u * u
    if kind == _AGEING:
        return -p[1] * np.tanh((t - p[2]) / p[3])
    if kind == _PUSH_PULL:
        return -p[1] * (soft_box(s, p[2], p[3], p[5]) - soft_box(s, p[3], p[4], p[5]))
    above = 2.0 * np.log1p(np.exp(min((u - p[2]) / 2.0, 50.0)))
    return -p[1] * above * above


@compiled
def hidden_force(p, s, u, t, travelled, cos_slope, curvature, bend, u_ref):  # type: ignore[no-untyped-def]
    """Specific force [m/s2] of one hidden term."""
    kind = int(p[0])
    if kind == 0 or p[1] == 0.0:
        return 0.0
    if kind <= _WEAKENING:
        return _everywhere(kind, p, s, u, cos_slope, curvature)
    if kind == _DAM:
        return _dam(p, s, u)
    if kind == _STRETCH_DRAG:
        return _stretch_drag(p, s, u, u_ref)
    if kind == _STRETCH_FRICTION:
        return -p[1] * soft_box(s, p[2], p[3], p[4])
    if kind == _EROSION:
        return _erosion(p, s, u, u_ref)
    return _unlisted(kind, p, s, u, t, travelled, cos_slope, bend)


@compiled
def acceleration(s, u, t, release, table, grid, law, terms):  # type: ignore[no-untyped-def]
    """Acceleration dU/dt [m/s2] of a front.

    Parameters
    ----------
    s, u, t, release : float
        Place [m], speed [m/s], time since release [s], place of release [m].
    table, grid : (n_cells, 3, 4) array and float
        See `skred.simulator.terrain.Ground`, and its spacing [m].
    law : (4,) array
        mu [1], D [1/m], b [m/s2], and 1 where the curvature adds to the normal force.
    terms : (n_terms, 12) array
        What is hidden.
    """
    u = max(u, 0.0)
    i = int(s / grid)
    n = table.shape[0]
    if i < 0:
        i = 0
    if i >= n:
        i, d = n - 1, grid
    else:
        d = s - i * grid
    c = table[i, 0]
    phi = c[0] + d * (c[1] + d * (c[2] + d * c[3]))
    curvature = -(c[1] + d * (2.0 * c[2] + 3.0 * d * c[3])) if s < n * grid else 0.0
    cos_slope = np.cos(phi)
    normal = GRAVITY * cos_slope + law[3] * curvature * u * u
    a = GRAVITY * np.sin(phi) - law[0] * max(normal, 0.0) - law[1] * u * u - law[2]
    if terms.shape[0] > 0:
        c = table[i, 1]
        bend = c[0] + d * (c[1] + d * (c[2] + d * c[3]))
        c = table[i, 2]
        u_ref = max(c[0] + d * (c[1] + d * (c[2] + d * c[3])), 0.0)
        for k in range(terms.shape[0]):
            a += hidden_force(terms[k], s, u, t, s - release, cos_slope, curvature, bend, u_ref)
    return a
