"""One parameter vector for the path: recordings scatter about its mean response by their own covariance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from skred.arrays import FloatArray, IntArray
from skred.campaign import Campaign, Status
from skred.campaign.parts import without_silent_events
from skred.inference.pooled.density import PooledArrays, pooled_arrays, pooled_log_density
from skred.inference.pooled.recordings_covariance import recordings_covariance
from skred.inference.problem import Problem
from skred.physics.geometry import sensor_table
from skred.physics.kernel.fronts import simulate
from skred.physics.law import Law, Parameter
from skred.physics.mechanisms.spec import Mechanism
from skred.physics.terrain import build_terrain


@dataclass(frozen=True, eq=False)
class PooledProblem(Problem):
    """One parameter vector for the path: y_e ~ N(m(theta), Sigma) for each event's readings.

    Attributes
    ----------
    covariance : (n_sensors, n_sensors) array
        Sigma, the covariance of the recordings across events; fixed, the same for all laws. It
        contains the event-to-event spread, so the posterior is that of the mean response.
    recorded_mean : (n_sensors,) array
        The recordings' mean, from the same estimate.
    """

    covariance: FloatArray
    recorded_mean: FloatArray

    likelihood = "pooled"

    @cached_property
    def _unique_releases(self) -> tuple[FloatArray, IntArray]:
        """Place and speed of the different releases, (n_releases, 2), and which each event has."""
        begin = [(event.release_s_m, event.release_speed_m_s or 0.0) for event in self.campaign.events]
        releases, of_event = np.unique(np.array(begin, dtype=float), axis=0, return_inverse=True)
        return releases, of_event.ravel()

    @property
    def releases(self) -> FloatArray:
        """Places [m] of the different releases: one front each, however many events share it."""
        return self._unique_releases[0][:, 0]

    @property
    def release_speeds(self) -> FloatArray:
        """How fast fronts are at `releases` [m/s]; 0 from rest."""
        return self._unique_releases[0][:, 1]

    @property
    def release_of_event(self) -> IntArray:
        """Which of `releases` each event starts from."""
        return self._unique_releases[1]

    @cached_property
    def sensors(self) -> FloatArray:
        """The sensors as the kernel reads them."""
        return sensor_table(self.sensor_places)

    @cached_property
    def arrays(self) -> PooledArrays:
        """The recordings as the log density reads them."""
        return pooled_arrays(
            self.values,
            self.observed,
            self.not_reached,
            self.release_of_event,
            self.covariance,
            *self.campaign.bounds,
        )

    def parameters(self, law: Law) -> tuple[Parameter, ...]:
        """The law's own parameters."""
        return law.parameters

    def observe(self, mechanisms: Sequence[Mechanism], strengths: Sequence[Any]) -> Any:
        """Observed variable ``recordings``: y_e ~ N(mean response, Sigma)."""
        return self.observe_response(self.mean_response(mechanisms, strengths))

    def mean_response(self, mechanisms: Sequence[Mechanism], strengths: Sequence[Any]) -> Any:
        """Symbolic mean response of the path to one vector of strengths.

        Parameters
        ----------
        mechanisms : sequence of Mechanism
            The law.
        strengths : sequence of scalar tensors
            One for each mechanism, in its unit.

        Returns
        -------
        (n_releases, n_sensors) tensor, m/s or m
            One row for each different release of the campaign.
        """
        import pytensor.tensor as pt

        from skred.inference.pooled.forward_op import front_readings

        law = self.contributions(mechanisms)
        runs = pt.alloc(pt.stack(list(strengths)), len(self.releases), len(mechanisms))
        return front_readings(runs, self.releases, self.path, law, self.sensors, self.release_speeds)

    def observe_response(self, response: Any) -> Any:
        """Observed variable ``recordings``: y_e ~ N(response, Sigma), one log density per event.

        The readings enter as constants of the density, not as `observed`, where a missing one would
        become a free parameter; what is observed is the number of each event.
        """
        import pymc as pm

        from skred.inference.pooled.density_op import PooledLogDensity

        arrays = self.arrays
        if len(self.releases) > 1:
            # The distribution's batch is the event: give every event its own row.
            response = response[self.release_of_event]
            arrays = arrays._replace(release_of_event=np.arange(self.campaign.n_events))

        def logp(event_number: Any, response_rows: Any) -> Any:
            return PooledLogDensity()(response_rows, *arrays)

        return pm.CustomDist(
            "recordings",
            response,
            logp=logp,
            signature="(n)->()",
            observed=np.arange(self.campaign.n_events, dtype=float),
            dims="event",
        )

    def log_likelihood(self, law: Law, samples: Mapping[str, Any]) -> FloatArray:
        """Log density of each event for many parameter vectors: arrays by name to (n, n_events)."""
        return self.log_density(law.mechanisms, law.strength_rows(samples))

    def constants(self) -> dict[str, Any]:
        """Sigma and the recordings' mean."""
        return {
            "covariance": (("sensor", "sensor_bis"), self.covariance),
            "recorded_mean": ("sensor", self.recorded_mean, {"units": "m s-1; m for the runout"}),
        }

    def simulate(self, mechanisms: Sequence[Mechanism], strengths: FloatArray) -> FloatArray:
        """Mean response for many strengths: (n, n_strengths) to (n, n_events, n_sensors)."""
        return self._responses(mechanisms, strengths)[:, self.release_of_event]

    def log_density(self, mechanisms: Sequence[Mechanism], strengths: FloatArray) -> FloatArray:
        """Log density of each event for many strengths: (n, n_strengths) to (n, n_events)."""
        rows = self._responses(mechanisms, strengths)
        return np.array([pooled_log_density(row, self.arrays) for row in rows])

    def _responses(self, mechanisms: Sequence[Mechanism], strengths: FloatArray) -> FloatArray:
        """Mean response from each release place, (n, n_releases, n_sensors)."""
        n, n_releases = len(strengths), len(self.releases)
        runs = np.repeat(np.asarray(strengths, float), n_releases, axis=0)
        law = self.contributions(mechanisms)
        begin = np.tile(self.releases, n), np.tile(self.release_speeds, n)
        readings: FloatArray = simulate(runs, begin[0], self.path, law, self.sensors, begin[1])
        return readings.reshape(n, n_releases, -1)


def pooled_problem(
    campaign: Campaign, *, smoothing_m: float | None = None, cell_m: float | None = None
) -> PooledProblem:
    """Problem of a campaign, of its avalanches of which something is known, with their covariance.

    Raises
    ------
    ValueError
        If the recordings do not determine their covariance.
    """
    campaign = without_silent_events(campaign)
    terrain = build_terrain(campaign.track.x_m, campaign.track.z_m, smoothing_m=smoothing_m, cell_m=cell_m)
    not_reached = campaign.status == Status.NOT_REACHED
    values = np.where(campaign.status == Status.OBSERVED, campaign.values, np.nan)
    mean, covariance = recordings_covariance(values, not_reached, campaign.sensor_ids)
    return PooledProblem(campaign, terrain, covariance, mean)
