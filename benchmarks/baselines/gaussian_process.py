"""A Gaussian process for what the best base fit leaves in the readings, averaged over events.

Place: where the process is most standard deviations away from zero, the "largest residual". Name, by a fixed
rule: the candidate whose mean change of the readings, events and population refitted to it in the linear
model, has the largest cosine with the mean residuals (in size, where a strength may have either sign).
Residuals live in observation space: what a missing force does below its place stays there.
"""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import NDArray

from skred.campaign import Campaign

from .common import Answer, Stretch, is_dense, nearest
from .quick_fit import QuickFit, quick_fit

FloatArray = NDArray[np.float64]
# Tuned on development trials, seeds 5000-5029 and 5100-5159; see `common`.
LIMITS = {"sparse": 0.71, "dense": 2.1}
_HALF_STRETCH_M = 50.0
_POINTS = 200


def mean_residuals(fit: QuickFit) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Places [m], mean residuals in units of the errors, and their standard errors; the stop is last."""
    residual, weight = _whitened(fit)
    known = weight > 0.0
    count = known.sum(axis=0)
    mean = np.sum(residual, axis=0) / np.maximum(count, 1)
    return _places(fit), mean, 1.0 / np.sqrt(np.maximum(count, 1e-9))


def _whitened(fit: QuickFit) -> tuple[FloatArray, FloatArray]:
    """Residuals over their errors, and inverse errors, (n_events, n_sensors + 1); 0 where there is none."""
    curvature = fit.modes.curvature
    weight = np.sqrt(np.maximum(curvature, 0.0))
    safe = np.where(weight > 0.0, weight, 1.0)
    return np.where(weight > 0.0, fit.modes.slope / safe, 0.0), weight


def _places(fit: QuickFit) -> FloatArray:
    stop = float(np.mean(fit.modes.predictions[:, -1]))
    places = [stop if one is None else 0.5 * (one[0] + one[1]) for one in fit.problem.sensor_places]
    return np.array([*places, stop])


def patterns(fit: QuickFit) -> FloatArray:
    """Mean change of the readings by each candidate after refitting, (n, n_sensors + 1), in their errors."""
    modes, rows = fit.score_test.around(fit.rows, fit.modes.points), fit.rows
    weight = np.sqrt(np.maximum(fit.modes.curvature, 0.0))[:, :, None]
    by_points, by_strengths = (
        weight * modes.by_points,
        weight * modes.by_strengths[:, :, fit.score_test.order],
    )
    n = fit.population.mean.shape[1]
    precision = fit.population.precision[rows.group]
    cover = np.linalg.inv(np.einsum("eij,eik->ejk", by_points, by_points) + precision)

    def left(columns: FloatArray) -> FloatArray:
        pulled = np.einsum("eij,eik->ejk", by_points, columns, optimize=True)
        inside = np.einsum("ejk,ekl->ejl", cover, pulled, optimize=True)
        return np.asarray(columns - np.einsum("eij,ejk->eik", by_points, inside, optimize=True))

    shared, added = left(by_points[:, :, :n]), left(by_strengths)
    total = np.einsum("eij,eik->jk", by_points[:, :, :n], shared) + 1e-9 * np.eye(n)
    crossed = np.einsum("eij,eik->jk", by_points[:, :, :n], added, optimize=True)
    added = added - np.einsum("eij,jk->eik", shared, np.linalg.solve(total, crossed), optimize=True)
    count = np.maximum((weight > 0.0).sum(axis=0), 1)
    return np.asarray((added.sum(axis=0) / count).T)


def process(places: FloatArray, mean: FloatArray, error: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Where, and how many standard deviations from zero, the process is along the track."""
    # Here: scikit-learn comes with the group of benchmarks only.
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel
    from threadpoolctl import threadpool_limits

    span = float(np.ptp(places))
    kernel = ConstantKernel(0.3, (1e-2, 30.0)) * RBF(0.15 * span, (0.03 * span, 1.0 * span))
    with warnings.catch_warnings(), threadpool_limits(1):  # small matrices: threads only wait
        warnings.simplefilter("ignore", ConvergenceWarning)  # a length at its bound is an answer
        model = GaussianProcessRegressor(kernel, alpha=error**2).fit(places[:, None], mean)
    along = np.linspace(places.min(), places.max(), _POINTS)
    found, sd = model.predict(along[:, None], return_std=True)
    return along, found / np.maximum(sd, 1e-9)


class LargestResidual:
    """Largest residual of the best base fit."""

    id = "gaussian_process"

    def answer(self, campaign: Campaign, base_law: str) -> Answer:
        """Fit, average, smooth, and look for the nearest pattern."""
        fit = quick_fit(campaign, base_law)
        places, mean, error = mean_residuals(fit)
        read = error < 1.0
        along, z = process(places[read], mean[read], error[read])
        top = int(np.argmax(np.abs(z)))
        stretch: Stretch = (float(along[top]) - _HALF_STRETCH_M, float(along[top]) + _HALF_STRETCH_M)
        limit = LIMITS["dense" if is_dense(campaign) else "sparse"]
        similarity = similarities(fit, mean / error * read, patterns(fit) / error * read)
        return nearest(similarity, base_law, float(np.abs(z[top])), limit, stretch)


def similarities(fit: QuickFit, seen: FloatArray, expected: FloatArray) -> dict[str, float]:
    """Largest cosine of each mechanism's patterns with what is seen."""
    size = np.linalg.norm(expected, axis=1) * np.linalg.norm(seen)
    # A change that leaves nothing in the mean has no pattern.
    cosine = np.where(size > 1e-6, expected @ seen / np.maximum(size, 1e-300), 0.0)
    found: dict[str, float] = {}
    for one, value in zip(fit.score_test.placed_mechanisms, cosine, strict=True):
        similar = abs(float(value)) if one.added.either_sign else float(value)
        found[one.mechanism.id] = max(found.get(one.mechanism.id, -1.0), similar)
    return found
