"""The hierarchical problem: each event has its own coefficients, which are integrated out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from skred.arrays import FloatArray
from skred.campaign import Campaign
from skred.campaign.parts import without_silent_events
from skred.inference.error_model import (
    DEFAULT_ERRORS,
    ERROR_MODELS,
    PLACE_SD_M,
    ErrorModel,
    EventReadings,
    event_readings,
)
from skred.inference.hierarchical.bisection import COARSE, Envelope, Fronts, Resolution
from skred.inference.hierarchical.event_density import integrated_log_density
from skred.inference.hierarchical.population import (
    correlation_parameters,
    population_of,
    population_variables,
    spread_parameters,
)
from skred.inference.hierarchical.releases import Releases, releases_of, terrain_with_releases
from skred.inference.hierarchical.rough_population import (
    MEDIAN_LOG_MEAN,
    MEDIAN_LOG_SD,
    RoughPopulation,
    envelope_around,
    rough_population,
)
from skred.inference.hierarchical.surface import Surfaces, build_surfaces
from skred.inference.problem import Problem
from skred.physics.geometry import sensor_table
from skred.physics.kernel.fronts import simulate
from skred.physics.law import Law, Parameter
from skred.physics.mechanisms.spec import Mechanism
from skred.physics.terrain import build_terrain

_BELOW_SCALE, _ABOVE_SCALE = 6.0, 7.0
"""Range in which a coefficient is looked for, below and above the log of its prior's scale.

