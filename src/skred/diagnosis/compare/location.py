"""Where the mismatch is: in the equation of motion, as a missing force, and as missing work."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skred.arrays import BoolArray, FloatArray
from skred.diagnosis.compare.comparison import Comparison, ComparisonUnderErrors
from skred.diagnosis.discrepancy.profile import Kind, Profile, most_probable, spline_basis
from skred.diagnosis.evidence.coefficient import Base
from skred.diagnosis.evidence.prior_odds import UNLISTED
from skred.inference.intervals import INTERVAL_PROBABILITY
from skred.physics.kernel.columns import Column
from skred.physics.mechanisms.stretches import is_opposed

_DRAWS = 4000
"""Draws of the profile for the band: its factor is then known to about a hundredth."""
_STANDS_OUT = 1.5
"""Standard deviations from 0 that knots of the stretch have: neighbours of the highest that go with it."""


@dataclass(frozen=True, eq=False)
class Location:
    """The missing retardation along the track.

    Attributes
    ----------
    s_m : (n,) array
    mean, low, high : (n,) arrays, m s-2
        Retardation missing from the base law, at the typical speed where it goes with U^2, and where it is
        nil there at a speed that is higher by the fronts' spread; the band holds the whole profile with
        probability 0.9.
    opposed : bool
        Whether it is nil at the typical speed.
    covered : (n,) array
        Share of the events that came by.
    resolution_m : float
        Over which length the profile can be told.
    stretch_m : (float, float)
        Where it stands out most.
    work : (n_stretches, 4) array
        From [m], to [m], missing specific work [J/kg] and its standard deviation, between sensors.
    """

    s_m: FloatArray
    mean: FloatArray
    low: FloatArray
    high: FloatArray
    covered: FloatArray
    resolution_m: float
    opposed: bool
    stretch_m: tuple[float, float]
    work: FloatArray
    log_bayes_factor: float


def locate(under_errors: ComparisonUnderErrors, opposed: bool | None = None) -> Location:
    """The most probable profile as a retardation; of those that are opposed, or are not, if that is given."""
    alike = [one for one in under_errors.profiles if opposed in (None, one.kind.opposed)]
    profile = most_probable(alike)
    base = under_errors.base
    speeds = base.extended().speeds(base.fit.points, base.strengths)
    squares = 0.5 * (speeds[:, 1:] ** 2 + speeds[:, :-1] ** 2)
    here = squares > 0.0
    unit = spline_basis(base.setting.terrain, profile.knots_m)
    basis = unit * _per_unit(profile.kind, squares, here)
    inside = np.flatnonzero(unit.sum(axis=0) > 0.0)
    mean, sd, band = _band(profile, basis[:, inside])
    return Location(
        s_m=base.setting.terrain.middle_s_m[inside],
        mean=mean,
        low=mean - band * sd,
        high=mean + band * sd,
        covered=here.mean(axis=0)[inside],
        resolution_m=_resolution(profile),
        opposed=profile.kind.opposed,
        stretch_m=_stretch(profile),
        work=_work(base, profile, basis),
        log_bayes_factor=profile.log_bayes_factor,
    )


def location_of(comparison: Comparison, name: str | None) -> Location:
    """Where: of a named mechanism the profile that goes with speed as it does, else the most probable."""
    under_errors = comparison.leading(UNLISTED)
    if name is None:
        return locate(under_errors)
    named = comparison.leading(name).candidates[name]
    return locate(under_errors, is_opposed(named.best.shape))


def _per_unit(kind: Kind, squares: FloatArray, here: BoolArray) -> FloatArray:
    """Retardation [m s-2] in each cell for one unit of a profile, (n_cells,)."""
    fronts = np.maximum(here.sum(axis=0), 1)
    typical: FloatArray = squares.sum(axis=0) / fronts
    if kind.column is not Column.QUADRATIC:
        return np.ones_like(typical)
    if not kind.opposed:
        return typical
    return np.sqrt(np.sum((squares - typical) ** 2 * here, axis=0) / fronts)


def _band(profile: Profile, basis: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Mean, standard deviation, and the factor that makes the band simultaneous."""
    mean = profile.mean @ basis
    sd = np.sqrt(np.maximum(np.einsum("kc,kl,lc->c", basis, profile.covariance, basis), 1e-300))
    rng = np.random.default_rng(3)
    draws = rng.multivariate_normal(np.zeros(len(profile.mean)), profile.covariance, _DRAWS) @ basis
    return mean, sd, float(np.quantile(np.abs(draws / sd).max(axis=1), INTERVAL_PROBABILITY))


def _resolution(profile: Profile) -> float:
    """Mean width of what one unit of force at a knot is smeared over: the prior's share is taken out."""
    at = profile.knots_m
    kernel = np.eye(len(at)) - profile.covariance @ np.linalg.inv(profile.prior.cover(at))
    told = float(np.trace(kernel))
    return float((at[-1] - at[0]) / max(told, 1.0))


def _stretch(profile: Profile) -> tuple[float, float]:
    """Contiguous knots around the one that stands out most, in its own direction."""
    z = profile.mean / np.sqrt(np.diag(profile.covariance))
    top = int(np.argmax(np.abs(z)))
    least = min(_STANDS_OUT, 0.6 * abs(z[top]))
    same = np.sign(z) * np.sign(z[top]) * np.abs(z) >= least
    first = last = top
    while first > 0 and same[first - 1]:
        first -= 1
    while last + 1 < len(z) and same[last + 1]:
        last += 1
    half = 0.5 * float(profile.knots_m[1] - profile.knots_m[0])
    return float(profile.knots_m[first]) - half, float(profile.knots_m[last]) + half


def _work(base: Base, profile: Profile, basis: FloatArray) -> FloatArray:
    """Missing specific work between neighbouring sensors, and its standard deviation."""
    places, terrain = base.problem.sensor_places, base.setting.terrain
    ends = sorted({0.5 * (place[0] + place[1]) for place in places if place is not None})
    if not ends:
        return np.empty((0, 4))
    ends = [*ends, float(profile.knots_m[-1])] if profile.knots_m[-1] > ends[-1] + 1.0 else ends
    lengths, middle = np.diff(terrain.edge_s_m), terrain.middle_s_m
    rows = []
    for first, last in zip(ends[:-1], ends[1:], strict=True):
        weights = basis @ (lengths * ((middle >= first) & (middle < last)))
        sd = float(np.sqrt(weights @ profile.covariance @ weights))
        rows.append((first, last, float(profile.mean @ weights), sd))
    return np.array(rows).reshape(-1, 4)
