"""What a calibration starts from: a campaign on its terrain, and how its recordings are compared."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from skred.campaign import Campaign, Status
from skred.inference.pooled.density import PooledArrays, pooled_arrays, pooled_log_density
from skred.inference.pooled.recordings_covariance import recordings_covariance
from skred.physics.geometry import contributions_of, path_of, sensor_table
from skred.physics.kernel.fronts import front_speeds, simulate
from skred.physics.kernel.inputs import Contributions, Path
from skred.physics.law import Law, Parameter
from skred.physics.mechanisms.spec import Mechanism
from skred.physics.terrain import CELL_M, SMOOTHING_M, Terrain, build_terrain

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Problem(ABC):
    """A campaign on its terrain, and a likelihood of its recordings.

    Attributes
    ----------
    campaign : Campaign
    terrain : Terrain
    """

    campaign: Campaign
    terrain: Terrain

    likelihood: ClassVar[str]

    @abstractmethod
    def parameters(self, law: Law) -> tuple[Parameter, ...]:
        """Free random variables of a law's model: the law's own and what the likelihood adds."""

    @abstractmethod
    def observe(self, mechanisms: Sequence[Mechanism], strengths: Sequence[Any]) -> Any:
        """Add the observed variable ``recordings`` to the current PyMC model; returns it.

        Parameters
        ----------
        mechanisms : sequence of Mechanism
            The law.
        strengths : sequence of scalar tensors
            One for each mechanism, in its unit.
        """

    @abstractmethod
    def log_likelihood(self, law: Law, samples: Mapping[str, Any]) -> FloatArray:
        """Log density of each event for many parameter vectors: arrays by name to (n, n_events)."""

    @abstractmethod
    def predictive(
        self, law: Law, posterior: xr.Dataset, prior: xr.Dataset, seed: int
    ) -> dict[str, xr.Dataset]:
        """Groups of a result that are this likelihood's own, from draws of the parameters."""

    @abstractmethod
    def summary(self, law: Law, tree: xr.DataTree) -> dict[str, Any]:
        """What a summary says beside the parameters: plain data, from the whole result."""

    def numerical_problems(self, law: Law, posterior: xr.Dataset) -> tuple[str, ...]:
        """What is wrong with the numerics of the likelihood, and what to do."""
        return ()

    def finer(self, law: Law, posterior: xr.Dataset) -> Problem | None:
        """The same problem with finer numerics where a posterior went; None where there are none."""
        return None

    def to_start_from(self, law: Law, prior: dict[str, FloatArray], seed: int) -> dict[str, FloatArray]:
        """Parameter vectors, among which chains find their starts: draws of the prior, as they are."""
        return prior

    @abstractmethod
    def constants(self) -> dict[str, Any]:
        """Variables of the group constant_data that are this likelihood's own, and attributes."""

    @cached_property
    def values(self) -> FloatArray:
        """Readings, NaN where none, (n_events, n_sensors)."""
        return np.where(self.observed, self.campaign.values, np.nan)

    @cached_property
    def observed(self) -> NDArray[np.bool_]:
        """Where there is a reading, (n_events, n_sensors)."""
        return np.asarray(self.campaign.status == Status.OBSERVED)

    @cached_property
    def not_reached(self) -> NDArray[np.bool_]:
        """Where the front stopped above the sensor, (n_events, n_sensors)."""
        return np.asarray(self.campaign.status == Status.NOT_REACHED)

    @cached_property
    def path(self) -> Path:
        """The track as the kernel reads it."""
        return path_of(self.terrain)

    @cached_property
    def sensor_places(self) -> list[tuple[float, float] | None]:
        """From and to [m] of each sensor, None for a runout."""
        return [
            None if sensor.is_runout else (sensor.s_from_m, sensor.s_to_m) for sensor in self.campaign.sensors
        ]

    @property
    def coords(self) -> dict[str, Any]:
        """Coordinates of the models' named dims."""
        return {"event": list(self.campaign.event_ids), "sensor": list(self.campaign.sensor_ids)}

    def contributions(self, mechanisms: Sequence[Mechanism]) -> Contributions:
        """How the strengths of a law's mechanisms enter the equation of motion on this terrain."""
        return contributions_of(mechanisms, self.terrain)

    def speeds(
        self, mechanisms: Sequence[Mechanism], strengths: FloatArray, release_s_m: float | FloatArray
    ) -> FloatArray:
        """Front speed [m/s] at the cell edges: (n, n_strengths) to (n, n_cells + 1)."""
        releases = np.full(len(strengths), release_s_m, dtype=float)
        law = self.contributions(mechanisms)
        speeds: FloatArray = front_speeds(np.asarray(strengths, float), releases, self.path, law)
        return speeds


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
    def _unique_releases(self) -> tuple[FloatArray, NDArray[np.int64]]:
        places = np.array([event.release_s_m for event in self.campaign.events])
        releases, of_event = np.unique(places, return_inverse=True)
        return releases, of_event

    @property
    def releases(self) -> FloatArray:
        """The different release places [m]: one front each, however many events share it."""
        return self._unique_releases[0]

    @property
    def release_of_event(self) -> NDArray[np.int64]:
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
            self.values, self.observed, self.not_reached, self.release_of_event, self.covariance
        )

    def parameters(self, law: Law) -> tuple[Parameter, ...]:
        """The law's own parameters."""
        return law.parameters

    def observe(self, mechanisms: Sequence[Mechanism], strengths: Sequence[Any]) -> Any:
        """Observed variable ``recordings``: y_e ~ N(mean response, Sigma)."""
        from skred.inference.pooled.model import mean_response, observe

        return observe(self, mean_response(self, mechanisms, strengths))

    def log_likelihood(self, law: Law, samples: Mapping[str, Any]) -> FloatArray:
        """Log density of each event for many parameter vectors: arrays by name to (n, n_events)."""
        return self.log_density(law.mechanisms, law.strength_rows(samples))

    def predictive(
        self, law: Law, posterior: xr.Dataset, prior: xr.Dataset, seed: int
    ) -> dict[str, xr.Dataset]:
        """Mean response, and a latent reading of a new avalanche from each event's release."""
        from skred.inference.pooled.results import predictive_groups

        return predictive_groups(self, law, posterior, prior, seed)

    def summary(self, law: Law, tree: xr.DataTree) -> dict[str, Any]:
        """Mean response at each sensor."""
        from skred.inference.pooled.results import response_rows

        return {"response": response_rows(self, tree)}

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
        readings: FloatArray = simulate(runs, np.tile(self.releases, n), self.path, law, self.sensors)
        return readings.reshape(n, n_releases, -1)


def pooled_problem(
    campaign: Campaign, *, smoothing_m: float = SMOOTHING_M, cell_m: float = CELL_M
) -> PooledProblem:
    """Problem of a campaign, with the covariance of its recordings.

    Raises
    ------
    ValueError
        If the recordings do not determine their covariance.
    """
    terrain = build_terrain(campaign.track.x_m, campaign.track.z_m, smoothing_m=smoothing_m, cell_m=cell_m)
    not_reached = campaign.status == Status.NOT_REACHED
    values = np.where(campaign.status == Status.OBSERVED, campaign.values, np.nan)
    mean, covariance = recordings_covariance(values, not_reached)
    return PooledProblem(campaign, terrain, covariance, mean)