It is wide: a slow avalanche may allow any drag beyond some size, and spreads can exceed 1.
"""
_AT_EDGE, _FARTHER_BELOW = 2.0, 10.0
"""If a population lies this near to the lower end of the range, the range is extended downwards. Recordings
without drag do not bound it from below, and chains would leave the range that was computed."""
_WIDER_CHECK = 1.0
"""How much farther the box of log coefficients reaches for each step of fineness: a check must see what the
box may have missed."""
_COARSE_CELL = 0.25
"""Width of a patch while the population is looked for: about the widest of usual spreads."""
CHECKED_EVENTS, _CHECKED_DRAWS = 24, 40
"""Events and draws of the posterior that an integration is checked at, at most."""
_LEAST_CHECKED, _CHECKED_RUNS, _FINER_COSTS = 6, 2_000_000, 6.0
"""Least number of events checked, most runs of the kernel in a check, and its cost in usual ones."""
_SHARP_RUNOUT_M = 4.0
"""Error of a runout [m] below which patches are made narrower in proportion."""
COARSER, _FINEST = 0.7, 2.0
"""Fineness of a base law that is to be diagnosed, where claims are computed apart from it; and the finest
that is tried again with."""
INTEGRATION_LIMIT = 0.0091
"""Largest error of the log likelihood per event, in nats, in the mean over events: 0.2 for 22 events."""


class _Found(NamedTuple):
    """Approximate population, and the range of the log coefficients that is computed, (n_strengths, 2)."""

    population: RoughPopulation
    box: FloatArray


@dataclass(frozen=True, eq=False)
class HierarchicalProblem(Problem):
    """Each event has its own strengths and release; its readings scatter as an error model says.

    Attributes
    ----------
    error_model : ErrorModel
    place_sd_m : float
        How well it is known where a front stopped relative to a sensor.
    fineness : float
        1 as usual. At 2 events are resolved finer, over a wider envelope, at several times the cost. Below 1
        patches are larger: `COARSER` costs half to three quarters of the usual and has an error of about
        0.002 nats per event.
    integration_limit : float
        Largest accepted error of the log likelihood per event, in nats, in the mean over events.
    """

    error_model: ErrorModel = ERROR_MODELS[DEFAULT_ERRORS]
    place_sd_m: float = PLACE_SD_M
    fineness: float = 1.0
    integration_limit: float = INTEGRATION_LIMIT
    # Not init: a copy made by `replace` must not keep surfaces of other recordings.
    _surfaces: dict[tuple[str, ...], Surfaces] = field(init=False, default_factory=dict, repr=False)
    _rough: dict[tuple[str, ...], _Found] = field(init=False, default_factory=dict, repr=False)
    _errors: dict[tuple[str, ...], FloatArray] = field(init=False, default_factory=dict, repr=False)

    likelihood = "hierarchical"

    def parameters(self, law: Law) -> tuple[Parameter, ...]:
        """The law's own parameters, here medians over events, then spreads and correlations."""
        extra = (*spread_parameters(law.mechanisms), *correlation_parameters(law.mechanisms))
        return (*law.parameters, *extra)

    def observe(self, mechanisms: Sequence[Mechanism], strengths: Sequence[Any]) -> Any:
        """Observed variable ``recordings``: one log density per event, its strengths integrated out."""
        import pymc as pm
        import pytensor.tensor as pt

        from skred.inference.hierarchical.integrated_op import IntegratedLogDensity

        # As data, so that one compiled model serves many campaigns of as many events.
        data = self.surfaces(mechanisms).nodes._asdict()
        first, *others = (pm.Data(f"surface_{name}", value) for name, value in data.items())
        nodes = (pt.cast(first, "int64"), *others)  # PyMC makes integers int32
        n_events = self.campaign.n_events
        factor = population_variables(mechanisms)
        means = pt.alloc(pt.log(pt.stack(list(strengths))), n_events, len(mechanisms))

        def logp(event_number: Any, event_means: Any, event_factors: Any) -> Any:
            # The distribution's batch is the event; the factor is the same for all.
            return IntegratedLogDensity()(event_means, event_factors[0], *nodes)

        return pm.CustomDist(
            "recordings",
            means,
            factor,
            logp=logp,
            signature="(n),(n,m)->()",
            observed=np.arange(n_events, dtype=float),
            dims="event",
        )

    def log_likelihood(self, law: Law, samples: Mapping[str, Any]) -> FloatArray:
        """Log density of each event for many parameter vectors: arrays by name to (n, n_events)."""
        return self._log_likelihood(self.surfaces(law.mechanisms), law, samples)

    def _log_likelihood(self, surfaces: Surfaces, law: Law, samples: Mapping[str, Any]) -> FloatArray:
        means, factors = population_of(law, samples)
        n_events = len(surfaces.first) - 1
        result = np.empty((len(means), n_events))
        for k, (mean, factor) in enumerate(zip(means, factors, strict=True)):
            result[k] = integrated_log_density(np.tile(mean, (n_events, 1)), factor, *surfaces.nodes)
        return result

    def numerical_problems(self, law: Law, posterior: xr.Dataset) -> tuple[str, ...]:
        """Whether the integration over events is accurate enough, at draws of the posterior."""
        draws = {p.name: posterior[p.name].values.ravel() for p in self.parameters(law)}
        n = len(next(iter(draws.values())))
        chosen = np.linspace(0, n - 1, min(n, _CHECKED_DRAWS)).astype(int)
        errors = self.integration_errors(law, {name: values[chosen] for name, values in draws.items()})
        self._errors[_key(law.mechanisms)] = errors
        error = largest_mean_error(errors)
        if error <= self.integration_limit:
            return ()
        return (
            f"the integration over events is wrong by {error:.2g} nats per event (limit"
            f" {self.integration_limit:g}): are recordings stated with errors far below what is possible?",
        )

    def integration(self, law: Law) -> dict[str, float]:
        """Errors of the log likelihood [nats] that `numerical_problems` found last.

        Raises
        ------
        KeyError
            If it was not called for this law.
        """
        errors = self._errors[_key(law.mechanisms)]
        return {
            "largest_error_of_an_event": float(np.abs(errors).max()),
            "largest_mean_error": largest_mean_error(errors),
            "checked_events": errors.shape[1],
        }

    def constants(self) -> dict[str, Any]:
        """How well the releases are known, and the error model by its id."""
        releases = self.releases
        return {
            "error_model": ((), self.error_model.id),
            "release_sd": ("event", releases.sd, {"units": "m"}),
            "release_speed_sd": ("event", releases.speed_sd, {"units": "m s-1"}),
        }

    @cached_property
    def readings(self) -> EventReadings:
        """The recordings as they enter the likelihood."""
        return event_readings(self.campaign, self.place_sd_m)

    @cached_property
    def sensors(self) -> FloatArray:
        """The sensors as the kernel reads them, spans up to the stop, and the runout last."""
        return np.vstack([sensor_table(self.sensor_places, to_stop=True), sensor_table([None])])

    @cached_property
    def releases(self) -> Releases:
        """Where the events start and how fast, and how well that is known."""
        return releases_of(self.campaign.events, self.terrain)

    def fronts(self, mechanisms: Sequence[Mechanism]) -> Fronts:
        """Everything that the likelihood of an event's readings under a law depends on."""
        law, errors = self.contributions(mechanisms), self.error_model.errors
        return Fronts(self.path, law, self.sensors, self.readings, errors, self.releases)

    def predict(
        self,
        mechanisms: Sequence[Mechanism],
        strengths: FloatArray,
        releases: FloatArray,
        release_speeds: FloatArray | float = 0.0,
    ) -> FloatArray:
        """Readings of fronts: (n, n_strengths), (n,) and (n,) to (n, n_sensors + 1), the runout last.

        0 where a front does not come; a span's mean speed where it covered the whole of it.
        """
        table = sensor_table([*self.sensor_places, None])
        law = self.contributions(mechanisms)
        strengths, releases = np.asarray(strengths, dtype=float), np.asarray(releases, dtype=float)
        readings: FloatArray = simulate(strengths, releases, self.path, law, table, release_speeds)
        return readings

    def surfaces(self, mechanisms: Sequence[Mechanism]) -> Surfaces:
        """Likelihood surfaces of all events under a law, made once: coarse, then fine where it matters."""
        key = _key(mechanisms)
        if key not in self._surfaces:
            envelope = self._found(mechanisms).population.envelope(max(self.fineness, 1.0))
            self._surfaces[key] = self._resolve(mechanisms, self.fronts(mechanisms), self.fineness, envelope)
        return self._surfaces[key]

    def finer(self, law: Law, posterior: xr.Dataset) -> HierarchicalProblem | None:
        """The same problem at a finer resolution; None if it is the finest."""
        return replace(self, fineness=self._next_fineness) if self.fineness < _FINEST else None

    @property
    def _next_fineness(self) -> float:
        return math.floor(self.fineness) + 1.0

    def _resolve(
        self, mechanisms: Sequence[Mechanism], fronts: Fronts, fineness: float, envelope: Envelope
    ) -> Surfaces:
        """Surfaces with patches `fineness` times smaller, and a box wider, than usual (1)."""
        resolution = Resolution()
        if fineness < 1.0:
            resolution = replace(resolution, change=resolution.change / fineness)
        for _ in range(math.floor(fineness) - 1):
            resolution = resolution.finer()
        resolution = replace(resolution, narrow=resolution.narrow * self._sharpness)
        population, box = self._found(mechanisms)
        box = box + _WIDER_CHECK * max(fineness - 1.0, 0.0) * np.array([-1.0, 1.0])
        return build_surfaces(fronts, box, resolution, population.cell / fineness, envelope)

    def _found(self, mechanisms: Sequence[Mechanism]) -> _Found:
        """Approximate population of a law, and the range of coefficients to compute."""
        key = _key(mechanisms)
        if key not in self._rough:
            box = _log_scales(mechanisms)[:, None] + np.array([-_BELOW_SCALE, _ABOVE_SCALE])
            found = self._looked_for(mechanisms, box)
            at_edge = found.mean < box[:, 0] + _AT_EDGE
            if at_edge.any():
                box[at_edge, 0] -= _FARTHER_BELOW - _BELOW_SCALE
                found = self._looked_for(mechanisms, box)
            self._rough[key] = _Found(found, box)
        return self._rough[key]

    def _looked_for(self, mechanisms: Sequence[Mechanism], box: FloatArray) -> RoughPopulation:
        """Approximate population of a law within a range of coefficients."""
        n = len(mechanisms)
        mean, sd = _log_scales(mechanisms) + MEDIAN_LOG_MEAN, np.full(n, MEDIAN_LOG_SD)
        coarse = build_surfaces(self.fronts(mechanisms), box, COARSE, np.full(n, _COARSE_CELL))
        return rough_population(coarse, mean, sd)

    @cached_property
    def _sharpness(self) -> float:
        """Factor on the width of a narrow box: below 1 where runouts have small errors."""
        readings = self.readings
        sd = np.where(readings.stated_sd > 0.0, readings.stated_sd, readings.absolute_sd)
        runouts = sd[readings.observed & ~readings.is_velocity]
        return min(1.0, float(runouts.min(initial=np.inf)) / _SHARP_RUNOUT_M)

    def integration_errors(self, law: Law, samples: Mapping[str, Any], seed: int = 0) -> FloatArray:
        """Differences of event log densities to a much finer integration, (n, n_checked_events).

        Of at most 24 events drawn at random, fewer where they take long. Positive where the usual integration
        gives more. The finer one is resolved around these populations only: for all that a chain might visit
        it takes several times as long.
        """
        means, factors = population_of(law, samples)
        n_events = self.campaign.n_events
        runs_each = _FINER_COSTS * self.surfaces(law.mechanisms).n_runs / n_events
        n_checked = int(np.clip(_CHECKED_RUNS / runs_each, _LEAST_CHECKED, CHECKED_EVENTS))
        rng = np.random.default_rng([seed, 5])
        chosen = np.sort(rng.permutation(n_events)[:n_checked])
        fronts = self.fronts(law.mechanisms)
        fronts = fronts._replace(readings=fronts.readings.take(chosen), releases=fronts.releases.take(chosen))
        finer = self._resolve(law.mechanisms, fronts, self._next_fineness, envelope_around(means, factors))
        exact = self._log_likelihood(finer, law, samples)
        found = self.log_likelihood(law, samples)[:, chosen]
        # Where neither has any density, the error is not known: infinite.
        result: FloatArray = np.subtract(
            found, exact, out=np.full(exact.shape, np.inf), where=exact > -np.inf
        )
        return result


