"""The unlisted force's evidence by sampling, against integrals that are known and against Laplace's."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pytest
from diagnosis_cases import few_dense_base, recorded
from scipy.stats import multivariate_normal

from skred.diagnosis.compare.recomputed import recomputed
from skred.diagnosis.discrepancy.fit import fit_profile, mode_at
from skred.diagnosis.discrepancy.profile import (
    KINDS,
    Profile,
    combined,
    knots,
    log_prior_densities,
    priors_of,
)
from skred.diagnosis.discrepancy.sampled_evidence import gains, sampled
from skred.diagnosis.evidence.adaptive_sampling import Mixture, Mode, weighted_draws
from skred.diagnosis.evidence.coefficient import Base
from skred.diagnosis.evidence.tolerance import COUNTS

FloatArray = np.ndarray[Any, np.dtype[np.float64]]
N = 12


def log_integral(
    log_density: Callable[[FloatArray], FloatArray],
    modes: list[Mode],
    mode_near: Callable[[FloatArray], Mode],
    rng: np.random.Generator,
    least: float = -math.inf,
    enough: float = 0.2,
) -> float:
    """As of a force: by few draws a turn."""
    found = weighted_draws(log_density, Mixture.on(modes), rng, 64, enough, least, mode_near)
    return found.log_integral


@pytest.fixture(scope="module")
def base() -> Base:
    return few_dense_base()


@pytest.fixture(scope="module")
def pool() -> Iterator[ThreadPoolExecutor]:
    with ThreadPoolExecutor(1) as one:
        yield one


class TwoPeaks:
    """Two normal densities of equal weight, the second so many standard deviations from the first.

    Of the modes that are given one is too narrow and off its top.
    """

    def __init__(self, apart: float) -> None:
        rng = np.random.default_rng(3)
        factor = rng.standard_normal((N, N)) / np.sqrt(N) + 0.5 * np.eye(N)
        self.covariance, self.tops = factor @ factor.T, np.array([np.zeros(N), apart * factor[:, 1]])
        self.modes = [
            Mode(self.tops[0] + 0.5 * factor[:, 0], 0.8 * self.covariance),
            Mode(self.tops[1], self.covariance),
        ]
        self.log_integral = 20.0 + math.log(2.0)
        self.turns = 0

    def log_density(self, values: FloatArray) -> FloatArray:
        self.turns += 1
        parts = [20.0 + multivariate_normal(top, self.covariance).logpdf(values) for top in self.tops]
        return np.asarray(np.logaddexp.reduce(parts, axis=0))

    def mode_near(self, values: FloatArray) -> Mode:
        away = [(values - top) @ np.linalg.solve(self.covariance, values - top) for top in self.tops]
        return Mode(self.tops[int(np.argmin(away))], self.covariance)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_known_integral(seed: int) -> None:
    peaks = TwoPeaks(apart=9.0)

    def found(modes: list[Mode]) -> float:
        return log_integral(peaks.log_density, modes, peaks.mode_near, np.random.default_rng(seed))

    assert found(peaks.modes) == pytest.approx(peaks.log_integral, abs=0.25)
    # Without the second mode the log of two is missed, as it should be.
    assert found(peaks.modes[:1]) == pytest.approx(20.0, abs=0.25)


def test_a_peak_that_a_draw_is_on_is_added() -> None:
    """Four standard deviations away about half of the seeds have such a draw."""
    peaks = TwoPeaks(apart=4.0)
    known = peaks.modes[:1]

    def n_right(mode_near: Callable[[FloatArray], Mode]) -> int:
        rngs = [np.random.default_rng(seed) for seed in range(16)]
        found = [log_integral(peaks.log_density, known, mode_near, rng) for rng in rngs]
        return int(np.sum(np.abs(np.array(found) - peaks.log_integral) < 0.15))

    assert n_right(peaks.mode_near) >= 5
    # Where a climb from the draw leads back to what is known, the second peak is missed.
    assert n_right(lambda values: known[0]) == 0


def test_what_is_far_behind_is_not_sampled_on() -> None:
    def turns(least: float) -> int:
        peaks, rng = TwoPeaks(apart=9.0), np.random.default_rng(0)
        log_integral(peaks.log_density, peaks.modes, peaks.mode_near, rng, least, enough=0.0)
        return peaks.turns

    assert turns(-math.inf) == 6
    assert turns(30.0) == 2


def test_nothing_where_no_draw_has_any_density() -> None:
    peaks = TwoPeaks(apart=9.0)
    rng = np.random.default_rng(0)
    none = log_integral(lambda values: np.full(len(values), -np.inf), peaks.modes, peaks.mode_near, rng)
    assert none == -math.inf


def test_readings_that_tell_nothing_leave_the_laplace_approximation(
    base: Base, pool: ThreadPoolExecutor
) -> None:
    readings = base.rows.readings
    silent = replace(
        base, rows=base.rows._replace(readings=readings._replace(values=np.nan * readings.values))
    )
    profile = replace(fit_profile(base, KINDS[0]), log_bayes_factor=3.0)
    assert sampled(silent, profile, pool) is profile
    assert sampled(base, profile, pool).log_bayes_factor < 0.0


class Quadratic(NamedTuple):
    """A log likelihood that is quadratic in a profile's values, 0 at none."""

    score: FloatArray
    information: FloatArray

    def gain(self, values: FloatArray) -> FloatArray:
        curved = np.einsum("ni,ij,nj->n", values, self.information, values)
        return np.asarray(values @ self.score - 0.5 * curved)

    def mode(self, cover: FloatArray, share: float) -> tuple[Mode, float]:
        """Under a prior, in closed form, and its log integral."""
        left = np.linalg.inv(self.information + np.linalg.inv(cover))
        occam = 0.5 * np.linalg.slogdet(np.eye(len(cover)) + cover @ self.information)[1]
        gained = 0.5 * self.score @ left @ self.score
        return Mode(left @ self.score, 0.5 * (left + left.T)), share + gained - occam


