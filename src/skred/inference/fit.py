"""Absolute check of fit: the recordings beside what the calibrated model predicts of such recordings.

Convergence says that the posterior was found, not that the model describes the recordings. Here whole sets
of recordings are predicted from the posterior: new avalanches from the recorded releases, with the recorded
gaps. At every sensor the recorded mean and standard deviation over avalanches are compared with the
predicted ones (posterior predictive check: Gelman, Meng and Stern, 1996, Statistica Sinica 6, 733-807).
That is two comparisons a sensor. The limit is simultaneous, from the largest deviation in each predicted set
(single-step max-T: Westfall and Young, 1993, "Resampling-based multiple testing", Wiley). The check is
conservative, because the model was fitted to the same recordings. So it can find a misfit, but a law that
passes need not be a good one: what a law misses widens the scatter that was fitted, and then lies within it.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from skred.arrays import BoolArray, FloatArray
from skred.campaign import Status
from skred.inference.intervals import INTERVAL_PROBABILITY
from skred.inference.problem import Problem

FIT_LEVEL = 0.01
"""Probability, at most, that a right model is said to miss anywhere. It is the level of the bootstrap test of
a diagnosis, so that both alarm equally rarely."""
_CAUTION = {
    "pooled": "the scatter around the response was fitted to the same readings, and can take up what the"
    " law misses",
    "hierarchical": "how much avalanches differ was fitted to the same readings, and can take up what the law"
    " misses",
}
"""Why passing the check says little, by likelihood."""
_MOST_NAMED = 3
"""Sensors that a sentence describes one by one; of more it says how many."""
_MEAN, _SD = range(2)
"""Statistics of a sensor, as `_moments` has them."""


@dataclass(frozen=True)
class SensorFit:
    """How a calibrated model fits at one sensor.

    Readings are 0 where the front is known not to have come.

    Attributes
    ----------
    sensor, unit : str
    n_recorded : int
        Avalanches of which it is known what the sensor reads.
    recorded_mean, recorded_sd : float or None, m/s or m
        Over those avalanches; None where there are none, or for the standard deviation less than two.
    predicted_mean, predicted_sd : float or None, m/s or m
        The same of predicted recordings, their mean over the posterior.
    predicted_mean_se : float or None, m/s or m
        Standard deviation of the mean over predicted recordings.
    p_mean, p_sd : float or None
        How probable a deviation as large as the recorded mean's, or standard deviation's, is anywhere in
        predicted recordings: adjusted for the number of comparisons.
    inside : float or None
        Share of the recorded readings inside the central 90 % of the predicted ones.
    fits : bool
        Whether neither lies beyond the limit: no misfit was found. It need not fit.
    """

    sensor: str
    unit: str
    n_recorded: int
    recorded_mean: float | None
    recorded_sd: float | None
    predicted_mean: float | None
    predicted_sd: float | None
    predicted_mean_se: float | None
    p_mean: float | None
    p_sd: float | None
    inside: float | None
    fits: bool


def fit_entries(problem: Problem, predicted: FloatArray) -> dict[str, Any]:
    """The check of fit as plain data: ``fit`` by sensor, ``fits``, ``fit_level`` and ``fit_caution``.

    Parameters
    ----------
    problem : Problem
    predicted : (n, n_events, n_sensors) array, m/s or m
        Readings of new avalanches from the recorded releases, one set for each draw; 0 where the front does
        not come.
    """
    rows = sensor_fits(problem, predicted)
    return {
        "fit": [asdict(row) for row in rows],
        "fits": all(row.fits for row in rows),
        "fit_level": FIT_LEVEL,
        "fit_caution": f"That says little: {_CAUTION[problem.likelihood]}.",
        "bounds_left_out": int((problem.campaign.status >= Status.AT_LEAST).sum()),
    }


def sensor_fits(problem: Problem, predicted: FloatArray) -> list[SensorFit]:
    """The check of fit at each sensor; `predicted` as in `fit_entries`."""
    recorded, known = _recorded(problem)
    n_known = known.sum(axis=0)
    of_recorded, of_predicted = _moments(recorded, known), _moments(predicted, known)
    testable = np.stack([n_known >= 1, n_known >= 2])
    p = adjusted_p_values(of_recorded, of_predicted, testable)
    inside = _inside(recorded, predicted, known)
    centre, scale = of_predicted.mean(axis=0), of_predicted.std(axis=0, ddof=1)

    def of(values: FloatArray, statistic: int, sensor: int) -> float | None:
        return float(values[statistic, sensor]) if testable[statistic, sensor] else None

    return [
        SensorFit(
            sensor=sensor.id,
            unit="m" if sensor.is_runout else "m/s",
            n_recorded=int(n_known[k]),
            recorded_mean=of(of_recorded, _MEAN, k),
            recorded_sd=of(of_recorded, _SD, k),
            predicted_mean=of(centre, _MEAN, k),
            predicted_sd=of(centre, _SD, k),
            predicted_mean_se=of(scale, _MEAN, k),
            p_mean=of(p, _MEAN, k),
            p_sd=of(p, _SD, k),
            inside=float(inside[k]) if n_known[k] else None,
            fits=bool(p[:, k].min() > FIT_LEVEL),
        )
        for k, sensor in enumerate(problem.campaign.sensors)
    ]


def adjusted_p_values(recorded: FloatArray, predicted: FloatArray, testable: BoolArray) -> FloatArray:
    """P-values of statistics, adjusted for how many there are; 1 where one is not testable.

    Parameters
    ----------
    recorded : (...) array
        The statistics of the recordings.
    predicted : (n, ...) array
        The same of predicted recordings.
    testable : (...) boolean array
    """
    centre, scale = predicted.mean(axis=0), predicted.std(axis=0, ddof=1)
    # Where all predictions agree, such as on a front that never comes, any difference is a deviation.
    fixed = ~(scale > 0.0)
    distance = np.abs(recorded - centre) / np.where(fixed, 1.0, scale)
    distance = np.where(fixed & (distance > 1e-9 * np.abs(centre)), np.inf, distance)
    usual = np.abs(predicted - centre) / np.where(fixed, 1.0, scale)
    usual = np.where(testable & ~fixed, usual, 0.0)
    largest = np.sort(usual.reshape(len(predicted), -1).max(axis=1))
    exceeding = len(largest) - np.searchsorted(largest, distance, side="left")
    return np.where(testable, (exceeding + 1.0) / (len(largest) + 1.0), 1.0)


def calibration_statement(entry: dict[str, Any]) -> list[str]:
    """Whether the chains of a calibration converged, and whether a misfit was found: two questions.

    Priors that are not the law's own are told first.

    Parameters
    ----------
    entry : dict
        As `skred.inference.calibrate.Calibration.entry` makes it.
    """
    changed = [entry["prior_note"]] if entry.get("prior_note") else []
    return [*changed, *_calibration_statement(entry)]


def _calibration_statement(entry: dict[str, Any]) -> list[str]:
    gate = entry["gate"]
    aside = entry.get("bounds_left_out")
    unseen = [f"Readings known by bounds only ({aside}) take no part in the check of fit."] if aside else []
    measured = f"r-hat at most {gate['r_hat_max']:.3f}, effective draws at least {gate['ess_bulk_min']:.0f}"
    if not gate["passed"]:
        return [f"THE CHAINS DID NOT CONVERGE: do not use this result ({measured})", *gate["problems"]]
    if entry["fits"]:
        return [
            f"The chains converged ({measured}).",
            "No misfit was found in the mean or the standard deviation of the readings at any sensor"
            f" (level {100 * entry['fit_level']:g} % over all sensors). {entry['fit_caution']}"
            " Whether another law predicts better is a question of a comparison.",
            *unseen,
        ]
    return [
        f"The chains converged ({measured}), but the model misses the recordings at {missed_sensors(entry)}.",
        *fit_sentences(entry),
        *unseen,
    ]


def fit_sentences(entry: dict[str, Any]) -> list[str]:
    """Where a model misses the recordings, the largest deviations first; none where it fits.

    Parameters
    ----------
    entry : dict
        With ``fit`` as `fit_entries` makes it.
    """
    missed = sorted(
        (row for row in entry["fit"] if not row["fits"]), key=lambda row: min(_p(row, "mean"), _p(row, "sd"))
    )
    sentences = [_miss(row) for row in missed[:_MOST_NAMED]]
    if len(missed) > _MOST_NAMED:
        more = len(missed) - _MOST_NAMED
        sentences.append(f"It misses at {more} further {'sensor' if more == 1 else 'sensors'} too.")
    return sentences


def missed_sensors(entry: dict[str, Any]) -> str:
    """The sensors at which a model misses, in the order of the campaign, for a sentence."""
    names = [row["sensor"] for row in entry["fit"] if not row["fits"]]
    if len(names) > 2 * _MOST_NAMED:
        return f"{len(names)} of {len(entry['fit'])} sensors"
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def _miss(row: dict[str, Any]) -> str:
    """What is missed most at one sensor."""
    what = "mean" if _p(row, "mean") <= _p(row, "sd") else "sd"
    decimals = 0 if row["unit"] == "m" else 1
    predicted, recorded = (f"{row[f'{who}_{what}']:.{decimals}f}" for who in ("predicted", "recorded"))
    name = {"mean": "mean reading", "sd": "standard deviation between avalanches"}[what]
    return (
        f"At {row['sensor']} it predicts a {name} of {predicted} {row['unit']};"
        f" the {row['n_recorded']} recorded avalanches have {recorded} {row['unit']}."
    )


def _p(row: dict[str, Any], what: str) -> float:
    value = row[f"p_{what}"]
    return 1.0 if value is None else float(value)


def _recorded(problem: Problem) -> tuple[FloatArray, BoolArray]:
    """Readings, 0 where the front did not come, and of which it is known what they are."""
    known = problem.observed | problem.not_reached
    return np.where(problem.observed, problem.campaign.values, 0.0), known


def _moments(readings: FloatArray, known: BoolArray) -> FloatArray:
    """Mean and standard deviation over known events, (..., n_events, n_sensors) to (..., 2, n_sensors)."""
    n = known.sum(axis=0)
    mean = readings.sum(axis=-2, where=known) / np.maximum(n, 1)
    squares = ((readings - mean[..., None, :]) ** 2).sum(axis=-2, where=known)
    return np.stack([mean, np.sqrt(squares / np.maximum(n - 1, 1))], axis=-2)


def _inside(recorded: FloatArray, predicted: FloatArray, known: BoolArray) -> FloatArray:
    """Share of each sensor's readings inside the central interval of the predicted ones."""
    tail = 0.5 * (1.0 - INTERVAL_PROBABILITY)
    low, high = np.quantile(predicted, [tail, 1.0 - tail], axis=0)
    share: FloatArray = (known & (low <= recorded) & (recorded <= high)).sum(axis=0) / np.maximum(
        known.sum(axis=0), 1
    )
    return share
