"""Metropolis within Gibbs on the joint posterior: events' strengths are explicit, nothing is integrated.

It shares the kernel and the event's log likelihood with skred, but no surfaces, no quadrature and no
PyMC: priors and population are written down again. Many chains run side by side. One sweep: every
event alone (walks of all sizes, and a new draw from the population), then the population given the
events, then both together (all events moved along with a median or stretched with a spread), which is
what mixes where events say little.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.inference.reading_density import log_likelihoods
from skred.physics.kernel.fronts import simulate
from skred.physics.law import Law

FloatArray = NDArray[np.float64]
_EVENT_MOVES, _POPULATION_MOVES = 4, 6


class JointGibbs:
    """Chains of the joint posterior of a law of one or two strengths, its parameters half-normal.

    Parameters
    ----------
    problem : HierarchicalProblem
        Releases are taken as known.
    law : Law
    n_chains : int
    seed : int
    """

    def __init__(self, problem: HierarchicalProblem, law: Law, n_chains: int, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.fronts = problem.fronts(law.mechanisms)
        self.scales = np.array([mechanism.strength.prior_scale for mechanism in law.mechanisms])
        self.n = len(self.scales)
        n_events = problem.campaign.n_events
        self.event = np.tile(np.arange(n_events), n_chains)
        self.release = self.fronts.releases.mean[self.event]
        self.release_speed = self.fronts.releases.speed[self.event]
        # Population: means of logs, logs of spreads, and the correlation if there are two strengths.
        n_pairs = self.n * (self.n - 1) // 2
        self.population = np.column_stack(
            [
                np.log(self.scales) - 0.6 + 0.3 * self.rng.standard_normal((n_chains, self.n)),
                math.log(0.3) + 0.3 * self.rng.standard_normal((n_chains, self.n)),
                self.rng.uniform(-0.3, 0.3, (n_chains, n_pairs)),
            ]
        )
        self.x = self.draw_events((n_chains, n_events))
        self.log_l = self.log_likelihood(self.x)

    def log_likelihood(self, x: FloatArray) -> FloatArray:
        """Of each event of each chain: (n_chains, n_events, n) to (n_chains, n_events)."""
        strengths = np.exp(np.clip(x.reshape(-1, self.n), -30.0, 10.0))
        fronts = self.fronts
        runs = simulate(strengths, self.release, fronts.path, fronts.law, fronts.sensors, self.release_speed)
        result: FloatArray = log_likelihoods(self.event, runs, fronts.readings, fronts.errors)
        return result.reshape(x.shape[:2])

    def parts(self, population: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Means, spreads and correlation (0 for one strength), each (n_chains, 1, ...)."""
        n = self.n
        r = population[:, 2 * n] if n == 2 else np.zeros(len(population))
        return population[:, None, :n], np.exp(population[:, None, n : 2 * n]), r[:, None]

    def draw_events(self, shape: tuple[int, int]) -> FloatArray:
        """Log strengths from the populations, (n_chains, n_events, n)."""
        mean, spread, r = self.parts(self.population)
        z = self.rng.standard_normal((*shape, self.n))
        if self.n == 2:
            z[..., 1] = r * z[..., 0] + np.sqrt(1.0 - r**2) * z[..., 1]
        return np.asarray(mean + spread * z)

    def log_population(self, population: FloatArray, x: FloatArray) -> FloatArray:
        """Log density of log strengths, (n_chains, n_events)."""
        mean, spread, r = self.parts(population)
        z = (x - mean) / spread
        if self.n == 1:
            square, log_r = z[..., 0] ** 2, np.zeros(())
        else:
            a, b = z[..., 0], z[..., 1]
            square = (a**2 - 2.0 * r * a * b + b**2) / (1.0 - r**2)
            log_r = 0.5 * np.log(1.0 - r**2)
        return np.asarray(-0.5 * square - np.log(spread).sum(axis=2) - log_r)

    def log_prior(self, population: FloatArray) -> FloatArray:
        """Half-normal medians, log-normal spreads, LKJ(2) correlation; on the scale of the logs."""
        n = self.n
        means, log_spreads = population[:, :n], population[:, n : 2 * n]
        result = (means - 0.5 * (np.exp(means) / self.scales) ** 2).sum(axis=1)
        result -= 0.5 * (((log_spreads - math.log(0.13)) / 0.6) ** 2).sum(axis=1)
        if n == 2:
            r = population[:, 4]
            result += np.where(np.abs(r) < 1.0, np.log(np.maximum(1.0 - r**2, 1e-300)), -np.inf)
        return np.asarray(result)

    def move_events(self) -> None:
        """Every event alone: walks of all sizes, and draws from the population."""
        for move in range(_EVENT_MOVES):
            if move == 0:  # from the prior of an event: its density cancels
                proposal, log_ratio = self.draw_events(self.x.shape[:2]), np.zeros(())
            else:
                size = 10.0 ** self.rng.uniform(-2.5, 0.3, (*self.x.shape[:2], 1))
                spread = self.parts(self.population)[1]
                proposal = self.x + size * spread * self.rng.standard_normal(self.x.shape)
                log_ratio = self.log_population(self.population, proposal)
                log_ratio = log_ratio - self.log_population(self.population, self.x)
            proposed = self.log_likelihood(proposal)
            accepted = np.log(self.rng.random(self.log_l.shape)) < proposed - self.log_l + log_ratio
            self.x[accepted], self.log_l[accepted] = proposal[accepted], proposed[accepted]

    def move_population(self) -> None:
        """The population given the events."""
        current = self.log_prior(self.population) + self.log_population(self.population, self.x).sum(axis=1)
        for _ in range(_POPULATION_MOVES):
            n, step = self.n, self.rng.standard_normal(self.population.shape)
            step[:, :n] *= np.exp(self.population[:, n : 2 * n])
            step *= 10.0 ** self.rng.uniform(-1.5, 0.0, (len(step), 1))
            # Walks along the means are as long as the present spreads, so these stay where those move.
            if self.rng.random() < 0.5:
                step[:, n:] = 0.0
            else:
                step[:, :n] = 0.0
            proposal = self.population + step
            valid = np.abs(proposal[:, 2 * n :]).max(axis=1, initial=0.0) < 1.0
            proposal = np.where(valid[:, None], proposal, self.population)
            proposed = self.log_prior(proposal) + self.log_population(proposal, self.x).sum(axis=1)
            accepted = (np.log(self.rng.random(len(step))) < proposed - current) & valid
            self.population[accepted], current[accepted] = proposal[accepted], proposed[accepted]

    def move_together(self) -> None:
        """Medians with all events, then spreads with all events: events keep their standardised place."""
        n = self.n
        for which in range(2):
            proposal = self.population.copy()
            size = 10.0 ** self.rng.uniform(-2.5, 0.0, (len(proposal), 1))
            step = size * self.rng.standard_normal((len(proposal), n))
            if which == 0:
                proposal[:, :n] += 0.3 * step
            else:
                proposal[:, n : 2 * n] += step
            mean, spread, _ = self.parts(self.population)
            new_mean, new_spread, _ = self.parts(proposal)
            x = new_mean + (self.x - mean) / spread * new_spread
            log_l = self.log_likelihood(x)
            log_ratio = self.log_prior(proposal) - self.log_prior(self.population)
            log_ratio += (log_l - self.log_l).sum(axis=1)
            accepted = np.log(self.rng.random(len(x))) < log_ratio
            self.population[accepted], self.x[accepted] = proposal[accepted], x[accepted]
            self.log_l[accepted] = log_l[accepted]

    def run(self, n_sweeps: int, n_dropped: int) -> FloatArray:
        """Populations after each sweep but the dropped ones, (n_chains, n_sweeps, n_parameters)."""
        draws = np.empty((len(self.population), n_sweeps, self.population.shape[1]))
        for sweep in range(-n_dropped, n_sweeps):
            self.move_events()
            self.move_population()
            self.move_together()
            if sweep >= 0:
                draws[:, sweep] = self.population
        return draws


def parameter_rows(law: Law, samples: Any) -> FloatArray:
    """Draws by name in the order and on the scale of `JointGibbs`, (n_chains, n_draws, n_parameters)."""
    names = [mechanism.strength.name for mechanism in law.mechanisms]
    columns = [np.log(np.asarray(samples[name])) for name in names]
    columns += [np.log(np.asarray(samples[f"{name}_spread"])) for name in names]
    if len(names) == 2:
        columns.append(np.asarray(samples[f"{names[0]}_{names[1]}_correlation"]))
    return np.stack(columns, axis=-1)