def test_all_priors_count_by_their_shares(base: Base) -> None:
    """Against the closed form; modes as a fit has them."""
    at, kind = knots(base.setting), KINDS[0]
    unit = np.exp(-0.5 * ((at - at.mean()) / 100.0) ** 2)
    information = 40.0 * np.outer(unit, unit) / kind.amplitude**2 + np.diag(0.5 / kind.amplitude**2 * unit)
    likelihood = Quadratic(information @ (1.2 * kind.amplitude * unit), information)
    modes = [likelihood.mode(prior.cover(at), share) for prior, share in priors_of(kind, at).items()]
    heights = [height for _, height in modes]
    exact = float(np.logaddexp.reduce(heights))
    near = [mode for mode, height in modes if height > max(heights) - COUNTS]
    assert 1 < len(near) < len(modes)
    best = modes[int(np.argmax(heights))][0]

    def log_density(values: FloatArray) -> FloatArray:
        densities = log_prior_densities(kind, at, values)
        return likelihood.gain(values) + np.logaddexp.reduce(list(densities.values()), axis=0)

    found = [
        log_integral(log_density, near, lambda values: best, np.random.default_rng(seed)) for seed in range(8)
    ]
    assert np.mean(found) == pytest.approx(exact, abs=0.35)


@pytest.mark.parametrize("kind", [0, 1])
def test_laplace_where_gates_are_dense(base: Base, pool: ThreadPoolExecutor, kind: int) -> None:
    """Readings are nearly linear in a weak force there: under one prior both routes agree."""
    at = np.array([700.0, 750.0, 850.0, 900.0])
    force = combined(base.setting, KINDS[kind], at, (0.2, 3e-4)[kind] * np.array([0.0, 1.0, 1.0, 0.0]))
    changed = recorded(base, force)
    found = fit_profile(changed, KINDS[kind])
    cover = found.prior.cover(found.knots_m)
    prior_penalty = 0.5 * found.mean @ np.linalg.solve(cover, found.mean)
    occam_penalty = 0.5 * (np.linalg.slogdet(cover)[1] - np.linalg.slogdet(found.covariance)[1])
    laplace = max(found.gain - prior_penalty, 0.0) - occam_penalty
    prior = multivariate_normal(cov=cover)

    def log_density(values: FloatArray) -> FloatArray:
        return gains(changed, found, values, pool) + prior.logpdf(values)

    modes = [Mode(found.mean, found.covariance)]
    sampled = [
        log_integral(log_density, modes, lambda values: mode_at(changed, found, values), rng)
        for rng in map(np.random.default_rng, range(2))
    ]
    assert sampled == pytest.approx([laplace] * 2, abs=0.4)
    # From a draw beside the top the mode is found again.
    rng = np.random.default_rng(7)
    mode = mode_at(changed, found, rng.multivariate_normal(found.mean, found.covariance, method="cholesky"))
    off = mode.mean - found.mean
    assert off @ np.linalg.solve(found.covariance, off) < 1.0


@pytest.mark.parametrize("seed", [0, 1])
def test_a_clear_force_has_the_evidence_of_the_laplace_approximation(
    base: Base, pool: ThreadPoolExecutor, seed: int
) -> None:
    """Over all of its priors."""
    at = np.array([700.0, 750.0, 850.0, 900.0])
    changed = recorded(base, combined(base.setting, KINDS[0], at, 1.6 * np.array([0.0, 1.0, 1.0, 0.0])))
    profile = fit_profile(changed, KINDS[0])
    assert profile.log_bayes_factor > 5.0
    found = sampled(changed, profile, pool, seed=seed)
    assert found.error is not None and 0.0 < found.error < 0.2
    assert found.log_bayes_factor == pytest.approx(profile.log_bayes_factor, abs=1.0)


@pytest.mark.parametrize(
    ("laplace", "best", "again"),
    [
        ((19.0, 14.5, 13.5), 20.0, (True, True, False)),  # `COUNTS` behind the best of all
        ((1.0, -1.0, 0.0), -np.inf, (True, False, False)),  # more probable than none
    ],
)
def test_which_forces_are_sampled(
    base: Base,
    pool: ThreadPoolExecutor,
    laplace: tuple[float, ...],
    best: float,
    again: tuple[bool, ...],
) -> None:
    """Those that some nats more would bring near the best of all, if they are more probable than none.

    The pool has one thread, which must be free for what is waited for.
    """
    profile: Profile = fit_profile(base, KINDS[0])
    profiles = [replace(profile, log_bayes_factor=one) for one in laplace]
    _, found = recomputed(base, {}, profiles, pool, best)
    changed = tuple(one.log_bayes_factor != before for one, before in zip(found, laplace, strict=True))
    assert changed == again
    assert tuple(one.error is not None for one in found) == again
