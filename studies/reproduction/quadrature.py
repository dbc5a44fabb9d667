"""Posterior of one or two strengths on a grid: a second route to what the chains say, without noise.

The likelihood of a front has steps (a front passes the bowl or stops in it) and kinks, which rule
out Gauss rules and Laplace's method. A fine regular grid does not mind, and at a few microseconds a
run it takes about a second.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, label, maximum_filter
from scipy.special import logsumexp

FloatArray = NDArray[np.float64]
LogDensity = Callable[[FloatArray], FloatArray]

DEPTH = 20.0
"""Grid cells this many nats below the highest one are left out."""
PRIOR_WIDTHS = 5.0
"""The first box ends at this multiple of the half-normal prior's scale: all but 6e-7 of it."""
SMOOTHING_SD = 0.15
"""Modes are counted after smoothing with this share of the posterior sd: a step across a square grid
is jagged, and every tooth of it would count as a mode."""
LOWEST_MODE = 0.01
"""A mode lower than this share of the highest one is not counted."""
DIP = 0.8
"""Nor is one from which a way to a higher one never falls below this share of its own height."""
_SEARCH_CELLS = {1: 2001, 2: 151}
_FINAL_CELLS = {1: 20001, 2: 301}
_MAX_ROUNDS = 8
_CHUNK = 20_000


