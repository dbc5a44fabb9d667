"""Posterior predictive p-values alone, of a quick hierarchical fit.

New campaigns from the fitted population are compared with the recordings in every sensor's mean and standard
deviation over events, in the share of events it reads, in the correlation of neighbouring sensors, and in the
correlation of each sensor with each covariate. Alarm where the smallest of the two-sided p-values, times
their number, is below 0.05. It names what has the largest efficient score in standard deviations.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skred.campaign import Campaign
from skred.diagnosis.check.bootstrap_campaigns import bootstrap_campaigns

from .common import Answer, nearest
from .quick_fit import QuickFit, quick_fit, stretch_of

FloatArray = NDArray[np.float64]
LIMIT = 0.05
"""Given by the rule, not tuned."""
_REPLICAS = 4000
_BATCH = 250
_FEWEST = 5


def statistics(values: FloatArray, observed: NDArray[np.bool_], covariates: FloatArray) -> FloatArray:
    """Statistics of campaigns, (n_campaigns, n_statistics), NaN where too few events are read.

    Parameters
    ----------
    values, observed : (n_campaigns, n_events, n_sensors) arrays
    covariates : (n_covariates, n_events) array
        Standardised.
    """
    count = observed.sum(axis=1)
    enough = count >= _FEWEST
    mean = np.where(observed, values, 0.0).sum(axis=1) / np.maximum(count, 1)
    away = np.where(observed, values - mean[:, None], 0.0)
    sd = np.sqrt((away**2).sum(axis=1) / np.maximum(count - 1, 1))
    z = away / np.maximum(sd, 1e-9)[:, None]
    both = np.maximum((observed[:, :, 1:] & observed[:, :, :-1]).sum(axis=1), 1)
    beside = np.where(enough[:, 1:] & enough[:, :-1], (z[:, :, 1:] * z[:, :, :-1]).sum(axis=1) / both, np.nan)
    parts = [np.where(enough, mean, np.nan), np.where(enough, sd, np.nan), count / observed.shape[1], beside]
    for one in covariates:
        along = np.einsum("gej,e->gj", z, one) / np.maximum(count, 1)
        parts.append(np.where(enough, along, np.nan))
    return np.concatenate(parts, axis=1)


def smallest_p(seen: FloatArray, simulated: FloatArray) -> float:
    """Smallest two-sided p-value times the number of statistics, at most 1."""
    known = np.isfinite(seen)
    n = np.isfinite(simulated).sum(axis=0)
    known &= n > 0.5 * len(simulated)
    # Differences of rounding are none.
    slack = 1e-9 * (1.0 + np.abs(seen))
    above = (simulated >= seen - slack).sum(axis=0)
    below = (simulated <= seen + slack).sum(axis=0)
    p = 2.0 * (np.minimum(above, below) + 1.0) / (n + 1.0)
    return float(min(1.0, np.min(p[known], initial=1.0) * max(known.sum(), 1)))


def populations(fit: QuickFit, rng: np.random.Generator, n: int) -> tuple[FloatArray, FloatArray]:
    """Means and Cholesky factors of populations, about as uncertain as so many events leave them."""
    n_events, (k,) = fit.problem.campaign.n_events, fit.population.mean.shape[1:]
    covariance = fit.population.covariance[0]
    factor = np.linalg.cholesky(covariance)
    normal = rng.standard_normal((n, n_events - 1, k))
    scatter = np.linalg.inv(np.einsum("gei,gej->gij", normal, normal) / (n_events - 1))
    factors = factor[None] @ np.linalg.cholesky(scatter)
    own = rng.standard_normal((n, k, 1)) / np.sqrt(n_events)
    means = fit.population.mean[0] + (factors @ own)[:, :, 0]
    return means, factors


def corrected_p(fit: QuickFit, seed: int) -> float:
    """The smallest corrected p-value of a campaign."""
    rng = np.random.default_rng([seed, 31])
    covariates = np.array(list(fit.score_test.base.setting.covariates.values()))
    covariates = covariates.reshape(-1, fit.problem.campaign.n_events)
    readings = fit.problem.readings
    seen = statistics(readings.values[None], readings.observed[None], covariates)[0]
    simulated = []
    for _ in range(_REPLICAS // _BATCH):
        means, factors = populations(fit, rng, _BATCH)
        made, _ = bootstrap_campaigns(fit.score_test.base.extended(), np.zeros(0), means, factors, rng)
        shape = (_BATCH, *readings.values.shape)
        values, observed = made.readings.values.reshape(shape), made.readings.observed.reshape(shape)
        simulated.append(statistics(values, observed, covariates))
    return smallest_p(seen, np.concatenate(simulated))


class PosteriorPredictive:
    """Posterior predictive p-values."""

    id = "posterior_predictive"

    def answer(self, campaign: Campaign, base_law: str) -> Answer:
        """Check the base law and name the largest score."""
        fit = quick_fit(campaign, base_law)
        p = corrected_p(fit, int(campaign.fingerprint()[:8], 16))
        score, own, _ = fit.score_test.of_candidates(fit.scores)
        z = score[0] / np.sqrt(own[0])
        largest: dict[str, float] = {}
        best, stretch = -np.inf, None
        for one, value in zip(fit.score_test.placed_mechanisms, z, strict=True):
            size = abs(float(value)) if one.added.either_sign else float(value)
            largest[one.mechanism.id] = max(largest.get(one.mechanism.id, -np.inf), size)
            if size > best:
                best, stretch = size, stretch_of(one.shape)
        return nearest(largest, base_law, float(np.log10(1.0 / p)), float(np.log10(1.0 / LIMIT)), stretch)
