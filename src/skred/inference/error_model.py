"""Error models: how readings scatter about what one front does; and recordings as they enter the likelihood.

The relative part of an error refers to the prediction, not to the noisy reading. The place where a front
stopped enters once: as an interval between the lowest sensor that the front reached and the highest that it
did not reach, with soft ends because places are uncertain.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from skred.arrays import BoolArray, FloatArray, IntArray
from skred.campaign import Campaign, Status

DEFAULT_ERRORS = "robust"
OUTLIER_FACTOR = 6.0
"""How much wider than its stated error an outlying reading scatters."""
PLACE_SD_M = 8.0
"""Standard deviation [m] of the place where a front stopped, relative to a sensor."""


class Errors(NamedTuple):
    """An error model for compiled code: a mixture of cases, one case for each event.

    Attributes
    ----------
    weights, scales, shares : (n,) arrays
        Probability of each case, the factor on all stated errors in it, and its share of outliers.
    log_weights, log_scales : (n,) arrays
        Their logarithms, which a calibration needs millions of times.
    degrees : float
        Degrees of freedom of Student's t; 0 for the normal distribution.
    common : float
        Share of a velocity's error variance that all velocities of an event have in common.
    """

    weights: FloatArray
    scales: FloatArray
    shares: FloatArray
    log_weights: FloatArray
    log_scales: FloatArray
    degrees: float
    common: float


@dataclass(frozen=True)
class ErrorModel:
    """An error model with its name.

    Attributes
    ----------
    id, title : str
    errors : Errors
    """

    id: str
    title: str
    errors: Errors

    def draw(
        self,
        predictions: FloatArray,
        sd: FloatArray,
        is_velocity: BoolArray,
        rng: np.random.Generator,
    ) -> FloatArray:
        """Readings of avalanches, with errors.

        Parameters
        ----------
        predictions : (..., n_sensors) array, m/s or m
            Readings without errors. A row is one avalanche: its readings share what the model has in common.
        sd : (..., n_sensors) array
            Stated standard deviations, as `EventReadings.sd` gives them.
        is_velocity : (n_sensors,) boolean array
        rng : numpy Generator
        """
        errors, shape = self.errors, predictions.shape
        case = rng.choice(len(errors.weights), size=shape[:-1], p=errors.weights)[..., None]
        noise = rng.standard_normal(shape)
        if errors.common > 0.0:
            shared = np.sqrt(errors.common) * rng.standard_normal((*shape[:-1], 1))
            noise = np.where(is_velocity, shared + np.sqrt(1.0 - errors.common) * noise, noise)
        if errors.degrees > 0.0:
            noise = noise * np.sqrt(errors.degrees / rng.chisquare(errors.degrees, shape))
        outlying = rng.random(shape) < errors.shares[case]
        noise = noise * np.where(outlying, OUTLIER_FACTOR, 1.0) * errors.scales[case]
        readings: FloatArray = predictions + sd * noise
        return readings

    @property
    def variance(self) -> float:
        """Variance of an error that `draw` makes, in stated variances."""
        errors = self.errors
        widened = 1.0 + errors.shares * (OUTLIER_FACTOR**2 - 1.0)
        tails = errors.degrees / (errors.degrees - 2.0) if errors.degrees > 0.0 else 1.0
        return float(tails * (errors.weights @ (errors.scales**2 * widened)))


def _errors(
    weights: Any = 1.0, scales: Any = 1.0, shares: Any = 0.0, degrees: float = 0.0, common: float = 0.0
) -> Errors:
    weights, scales, shares = np.broadcast_arrays(*(np.atleast_1d(x) for x in (weights, scales, shares)))
    w, s, o = (np.array(values, dtype=float) for values in (weights, scales, shares))
    return Errors(w, s, o, np.log(w), np.log(s), degrees, common)


_NODES = np.linspace(-4.0, 4.0, 27)
"""Evenly spaced nodes of a standard normal variable. Many readings determine an event's factor to a tenth;
Gauss-Hermite nodes would be too far apart for that."""
_WEIGHTS = np.exp(-0.5 * _NODES**2)
"""Standard normal density at the nodes, not normalised."""
ERROR_MODELS: dict[str, ErrorModel] = {
    model.id: model
    for model in (
        ErrorModel(
            "robust",
            "normal, with a few outliers (0.2 or 2 % of the readings, six times as wide)",
            _errors(weights=(0.5, 0.5), shares=(0.002, 0.02)),
        ),
        ErrorModel("normal", "normal, as stated", _errors()),
        ErrorModel("student", "Student t with 4 degrees of freedom", _errors(degrees=4.0)),
        ErrorModel(
            "correlated",
            "normal; half of the error variance of an event's velocities is common",
            _errors(common=0.5),
        ),
        ErrorModel(
            "scaled",
            "normal, all errors of an event times a log-normal factor (log standard deviation 0.5)",
            _errors(weights=_WEIGHTS / _WEIGHTS.sum(), scales=np.exp(0.5 * _NODES)),
        ),
    )
}
"""Error models by name. A comparison of laws compares them too."""


class EventReadings(NamedTuple):
    """The recordings as they enter the likelihood, made by `event_readings`.

    Attributes
    ----------
    values : (n_events, n_sensors) array, m/s or m
        0 where there is no reading.
    observed : (n_events, n_sensors) boolean array
    stated_sd : (n_events, n_sensors) array
        Of readings that state their own, 0 elsewhere.
    relative_sd, absolute_sd : (n_sensors,) arrays
        Of the other readings, new ones too: where a sensor states none, the usual one of its readings.
    is_velocity : (n_sensors,) boolean array
    reached, not_reached : (n_events,) arrays, m
        Lowest place that the front is known to have reached, -inf if none; highest that it is known not to
        have reached, inf if none.
    place_sd : float, m
    least, most : (n_events, n_sensors) arrays, m/s or m
        Bounds of readings that are known by these only; minus and plus infinity elsewhere.
    """

    values: FloatArray
    observed: BoolArray
    stated_sd: FloatArray
    relative_sd: FloatArray
    absolute_sd: FloatArray
    is_velocity: BoolArray
    reached: FloatArray
    not_reached: FloatArray
    place_sd: float
    least: FloatArray
    most: FloatArray

    @property
    def bounded(self) -> BoolArray:
        """Of which readings bounds are all that is known, (n_events, n_sensors)."""
        return np.isfinite(self.least) | np.isfinite(self.most)

    def take(self, events: IntArray) -> EventReadings:
        """Those of some events, in this order, perhaps repeated."""
        own = ("values", "observed", "stated_sd", "least", "most", "reached", "not_reached")
        return self._replace(**{name: getattr(self, name)[events] for name in own})

    def sd(self, event: int | IntArray, predictions: FloatArray) -> FloatArray:
        """Stated standard deviations of events' readings: their own where they state one, else the sensor's.

        Parameters
        ----------
        event : int or (n,) integer array
        predictions : (n, n_sensors) array, m/s or m
        """
        own = self.stated_sd[event]
        return np.where(own > 0.0, own, self.sensor_sd(predictions))

    def sensor_sd(self, predictions: FloatArray) -> FloatArray:
        """Standard deviations as the sensors state them, (..., n_sensors)."""
        sd: FloatArray = np.hypot(self.relative_sd * predictions, self.absolute_sd)
        return sd


class FrontsSeen(NamedTuple):
    """What is known of where fronts came to, made by `fronts_seen`.

    Attributes
    ----------
    came, stayed, halted : (n_events, n_sensors) boolean arrays
        Whether the front came by a sensor; whether it stopped above; whether it was read to stand there.
    stops : (n_events,) array, m
        Where it was recorded to have stopped at most, inf where it was not.
    begins, ends : (n_sensors,) or (n_events, n_sensors) arrays, m
        Of the sensors; of a runout anything.
    """

    came: BoolArray
    stayed: BoolArray
    halted: BoolArray
    stops: FloatArray
    begins: FloatArray
    ends: FloatArray

    def take(self, events: IntArray) -> FrontsSeen:
        """Those of some events, in this order, perhaps repeated; sensors stand where they do for all."""
        came, stayed, halted = self.came[events], self.stayed[events], self.halted[events]
        return FrontsSeen(came, stayed, halted, self.stops[events], self.begins, self.ends)

    @property
    def not_come_to(self) -> FloatArray:
        """Highest place that each front did not come to, inf where none is known, (n_events,)."""
        return np.where(self.stayed, self.ends, np.inf).min(axis=1, initial=np.inf)

    @property
    def come_to(self) -> FloatArray:
        """Place that a front came to by each sensor, -inf where it shows none, (n_events, n_sensors).

        The end of a span that it was read over. Where it is known to have stopped above that, it was read up
        to there, and came to the beginning.
        """
        highest = self.not_come_to
        seen = np.where(self.halted, self.ends, np.inf).min(axis=1, initial=np.inf)
        whole = (self.ends < highest[:, None]) & (self.ends <= np.minimum(seen, self.stops)[:, None])
        return np.where(self.came, np.where(whole, self.ends, self.begins), -np.inf)

    def between(self) -> tuple[FloatArray, FloatArray]:
        """Lowest place that each came to, or -inf, and highest that it did not, or inf, (n_events,) each."""
        return self.come_to.max(axis=1, initial=-np.inf), self.not_come_to


def fronts_seen(campaign: Campaign) -> FrontsSeen:
    """By which sensors fronts came, above which they stopped, and where they were seen to."""
    observed, (least, most) = np.asarray(campaign.status == Status.OBSERVED), campaign.bounds
    velocity = np.array([not sensor.is_runout for sensor in campaign.sensors])
    begins, ends = np.array([(one.s_from_m, one.s_to_m) for one in campaign.sensors], dtype=float).T
    speeds = np.where(observed, campaign.values, least)
    stops = np.where(observed, campaign.values, most)[:, ~velocity].min(axis=1, initial=np.inf)
    return FrontsSeen(
        came=(speeds > 0.0) & velocity,
        stayed=np.asarray(campaign.status == Status.NOT_REACHED) & velocity,
        halted=observed & (campaign.values == 0.0) & velocity,
        stops=stops,
        begins=begins,
        ends=ends,
    )


def _usual_sd(stated: FloatArray, is_velocity: BoolArray) -> FloatArray:
    """Median of what each sensor's readings state; of its quantity's where they state none, (n_sensors,)."""
    usual = np.zeros(len(is_velocity))
    for k, quantity in enumerate(is_velocity):
        for given in (stated[:, k], stated[:, is_velocity == quantity]):
            if (given > 0.0).any():
                usual[k] = np.median(given[given > 0.0])
                break
    return usual


def event_readings(campaign: Campaign, place_sd_m: float = PLACE_SD_M) -> EventReadings:
    """Readings of a campaign."""
    observed = np.asarray(campaign.status == Status.OBSERVED)
    values = np.where(observed, campaign.values, 0.0)
    sensors = campaign.sensors
    is_velocity = np.array([not sensor.is_runout for sensor in sensors])
    least, most = campaign.bounds
    known = observed | np.isfinite(least) | np.isfinite(most)
    stated = np.nan_to_num(np.where(known, campaign.stated_sd, 0.0), nan=0.0)
    relative, absolute = np.array([(one.relative_sd, one.absolute_sd) for one in sensors], dtype=float).T
    return EventReadings(
        values,
        observed,
        stated,
        relative,
        np.where((relative > 0.0) | (absolute > 0.0), absolute, _usual_sd(stated, is_velocity)),
        is_velocity,
        *fronts_seen(campaign).between(),
        float(place_sd_m),
        least,
        most,
    )
