"""A base law with mechanisms added to it, calibrated anew: all strengths, spreads and correlations together.

The events' own strengths are integrated out as in any hierarchical calibration. At each strength of what is
added events look different, so their likelihoods are tabulated on a grid of strengths that covers the
posterior, and interpolated between. Where avalanches differ in it, an event's likelihood is the mean over
what it may have.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from scipy.special import softmax

from skred.arrays import FloatArray
from skred.diagnosis.augment.added_strength import (
    AddedStrength,
    components_of,
    strength_variable,
    symbolic_components_of,
)
from skred.diagnosis.evidence.coefficient import Base
from skred.diagnosis.evidence.conditional_map import EventLikelihood, Population, Rows
from skred.diagnosis.evidence.event_quadrature import FINE
from skred.diagnosis.evidence.extension import Extension
from skred.diagnosis.evidence.refit import MOST_NODES
from skred.diagnosis.tabulated.tables import Tables, build_tables, exact_log_densities
from skred.diagnosis.tabulated.tabulated_op import tabulated_log_densities
from skred.inference.between_events import BetweenEvents
from skred.inference.hierarchical.population import population_of, population_samples, population_variables
from skred.inference.hierarchical.problem import CHECKED_EVENTS, COARSER, HierarchicalProblem
from skred.inference.hierarchical.rough_population import moments_of
from skred.inference.hierarchical.surface import Surfaces
from skred.inference.results import draws_by_name
from skred.parallel.threads import in_parts, side_by_side
from skred.physics.kernel.fronts import front_speeds
from skred.physics.law import Law, Parameter
from skred.physics.mechanisms.spec import Mechanism

CLAIM_LIMIT = 0.0455
"""Largest error of the log likelihood per event in a diagnosis, in nats, at the worst of some draws: one nat
for 22 events.

A claim of a mechanism rests on several nats; where fronts stop on a stretch that is added, an event's
likelihood bends sharply with the strength, and more quadrature points do not help.
"""
_TIMES_FINER = {1: 2, 2: 1}
"""How many times tables are made finer at most, by the number of added strengths: of one with half the steps,
which next to nothing left of a base strength needs twice; of two that would be four times the tables."""
_EXACT_DRAWS = 16
"""Draws compared, evenly over the posterior; fewer where an avalanche may have many strengths."""
_START_WIDER = 1.5
"""How much wider than the posterior chains start, as r-hat asks for."""


def as_diagnosed(problem: HierarchicalProblem) -> HierarchicalProblem:
    """How a base law's recordings are integrated: what a claim rests on is computed apart from that."""
    return replace(problem, integration_limit=CLAIM_LIMIT, fineness=COARSER)


