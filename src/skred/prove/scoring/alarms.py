"""False alarms where nothing is hidden, and detection against signal-to-noise where something is."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.special import expit

from skred.arrays import FloatArray
from skred.prove.scoring.answers import Pair, within
from skred.prove.scoring.intervals import SEED, interval_of, share, upper_limit
from skred.prove.scoring.standards import SNR_BINS

AT = (5.5, 7.0)
"""Signal-to-noise at which detection is asked for."""
_CURVE = np.linspace(2.0, 13.0, 45)
_CENTRE, _WIDTH = 6.0, 2.0
_PRIOR_SD = 5.0
"""Of both coefficients: nothing where there are data, finite where all were found."""
_NEWTON_STEPS = 30
_FITS = 400


def false_alarms(pairs: Sequence[Pair]) -> dict[str, Any]:
    """Alarms where nothing is hidden: plain, contaminated, both, and by kind of contamination.

    An alarm is the verdict missing_physics, instrument or unexplained. A crash or time-out is no alarm but
    a wrong answer: it counts in what is named ``with_failures``.
    """
    nulls = [pair for pair in pairs if pair.is_null]
    contaminated = [pair for pair in nulls if pair.hidden == "nasty"]
    kinds = sorted({str(pair.truth.get("nasty")) for pair in contaminated})
    return {
        "plain": _alarms([pair for pair in nulls if pair.hidden == "nothing"]),
        "nasty": _alarms(contaminated),
        "all": _alarms(nulls),
        "by_nastiness": {
            kind: _alarms([pair for pair in contaminated if str(pair.truth.get("nasty")) == kind])
            for kind in kinds
        },
    }


def _alarms(pairs: Sequence[Pair]) -> dict[str, Any]:
    wrong = [pair.alarm or pair.failed for pair in pairs]
    return {
        **share([pair.alarm for pair in pairs]),
        "upper_limit_one_sided_95": upper_limit([pair.alarm for pair in pairs]),
        "failures": sum(pair.failed for pair in pairs),
        "with_failures": {**share(wrong), "upper_limit_one_sided_95": upper_limit(wrong)},
    }


def detection(pairs: Sequence[Pair]) -> dict[str, Any]:
    """Alarms where something is hidden, by signal-to-noise, by what is hidden, and a logistic fit."""
    hidden = [pair for pair in pairs if not pair.is_null]
    groups = sorted({pair.hidden for pair in hidden})
    return {
        "all": share([pair.alarm for pair in hidden]),
        "by_snr": [
            {"snr_from": low, "snr_to": high, **share([pair.alarm for pair in within(hidden, (low, high))])}
            for low, high in SNR_BINS
        ],
        "by_hidden": {
            group: share([pair.alarm for pair in hidden if pair.hidden == group]) for group in groups
        },
        "fit": _fit([pair.snr for pair in hidden], [pair.alarm for pair in hidden]),
    }


def _fit(snr: Sequence[float], found: Sequence[bool]) -> dict[str, Any]:
    """Detection as a logistic function of signal-to-noise, its intervals by bootstrap over trials."""
    n = len(snr)
    if n == 0:
        nothing = {"n": 0, "value": None, "low": None, "high": None}
        return {"n": 0, "at": {f"{at:g}": dict(nothing) for at in AT}, "curve": None}
    x, y = np.asarray(snr, dtype=float), np.asarray(found, dtype=float)
    counts = np.random.default_rng(SEED).multinomial(n, np.full(n, 1.0 / n), size=_FITS)
    weights = np.vstack([np.ones(n), counts])
    coefficients = logistic_coefficients(x, y, weights)

    def curve(places: FloatArray) -> FloatArray:
        return np.asarray(expit(coefficients @ _design(places).T))

    at = {}
    for place, values in zip(AT, curve(np.array(AT)).T, strict=True):
        low, high = interval_of(values[1:])
        at[f"{place:g}"] = {"n": n, "value": float(values[0]), "low": low, "high": high}
    lines = curve(_CURVE)
    low_line, high_line = np.quantile(lines[1:], [0.025, 0.975], axis=0)
    return {
        "n": n,
        "at": at,
        "curve": {
            "snr": _CURVE.tolist(),
            "value": lines[0].tolist(),
            "low": low_line.tolist(),
            "high": high_line.tolist(),
        },
    }


def _design(snr: FloatArray) -> FloatArray:
    return np.column_stack([np.ones(len(snr)), (snr - _CENTRE) / _WIDTH])


def logistic_coefficients(snr: FloatArray, found: FloatArray, weights: FloatArray) -> FloatArray:
    """Logistic regression on signal-to-noise by Newton's method, many weightings at once.

    Parameters
    ----------
    snr, found : (n,) arrays
        `found` is 0 or 1.
    weights : (n_fits, n) array
        How often each trial counts.

    Returns
    -------
    (n_fits, 2) array
        Intercept at a signal-to-noise of 6, slope per 2 of it; both have a wide normal prior.
    """
    design = _design(snr)
    coefficients = np.zeros((len(weights), 2))
    for _ in range(_NEWTON_STEPS):
        expected = expit(coefficients @ design.T)
        gradient = (weights * (found - expected)) @ design - coefficients / _PRIOR_SD**2
        curvature = np.einsum("bn,ni,nj->bij", weights * expected * (1.0 - expected), design, design)
        curvature += np.eye(2) / _PRIOR_SD**2
        step = np.linalg.solve(curvature, gradient[..., None])[..., 0]
        coefficients += np.clip(step, -2.0, 2.0)
    return coefficients
