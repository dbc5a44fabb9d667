"""The alpha-beta model: extreme runout from topography alone, the baseline every law must beat.

alpha = 0.96 beta - 1.4 degrees, residual standard deviation 2.3 degrees (206 Norwegian paths), after
Bakkehoi, Domaas and Lied (1983), Annals of Glaciology 4, 24-29, doi:10.3189/1983AoG4-1-24-29.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtr, ndtri

from skred.arrays import FloatArray

BETA_SLOPE_DEG = 10.0
"""Slope [degrees] that marks the beta point."""
ALPHA_SD_DEG = 2.3
"""Residual standard deviation of alpha [degrees]."""


@dataclass(frozen=True, eq=False)
class AlphaBeta:
    """The model set up on one track.

    Attributes
    ----------
    s_m, x_m, z_m : (n_points,) array, m
        Arc length, horizontal distance and elevation from the release point down.
    beta_s_m : float, m
        Place of the beta point: where the slope, going down, first falls to 10 degrees.
    beta_deg : float
        Angle of sight from the release point down to the beta point.
    """

    s_m: FloatArray
    x_m: FloatArray
    z_m: FloatArray
    beta_s_m: float
    beta_deg: float

    @property
    def alpha_deg(self) -> float:
        """Mean angle of sight to the extreme runout [degrees]."""
        return 0.96 * self.beta_deg - 1.4

    def runout_s_m(self, alpha_deg: float | None = None, *, reference_s_m: float = 0.0) -> float:
        """Return where the line at ``alpha_deg`` (default: the mean alpha) meets the terrain [m].

        Of several meeting places the one nearest the beta point counts: below it for lines flatter
        than beta, above it for steeper ones.

        Parameters
        ----------
        alpha_deg : float, optional
            Angle of the line below the horizontal.
        reference_s_m : float, m
            Place that the result is counted from.

        Returns
        -------
        float
            ``inf`` if the line is still above ground at the end of the track, ``nan`` if no point
            above the beta point is seen at so steep an angle.
        """
        angle = self.alpha_deg if alpha_deg is None else alpha_deg
        height = self._height_over_line(angle)
        beta_height = np.interp(self.beta_s_m, self.s_m, height)
        # Below the beta point the line must come to ground; above it, ground must rise to the line.
        if beta_height <= 0:
            beyond = self.s_m > self.beta_s_m
            s = np.concatenate([[self.beta_s_m], self.s_m[beyond]])
            height = np.concatenate([[beta_height], height[beyond]])
            without = np.inf
        else:
            before = (self.s_m < self.beta_s_m) & (self.s_m > self.s_m[0])
            s = np.concatenate([[self.beta_s_m], self.s_m[before][::-1]])
            height = -np.concatenate([[beta_height], height[before][::-1]])
            without = np.nan
        met = np.flatnonzero(height >= 0)
        if len(met) == 0:
            return without
        after = met[0]
        if after == 0:
            return float(s[0] - reference_s_m)
        share = height[after - 1] / (height[after - 1] - height[after])
        return float(s[after - 1] + share * (s[after] - s[after - 1]) - reference_s_m)

    def runout_quantile_s_m(self, exceedance: float, *, reference_s_m: float = 0.0) -> float:
        """Return the runout [m] that the extreme avalanche exceeds with the given probability."""
        alpha = self.alpha_deg + ALPHA_SD_DEG * float(ndtri(exceedance))
        return self.runout_s_m(alpha, reference_s_m=reference_s_m)

    def exceedance_probability(self, s_m: float) -> float:
        """Return the probability that the extreme runout goes beyond ``s_m`` [m].

        Alpha is normal about its mean. ``nan`` beyond the end of the track, where the terrain that
        decides is unknown.
        """
        if not self.s_m[0] < s_m <= self.s_m[-1]:
            return float("nan")
        lower, upper = sorted((s_m, self.beta_s_m))
        inside = self.s_m[(self.s_m > lower) & (self.s_m < upper)]
        places = np.concatenate([[lower], inside, [upper]])
        seen = np.array([self.angle_of_sight_deg(s) for s in places])
        limit = seen.min() if s_m >= self.beta_s_m else seen.max()
        return float(ndtr((limit - self.alpha_deg) / ALPHA_SD_DEG))

    def angle_of_sight_deg(self, s_m: float) -> float:
        """Return the angle below the horizontal [degrees] from the release point down to ``s_m`` [m]."""
        run = np.interp(s_m, self.s_m, self.x_m) - self.x_m[0]
        drop = self.z_m[0] - np.interp(s_m, self.s_m, self.z_m)
        return float(np.degrees(np.arctan2(drop, run)))

    def _height_over_line(self, angle_deg: float) -> FloatArray:
        """Ground minus line [m]; negative where the line passes above the ground."""
        drop = np.tan(np.radians(angle_deg)) * (self.x_m - self.x_m[0])
        return np.asarray(self.z_m - self.z_m[0] + drop)


def alpha_beta(x_m: ArrayLike, z_m: ArrayLike, slope_rad: ArrayLike) -> AlphaBeta:
    """Set up the alpha-beta model on a track that starts at the release point.

    Parameters
    ----------
    x_m, z_m : (n_points,) array, m
        Horizontal distance, increasing, and elevation; the first point is the top of the release area.
    slope_rad : (n_points,) array, radians
        Smoothed slope angle at the points, downhill positive. The beta point lies where it first falls to
        10 degrees after having been steeper, linear between points; a track read off a terrain model
        needs smoothing first or a bench of a few metres is taken for the valley.

    Returns
    -------
    AlphaBeta

    Raises
    ------
    ValueError
        If the arrays do not fit together or the slope never falls to 10 degrees.
    """
    x, z, slope = (np.asarray(values, dtype=float) for values in (x_m, z_m, slope_rad))
    if not (x.ndim == 1 and len(x) >= 2 and x.shape == z.shape == slope.shape):
        shapes = f"{x.shape}, {z.shape}, {slope.shape}"
        raise ValueError(f"x, z and slope must be equally long arrays, found {shapes}")
    if not np.all(np.isfinite([x, z, slope])) or np.any(np.diff(x) <= 0):
        raise ValueError("x must increase and x, z and slope must be finite")
    s = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(z)))])
    excess = slope - np.radians(BETA_SLOPE_DEG)
    falls = np.flatnonzero((excess[:-1] > 0) & (excess[1:] <= 0))
    if len(falls) == 0:
        found = f"it lies between {np.degrees(slope.min()):.1f} and {np.degrees(slope.max()):.1f}"
        raise ValueError(
            f"the slope never falls to {BETA_SLOPE_DEG:g} degrees ({found}); extend the track downhill"
        )
    i = falls[0]
    share = excess[i] / (excess[i] - excess[i + 1])
    beta_s = float(s[i] + share * (s[i + 1] - s[i]))
    run = np.interp(beta_s, s, x) - x[0]
    drop = z[0] - np.interp(beta_s, s, z)
    return AlphaBeta(s, x, z, beta_s, float(np.degrees(np.arctan2(drop, run))))