@dataclass(frozen=True, eq=False, kw_only=True)
class AugmentedProblem(HierarchicalProblem):
    """A campaign, and a base law with mechanisms added; calibrate the base law with it.

    Attributes
    ----------
    base : Base
    added : tuple of AddedStrength
        One or two.
    tables : Tables
    refined : int
        How many times tables were too rough and made finer.
    """

    integration_limit: float = CLAIM_LIMIT
    base: Base
    added: tuple[AddedStrength, ...]
    tables: Tables = field(repr=False)
    refined: int = 0

    def __post_init__(self) -> None:
        """Refuse recordings that the tables are not of."""
        if self.campaign is not self.base.problem.campaign:
            raise ValueError("the tables are of another campaign: make a new base and augmented_problem")

    @property
    def extension(self) -> Extension:
        """The base law with what is added."""
        return self.base.extended(*(one.direction for one in self.added))

    @property
    def n_components(self) -> int:
        """How many added strengths an avalanche may have."""
        one = {p.name: np.ones(1) for added in self.added for p in added.parameters}
        return components_of(self.added, one)[0].shape[1]

    @property
    def range(self) -> tuple[FloatArray, FloatArray]:
        """Between which values each added strength is sampled, (n_added,) each: all that counts."""
        points = self.tables.grid.points
        either = [one.added.either_sign for one in self.added]
        return np.where(either, points.min(axis=0), np.maximum(points.min(axis=0), 0.0)), points.max(axis=0)

    def parameters(self, law: Law) -> tuple[Parameter, ...]:
        """The base law's and its population's parameters, then the added strengths."""
        return (*super().parameters(law), *(p for one in self.added for p in one.parameters))

    def observe(self, mechanisms: Sequence[Mechanism], strengths: Sequence[Any]) -> Any:
        """Added strengths, and the observed variable ``recordings``: one log density per event."""
        import pymc as pm
        import pytensor.tensor as pt

        from skred.diagnosis.tabulated.tabulated_op import TabulatedLogDensity

        self._check(mechanisms)
        tables, n_events = self.tables, self.campaign.n_events
        # As data, so that one compiled model serves many campaigns of as many events.
        held = {name: pm.Data(f"table_{name}", value) for name, value in tables.arrays.items()}
        for name in ("size", "first"):
            held[name] = pt.cast(held[name], "int64")  # PyMC makes integers int32
        scales = pm.Data("added_scale", np.array([one.scale for one in self.added]))
        low, high = pm.Data("added_low", self.range[0]), pm.Data("added_high", self.range[1])
        added = [strength_variable(one.name, scales[k], low[k], high[k]) for k, one in enumerate(self.added)]
        own, log_shares = symbolic_components_of(self.added, added)
        factor = population_variables(mechanisms)
        means = pt.alloc(pt.log(pt.stack(list(strengths))), n_events, len(mechanisms))

        def logp(number: Any, of_events: Any, factors: Any, owns: Any, shares: Any) -> Any:
            # The distribution's batch is the event; what follows its means is the same for all.
            return TabulatedLogDensity()(of_events, factors[0], owns[0], shares[0], *held.values())

        return pm.CustomDist(
            "recordings",
            means,
            factor,
            own,
            log_shares,
            logp=logp,
            signature="(n),(n,m),(c,k),(c)->()",
            observed=np.arange(n_events, dtype=float),
            dims="event",
        )

    def log_likelihood(self, law: Law, samples: Mapping[str, Any]) -> FloatArray:
        """Log density of each event for many parameter vectors: arrays by name to (n, n_events)."""
        self._check(law.mechanisms)
        return self._of_components(law, samples, partial(np.logaddexp.reduce, axis=1))

    def _of_components(
        self, law: Law, samples: Mapping[str, Any], then: Callable[[FloatArray], FloatArray]
    ) -> FloatArray:
        """What becomes of each event's log densities with its components, times their shares.

        These are (n, n_components, n_events); some draws at a time, for of many events they take gigabytes.
        """
        means, factors = population_of(law, samples)
        own, log_shares = components_of(self.added, samples)
        n_events, tables = self.campaign.n_events, self.tables.arrays.values()

        def of_some(draws: slice) -> FloatArray:
            found = tabulated_log_densities(means[draws], factors[draws], own[draws], n_events, *tables)
            return then(found + log_shares[draws, :, None])

        lots = in_parts(len(own), math.ceil(log_shares.size * n_events / MOST_NODES))
        return np.concatenate(side_by_side(of_some, lots))

    def added_rows(self, samples: Mapping[str, Any]) -> FloatArray:
        """Added strengths of many parameter vectors: arrays by name to (n, n_added)."""
        return np.column_stack([np.asarray(samples[one.name], dtype=float).ravel() for one in self.added])

    def probability_of_each(self, law: Law, samples: Mapping[str, Any]) -> FloatArray:
        """How probable each recorded avalanche has each component, (n, n_events, n_components)."""
        return np.moveaxis(self._of_components(law, samples, partial(softmax, axis=1)), 1, 2)

    def moved_straight(self, law: Law) -> tuple[str, ...]:
        """The base law's strengths: what is added takes over from them in a straight line.

        Not a parameter that its strength falls with, as xi of turbulent friction: that grows without bound.
        """
        strengths = {mechanism.strength.name for mechanism in law.mechanisms}
        return tuple(parameter.name for parameter in law.parameters if parameter.name in strengths)

    def to_start_from(self, law: Law, prior: dict[str, FloatArray], seed: int) -> dict[str, FloatArray]:
        """Parameter vectors from around the posterior, wider.

        From the prior, where spreads are of any size, a chain can get to an end of a strength's range, learn
        steps as small as it needs there, and stay.
        """
        rng, n = np.random.default_rng([seed, 6]), len(next(iter(prior.values())))
        located, (low, high) = self.tables.located, self.range
        reach = _START_WIDER * rng.standard_normal((n, len(self.added))) @ located.factor.T
        # What is beyond an end is folded back: at the end itself steps shrink.
        share = (located.mean + reach - low) / (high - low)
        added = low + (high - low) * np.abs(share - 2.0 * np.round(0.5 * share))
        near = [located.fits[table].found for table in located.grid.nearest(added)]
        psi = np.array([rng.multivariate_normal(one.psi, _START_WIDER**2 * one.covariance) for one in near])
        own = law.parameter_rows(np.exp(psi[:, : len(law.mechanisms)]))
        rest = population_samples(law, psi[:, len(law.mechanisms) :])
        # How avalanches differ in it is not known beforehand: all that may be.
        between = {one.between_name: prior[one.between_name] for one in self.added if one.between_name}
        return {**own, **rest, **{one.name: added[:, k] for k, one in enumerate(self.added)}, **between}

    def integration_errors(self, law: Law, samples: Mapping[str, Any], seed: int = 0) -> FloatArray:
        """Differences of event log densities to exact ones, (n, n_checked_events), of at most 16 draws.

        Exact: nodes at the very strengths of the draw, 1792, around its own population; half as many where
        avalanches differ by degree. Of at most 24 events, drawn at random from larger campaigns; positive
        where the tables are larger.
        """
        n = len(next(iter(samples.values())))
        # Where avalanches may differ in what is added, each draw takes as many integrals.
        each = min(_EXACT_DRAWS, math.ceil(2.0 * _EXACT_DRAWS / math.sqrt(self.n_components)))
        draws = np.linspace(0, n - 1, min(n, each)).astype(int)
        samples = {name: np.ravel(values)[draws] for name, values in samples.items()}
        rng = np.random.default_rng([seed, 5])
        chosen = np.sort(rng.permutation(self.campaign.n_events)[:CHECKED_EVENTS])
        base, (means, factors) = self.base, population_of(law, samples)
        own, log_shares = components_of(self.added, samples)
        added, every = own.reshape(-1, own.shape[2]), np.repeat(np.arange(len(own)), own.shape[1])
        rows = Rows(chosen, np.zeros_like(chosen), base.rows.readings.take(chosen), base.rows.errors)
        start = self.tables.modes[self.tables.grid.nearest(added)][:, chosen]
        likelihood = EventLikelihood(self.extension, rows, base.strengths).in_groups(base.given(added))
        # By so many nodes that their own error counts for little; a sum over many strengths is known better.
        fine = FINE if self.added[0].between is BetweenEvents.SPREAD else FINE.times(2)
        exact = exact_log_densities(likelihood, means[every], factors[every], start, fine, base.population)
        parts = exact.reshape(*log_shares.shape, -1) + log_shares[:, :, None]
        together: FloatArray = np.logaddexp.reduce(parts, axis=1)
        return self.log_likelihood(law, samples)[:, chosen] - together

    def speeds(
        self,
        mechanisms: Sequence[Mechanism],
        strengths: FloatArray,
        release_s_m: float | FloatArray,
        release_speed_m_s: float | FloatArray = 0.0,
    ) -> FloatArray:
        """Front speed [m/s] at the cell edges, what is added as strong as its posterior mean."""
        extension = self.extension
        added = np.concatenate([self.base.strengths, self.tables.located.mean])
        columns = np.repeat(added, [len(d.columns) for d in extension.directions])
        rows = np.column_stack([np.asarray(strengths, float), np.tile(columns, (len(strengths), 1))])
        releases = np.full(len(rows), release_s_m, dtype=float)  # where fronts start, an offset included
        law = extension.contributions
        speeds: FloatArray = front_speeds(rows, releases, self.path, law, release_speed_m_s)
        return speeds

    def finer(self, law: Law, posterior: xr.Dataset) -> AugmentedProblem | None:
        """The same with finer tables; None where they were made so as often as may be.

        At first with more nodes, too. They also cover the populations that chains went to: far from all that
        the tables cover a few nodes stand for all, and may show a mode that is none.
        """
        if self.refined == _TIMES_FINER[len(self.added)]:
            return None
        n_chains = posterior.sizes["chain"]
        chains = [draws_by_name(self, law, posterior.isel(chain=[k])) for k in range(n_chains)]
        moments = [moments_of(*population_of(law, chain)) for chain in chains]
        visited = Population(*(np.array(values) for values in zip(*moments, strict=True)))
        old = self.tables
        budget = old.budget
        if not self.refined:
            wide = budget.over_population * 2 ** math.ceil(math.log2(2 + n_chains))
            budget = budget.times(2)._replace(over_population=wide)
        located = old.located
        if len(self.added) == 1:
            located = located.finer
            # Where avalanches differ one population is around all tables.
            if self.added[0].between is BetweenEvents.COMMON:
                located = located.refitted(self.base, self.extension)
        tables = build_tables(self.base, self.extension, located, budget, visited)
        return replace(self, tables=tables, refined=self.refined + 1)

    def surfaces(self, mechanisms: Sequence[Mechanism]) -> Surfaces:
        """Not there: surfaces would be those of the base law alone.

        Raises
        ------
        TypeError
            Always.
        """
        raise TypeError("a law with mechanisms added has tables, not surfaces")

    def _check(self, mechanisms: Sequence[Mechanism]) -> None:
        ids = [mechanism.id for mechanism in self.base.law.mechanisms]
        if [mechanism.id for mechanism in mechanisms] != ids:
            raise ValueError(f"mechanisms were added to {self.base.law.id}: calibrate that law")