def _log_scales(mechanisms: Sequence[Mechanism]) -> FloatArray:
    """Logarithms of the scales of the strengths' priors."""
    scales: FloatArray = np.log([mechanism.strength.prior_scale for mechanism in mechanisms])
    return scales


def _key(mechanisms: Sequence[Mechanism]) -> tuple[str, ...]:
    """Key of a law's surfaces. The equation is part of it: one id can be with or without curvature."""
    return tuple(f"{mechanism.id}: {mechanism.equation}" for mechanism in mechanisms)


def largest_mean_error(errors: FloatArray) -> float:
    """Error of the log likelihood per event [nats], of the worst draw; errors are (n_draws, n_events)."""
    if not np.isfinite(errors).all():
        return math.inf
    return float(np.abs(errors.mean(axis=1)).max())


def hierarchical_problem(
    campaign: Campaign,
    *,
    error_model: str = DEFAULT_ERRORS,
    smoothing_m: float | None = None,
    cell_m: float | None = None,
) -> HierarchicalProblem:
    """Problem of a campaign, of those of its avalanches of which something is known.

    Raises
    ------
    ValueError
        If no event has a reading.
    """
    campaign = without_silent_events(campaign)
    track = build_terrain(campaign.track.x_m, campaign.track.z_m, smoothing_m=smoothing_m, cell_m=cell_m)
    terrain = terrain_with_releases(track, campaign.events)
    problem = HierarchicalProblem(campaign, terrain, ERROR_MODELS[error_model])
    if not (problem.observed | problem.readings.bounded).any():
        raise ValueError("no reading is observed: there is nothing to calibrate against")
    return problem
