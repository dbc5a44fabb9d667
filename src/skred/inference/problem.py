"""What a calibration starts from: a campaign on its terrain, and a likelihood of its recordings."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import xarray as xr

from skred.arrays import BoolArray, FloatArray
from skred.campaign import Campaign, Status
from skred.physics.geometry import contributions_of, path_of
from skred.physics.kernel.fronts import front_speeds
from skred.physics.kernel.inputs import Contributions, Path
from skred.physics.law import Law, Parameter
from skred.physics.mechanisms.spec import Mechanism
from skred.physics.terrain import Terrain


@dataclass(frozen=True, eq=False)
class Problem(ABC):
    """A campaign on its terrain, and a likelihood of its recordings.

    The generic functions `predictive` and `summary` of `skred.inference.results` make predictions and
    summaries from a posterior.

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

    def joined_by(self, mechanism: Mechanism) -> JoinedProblem:
        """The problem for the model of a law that leaves a mechanism out, which is to be added."""
        return JoinedProblem(self, mechanism)

    @abstractmethod
    def log_likelihood(self, law: Law, samples: Mapping[str, Any]) -> FloatArray:
        """Log density of each event for many parameter vectors: arrays by name to (n, n_events)."""

    def numerical_problems(self, law: Law, posterior: xr.Dataset) -> tuple[str, ...]:
        """Faults of the likelihood's numerics, and what to do about them."""
        return ()

    def finer(self, law: Law, posterior: xr.Dataset) -> Problem | None:
        """The same problem with finer numerics around a posterior; None if they cannot be refined."""
        return None

    def moved_straight(self, law: Law) -> tuple[str, ...]:
        """Names of parameters that Metropolis moves themselves, by turns with their logarithms; here none."""
        return ()

    def to_start_from(self, law: Law, prior: dict[str, FloatArray], seed: int) -> dict[str, FloatArray]:
        """Parameter vectors from which chains choose their starts; here the draws of the prior."""
        return prior

    @abstractmethod
    def constants(self) -> dict[str, Any]:
        """Variables of the group constant_data that are this likelihood's own, and attributes."""

    @cached_property
    def values(self) -> FloatArray:
        """Readings, NaN where none, (n_events, n_sensors)."""
        return np.where(self.observed, self.campaign.values, np.nan)

    @cached_property
    def observed(self) -> BoolArray:
        """Where there is a reading, (n_events, n_sensors)."""
        return np.asarray(self.campaign.status == Status.OBSERVED)

    @cached_property
    def not_reached(self) -> BoolArray:
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
        self,
        mechanisms: Sequence[Mechanism],
        strengths: FloatArray,
        release_s_m: float | FloatArray,
        release_speed_m_s: float | FloatArray = 0.0,
    ) -> FloatArray:
        """Front speed [m/s] at the cell edges: (n, n_strengths) to (n, n_cells + 1)."""
        releases = np.full(len(strengths), release_s_m, dtype=float)
        law = self.contributions(mechanisms)
        strengths = np.asarray(strengths, float)
        speeds: FloatArray = front_speeds(strengths, releases, self.path, law, release_speed_m_s)
        return speeds


class JoinedProblem:
    """A problem for the model of a law that has one mechanism more than it writes down itself.

    Where the law's model observes the recordings, the mechanism's coefficient joins it, with its prior.

    Parameters
    ----------
    problem : Problem or JoinedProblem
        Everything else is asked of it.
    mechanism : Mechanism
    """

    def __init__(self, problem: Problem | JoinedProblem, mechanism: Mechanism) -> None:
        self.problem, self.mechanism = problem, mechanism

    def __getattr__(self, name: str) -> Any:
        """Whatever the problem has."""
        return getattr(self.problem, name)

    def joined_by(self, mechanism: Mechanism) -> JoinedProblem:
        """With another mechanism."""
        return JoinedProblem(self, mechanism)

    def observe(self, mechanisms: Sequence[Mechanism], strengths: Sequence[Any]) -> Any:
        """As `Problem.observe`, with one more mechanism."""
        import pymc as pm

        strength = self.mechanism.strength
        added = pm.HalfNormal(strength.name, sigma=strength.prior_scale)
        return self.problem.observe((*mechanisms, self.mechanism), [*strengths, added])
