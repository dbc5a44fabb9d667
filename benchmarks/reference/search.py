"""Where the likelihood of each event is: a search of a wide box that starts from nothing.

Points fill the box first. Then points are put, again and again, around those found, their likelihoods raised
to a power that grows to one. No mode of another program, no gradient and no linear model is used.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri
from scipy.stats import qmc

from skred.diagnosis.evidence.extension import Extension
from skred.inference.reading_density import log_likelihoods

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Envelope = Callable[[FloatArray], FloatArray]
"""Log of roughly how probable log coefficients are over populations, (k, n) to (k,)."""
BOX = (-8.0, 1.8)
"""Log coefficients that are searched, around the logarithm of the scale of their median's prior."""
_FIRST, _EACH, _TURNS = 2048, 256, 14
_WANTED = 40.0


@dataclass(frozen=True, eq=False)
class Recorded:
    """The law with something added at one coefficient, and the recordings.

    Points are log coefficients and, last, the release's deviation in its standard deviations.
    """

    extension: Extension
    coefficients: FloatArray

    @property
    def n_events(self) -> int:
        """Number of events."""
        return self.extension.problem.campaign.n_events

    @property
    def n(self) -> int:
        """Number of the base law's coefficients."""
        return self.extension.n_base

    @property
    def loose(self) -> NDArray[np.bool_]:
        """Whose release is uncertain, (n_events,)."""
        return self.extension.problem.releases.uncertain

    def log_likelihood(self, events: IntArray, points: FloatArray) -> FloatArray:
        """Of points of events, (k,) and (k, n + 1) to (k,); a release's own prior density is not in it."""
        problem = self.extension.problem
        result = np.empty(len(events))
        for part in np.array_split(np.arange(len(events)), max(1, len(events) // 20000)):
            seen = self.extension.predict(events[part], points[part], self.coefficients)
            result[part] = log_likelihoods(events[part], seen, problem.readings, problem.error_model.errors)
        return np.maximum(np.nan_to_num(result, nan=-1e6), -1e6)


def wide_envelope(log_scale: FloatArray) -> Envelope:
    """What the prior says of an event's log coefficients, roughly."""

    def envelope(points: FloatArray) -> FloatArray:
        z = (points - log_scale) / 1.2
        return np.asarray(np.sum(z - 0.5 * np.exp(2.0 * np.minimum(z, 3.0)), axis=1))

    return envelope


def search(
    recorded: Recorded, log_scale: FloatArray, envelope: Envelope, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Points of each event, (n_events, k, n + 1), and their log likelihoods with the release's density."""
    n_events, n = recorded.n_events, recorded.n
    axes = n + int(recorded.loose.any())
    numbers = qmc.Sobol(axes, scramble=True, rng=rng).random(_FIRST)
    points = np.zeros((n_events, _FIRST, n + 1))
    for event in range(n_events):
        own = np.clip((numbers + rng.random(axes)) % 1.0, 1e-9, 1.0 - 1e-9)
        points[event, :, :n] = log_scale + BOX[0] + (BOX[1] - BOX[0]) * own[:, :n]
        if axes > n:
            points[event, :, n] = ndtri(own[:, n]) * recorded.loose[event]
    height = heights(recorded, points, envelope)
    for _ in range(_TURNS):
        weights, power = _tempered(height)
        new = _around(points, weights, axes, rng)
        new[:, :, :n] = np.clip(new[:, :, :n], log_scale + BOX[0], log_scale + BOX[1])
        new[:, :, n] *= recorded.loose[:, None]
        points = np.concatenate([points, new], axis=1)
        height = np.concatenate([height, heights(recorded, new, envelope)], axis=1)
        if (power >= 1.0).all():
            break
    over = envelope(points.reshape(-1, n + 1)[:, :n]).reshape(height.shape)
    return points, height - over


def heights(recorded: Recorded, points: FloatArray, envelope: Envelope) -> FloatArray:
    """Log likelihood, log envelope and log density of the release, (n_events, k)."""
    n_events, k, n = points.shape[0], points.shape[1], recorded.n
    flat = points.reshape(-1, n + 1)
    events = np.repeat(np.arange(n_events), k)
    found = recorded.log_likelihood(events, flat) + envelope(flat[:, :n]) - 0.5 * flat[:, n] ** 2
    return found.reshape(n_events, k)


def _tempered(height: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Weights of each event's points, and the power at which enough of them count."""
    away = height - height.max(axis=1, keepdims=True)

    def effective(power: FloatArray) -> FloatArray:
        weights = np.exp(power[:, None] * away)
        return np.asarray(weights.sum(axis=1) ** 2 / np.sum(weights**2, axis=1))

    low, high = np.zeros(len(height)), np.ones(len(height))
    power = np.where(effective(high) > _WANTED, 1.0, 0.0)
    for _ in range(30):
        middle = 0.5 * (low + high)
        enough = effective(middle) > _WANTED
        low, high = np.where(enough, middle, low), np.where(enough, high, middle)
    power = np.where(power == 1.0, 1.0, low)
    weights = np.exp(power[:, None] * away)
    return weights / weights.sum(axis=1, keepdims=True), power


def _around(points: FloatArray, weights: FloatArray, axes: int, rng: np.random.Generator) -> FloatArray:
    """New points around weighted ones: half of them near, half of them nearer."""
    n_events, _, size = points.shape
    new = np.zeros((n_events, _EACH, size))
    steps = (np.arange(_EACH) + 0.5) / _EACH
    for event in range(n_events):
        own = points[event, :, :axes]
        mean = weights[event] @ own
        away = own - mean
        covariance = (weights[event] * away.T) @ away + 1e-12 * np.eye(axes)
        chosen = np.minimum(np.searchsorted(np.cumsum(weights[event]), steps), len(own) - 1)
        width = np.where(np.arange(_EACH) % 2 == 0, 0.7, 0.25)[:, None]
        kernel = rng.standard_normal((_EACH, axes)) @ np.linalg.cholesky(covariance).T
        new[event, :, :axes] = own[chosen] + width * kernel
    return new