@dataclass(frozen=True, eq=False)
class GridPosterior:
    """Posterior on a regular grid.

    Attributes
    ----------
    axes : tuple of (n_i,) arrays
        Cell centres of each parameter.
    weights : (n_1, ..., n_k) array
        Probability of each cell; sums to 1.
    log_evidence : float
        Log of the integral of likelihood times prior.
    """

    axes: tuple[FloatArray, ...]
    weights: FloatArray
    log_evidence: float

    @cached_property
    def nodes(self) -> FloatArray:
        """Cell centres that carry weight, (n, k)."""
        return _mesh(self.axes)[self._kept]

    @cached_property
    def node_weights(self) -> FloatArray:
        """Probability of `nodes`, (n,); sums to 1."""
        kept = self.weights.ravel()[self._kept]
        return np.asarray(kept / kept.sum())

    @cached_property
    def _kept(self) -> NDArray[np.bool_]:
        flat = self.weights.ravel()
        return np.asarray(flat > 1e-10 * flat.max())

    def expect(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Mean and standard deviation of values at the `nodes`, (n, ...) to (...)."""
        mean = np.tensordot(self.node_weights, values, axes=(0, 0))
        variance = np.tensordot(self.node_weights, (values - mean) ** 2, axes=(0, 0))
        return np.asarray(mean), np.sqrt(variance)

    @cached_property
    def mean(self) -> FloatArray:
        """Posterior mean, (k,)."""
        return self.expect(self.nodes)[0]

    @cached_property
    def sd(self) -> FloatArray:
        """Posterior standard deviation, (k,)."""
        return self.expect(self.nodes)[1]

    @cached_property
    def highest(self) -> FloatArray:
        """Cell of the largest posterior density, (k,)."""
        place = np.unravel_index(int(np.argmax(self.weights)), self.weights.shape)
        return np.array([axis[i] for axis, i in zip(self.axes, place, strict=True)])

    def marginal(self, parameter: int) -> FloatArray:
        """Probability of the cells of one axis."""
        others = tuple(i for i in range(self.weights.ndim) if i != parameter)
        return np.asarray(self.weights.sum(axis=others))

    def quantiles(self, parameter: int, shares: Sequence[float]) -> FloatArray:
        """Quantiles of one parameter."""
        axis, cumulative = self.axes[parameter], np.cumsum(self.marginal(parameter))
        half = 0.5 * (axis[1] - axis[0])
        edges = np.concatenate([axis - half, [axis[-1] + half]])
        return np.asarray(np.interp(shares, np.concatenate([[0.0], cumulative]), edges))

    @property
    def correlation(self) -> float:
        """Linear correlation of two parameters."""
        a, b = (self.nodes - self.mean).T
        return float((self.node_weights * a * b).sum() / np.prod(self.sd))

    @property
    def bend(self) -> float:
        """Share of the second parameter's variance that only a curved line in the first explains.

        The correlation ratio less the squared correlation: 0 for any normal distribution.
        """
        first = self.marginal(0)
        conditional = (self.weights @ self.axes[1]) / np.where(first > 0, first, 1.0)
        explained = (first * (conditional - self.mean[1]) ** 2).sum() / self.sd[1] ** 2
        return float(explained - self.correlation**2)

    @cached_property
    def modes(self) -> list[tuple[FloatArray, float]]:
        """Modes of the smoothed posterior, highest first: place and height relative to the highest."""
        cell = [axis[1] - axis[0] for axis in self.axes]
        widths = [SMOOTHING_SD * sd / h for sd, h in zip(self.sd, cell, strict=True)]
        smooth = gaussian_filter(self.weights, widths, mode="nearest")
        found = (smooth == maximum_filter(smooth, size=3, mode="nearest")) & (
            smooth > LOWEST_MODE * smooth.max()
        )
        places = sorted(zip(*np.nonzero(found), strict=True), key=lambda place: -smooth[place])
        places = [p for i, p in enumerate(places) if not _joined(smooth, p, places[:i])]
        return [
            (
                np.array([axis[i] for axis, i in zip(self.axes, place, strict=True)]),
                float(smooth[place] / smooth.max()),
            )
            for place in places
        ]


def grid_posterior(
    log_likelihood: LogDensity, prior_scales: Sequence[float], cells: int | None = None
) -> GridPosterior:
    """Posterior of strengths with half-normal priors.

    Parameters
    ----------
    log_likelihood : callable
        (n, k) strengths to (n,) log likelihoods.
    prior_scales : sequence of float
        Scale of each half-normal prior; one or two.
    cells : int, optional
        Cells of the final grid in each direction.

    Raises
    ------
    ValueError
        If the likelihood vanishes wherever it is looked for.
    """
    scales = np.asarray(prior_scales, dtype=float)
    k = len(scales)
    low, high = np.zeros(k), PRIOR_WIDTHS * scales
    for _ in range(_MAX_ROUNDS):
        axes, log_posterior = _evaluate(log_likelihood, scales, low, high, _SEARCH_CELLS[k])
        new_low, new_high = _box(axes, log_posterior)
        shrunk = np.prod((new_high - new_low) / (high - low))
        low, high = new_low, new_high
        if shrunk > 0.7:
            break
    axes, log_posterior = _evaluate(log_likelihood, scales, low, high, cells or _FINAL_CELLS[k])
    volume = float(np.prod([axis[1] - axis[0] for axis in axes]))
    total = float(logsumexp(log_posterior))
    return GridPosterior(axes, np.exp(log_posterior - total), total + np.log(volume))


def _evaluate(
    log_likelihood: LogDensity, scales: FloatArray, low: FloatArray, high: FloatArray, n: int
) -> tuple[tuple[FloatArray, ...], FloatArray]:
    """Log likelihood plus log prior at the centres of n cells in each direction."""
    centres = (np.arange(n) + 0.5) / n
    axes = tuple(a + (b - a) * centres for a, b in zip(low, high, strict=True))
    nodes = _mesh(axes)
    values = np.concatenate([log_likelihood(nodes[i : i + _CHUNK]) for i in range(0, len(nodes), _CHUNK)])
    log_prior = np.sum(0.5 * np.log(2 / np.pi) - np.log(scales) - 0.5 * (nodes / scales) ** 2, axis=1)
    posterior = np.where(np.isnan(values), -np.inf, values) + log_prior
    return axes, posterior.reshape([len(axis) for axis in axes])


def _box(axes: tuple[FloatArray, ...], log_posterior: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Box around the cells that matter, one cell wider at each side, never below 0."""
    if not np.isfinite(log_posterior).any():
        raise ValueError("the likelihood vanishes on the whole search grid: narrower priors or more cells")
    deep = np.argwhere(log_posterior > log_posterior.max() - DEPTH)
    cell = np.array([axis[1] - axis[0] for axis in axes])
    first = np.array([axis[i] for axis, i in zip(axes, deep.min(axis=0), strict=True)])
    last = np.array([axis[i] for axis, i in zip(axes, deep.max(axis=0), strict=True)])
    return np.maximum(first - 1.5 * cell, 0.0), last + 1.5 * cell


def _joined(heights: FloatArray, place: tuple[int, ...], higher: list[tuple[int, ...]]) -> bool:
    """Whether a maximum is but a shoulder of a higher one."""
    islands, _ = label(heights > DIP * heights[place])
    return any(islands[other] == islands[place] for other in higher)


def _mesh(axes: Sequence[FloatArray]) -> FloatArray:
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
