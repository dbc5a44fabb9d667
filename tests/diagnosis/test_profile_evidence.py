"""The unlisted force's evidence by sampling: against integrals that are known, and Laplace's formula."""

from __future__ import annotations

import math
from collections.abc import Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest
from diagnosis_cases import few_dense_base, recorded
from scipy.stats import multivariate_normal

from skred.diagnosis.compare import recomputed as corrections
from skred.diagnosis.discrepancy import sampled_evidence as profile_evidence
from skred.diagnosis.discrepancy.fit import fit_profile, mode_at
from skred.diagnosis.discrepancy.profile import KINDS, Mode, Prior, Profile, combined, knots, priors_of
from skred.diagnosis.discrepancy.sampled_evidence import sampled_log_factor
from skred.diagnosis.evidence.coefficient import Base

FloatArray = np.ndarray[Any, np.dtype[np.float64]]
N = 12


@pytest.fixture(scope="module")
def base() -> Base:
    return few_dense_base()


@pytest.fixture(scope="module")
def pool() -> Iterator[ThreadPoolExecutor]:
    with ThreadPoolExecutor(1) as one:
        yield one


class Target(NamedTuple):
    """What is integrated over instead of a campaign's evidence: two modes of equal height.

    Attributes
    ----------
    profile : Profile
        Of which the fit knows one mode too narrow and off its top, and the other one too low.
    exact : float
        Log of the integral.
    calls : list of int
        Draws asked for, turn by turn.
    """

    profile: Profile
    exact: float
    calls: list[int]


def on_two_hills(base: Base, monkeypatch: pytest.MonkeyPatch, apart: float = 9.0) -> Target:
    """Hills so many standard deviations apart."""
    rng = np.random.default_rng(3)
    factor = rng.standard_normal((N, N)) / np.sqrt(N) + 0.5 * np.eye(N)
    cover, tops = factor @ factor.T, np.array([np.zeros(N), apart * factor[:, 1]])
    logs, calls = np.array([20.0, 20.0]), list[int]()

    def heights(base: Base, profile: Profile, values: FloatArray, pool: Executor) -> FloatArray:
        calls.append(len(values))
        parts = [
            log + multivariate_normal(top, cover).logpdf(values) for log, top in zip(logs, tops, strict=True)
        ]
        return np.asarray(np.logaddexp.reduce(parts, axis=0))

    def nearest(base: Base, profile: Profile, values: FloatArray) -> Mode:
        away = [(values - top) @ np.linalg.solve(cover, values - top) for top in tops]
        return Mode(tops[int(np.argmin(away))], cover, 0.0)

    monkeypatch.setattr(profile_evidence, "_heights", heights)
    monkeypatch.setattr(profile_evidence, "mode_at", nearest)
    modes = (Mode(tops[0] + 0.5 * factor[:, 0], 0.8 * cover, 20.0), Mode(tops[1], cover, 16.0))
    at = np.linspace(300.0, 900.0, N)
    profile = Profile(KINDS[0], Prior(1.0, 80.0), at, tops[0], cover, 0.0, 0.0, base.fit, modes)
    return Target(profile, float(np.logaddexp.reduce(logs)), calls)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_known_integral(base: Base, pool: Executor, monkeypatch: pytest.MonkeyPatch, seed: int) -> None:
    profile, exact, _ = on_two_hills(base, monkeypatch)
    assert sampled_log_factor(base, profile, pool, seed=seed) == pytest.approx(exact, abs=0.25)
    # Without the second mode the log of two is missed, as it should be.
    alone = replace(profile, modes=profile.modes[:1])
    assert sampled_log_factor(base, alone, pool, seed=seed) == pytest.approx(20.0, abs=0.25)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_hill_that_a_draw_is_on_is_added(
    base: Base, pool: Executor, monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    """These seeds have such a draw: four standard deviations away not all have."""
    profile, exact, _ = on_two_hills(base, monkeypatch, apart=4.0)
    alone = replace(profile, modes=profile.modes[:1])
    assert sampled_log_factor(base, alone, pool, seed=seed) == pytest.approx(exact, abs=0.15)
    monkeypatch.setattr(profile_evidence, "_ODD", 2.0)
    assert sampled_log_factor(base, alone, pool, seed=seed) < exact - 0.4


def test_what_is_far_behind_is_not_sampled_on(
    base: Base, pool: Executor, monkeypatch: pytest.MonkeyPatch
) -> None:
    profile, _, calls = on_two_hills(base, monkeypatch)
    sampled_log_factor(base, profile, pool, enough=math.inf)
    assert len(calls) == 6
    calls.clear()
    sampled_log_factor(base, profile, pool, least=30.0, enough=math.inf)
    assert len(calls) == 2


def test_draws_that_tell_nothing_leave_laplace(
    base: Base, pool: Executor, monkeypatch: pytest.MonkeyPatch
) -> None:
    profile = on_two_hills(base, monkeypatch).profile
    silent = [SimpleNamespace(found=SimpleNamespace(log_evidence=math.nan))]
    monkeypatch.undo()
    monkeypatch.setattr(
        profile_evidence, "refit", lambda extension, rows, given, *_, **__: silent * len(given)
    )
    assert sampled_log_factor(base, replace(profile, log_bayes_factor=3.0), pool) == 3.0


@pytest.mark.parametrize("seed", [0, 1])
def test_all_priors_count_by_their_shares(
    base: Base, pool: Executor, monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    """Against the closed form where the log evidence is quadratic in the values; modes as a fit has them."""
    at, kind = knots(base.setting), KINDS[0]
    unit = np.exp(-0.5 * ((at - at.mean()) / 100.0) ** 2)
    information = 40.0 * np.outer(unit, unit) / kind.amplitude**2 + np.diag(0.5 / kind.amplitude**2 * unit)
    score = information @ (1.2 * kind.amplitude * unit)
    nothing = base.fit.found.log_evidence

    def refitted(extension: Any, rows: Any, given: FloatArray, *_: Any, **__: Any) -> list[SimpleNamespace]:
        values = given[:, len(base.directions) :]
        gains = values @ score - 0.5 * np.einsum("ni,ij,nj->n", values, information, values)
        return [SimpleNamespace(found=SimpleNamespace(log_evidence=nothing + gain)) for gain in gains]

    modes = []
    for prior, share in priors_of(kind, at).items():
        cover = prior.cover(at)
        left = np.linalg.inv(information + np.linalg.inv(cover))
        freedom = 0.5 * np.linalg.slogdet(np.eye(len(at)) + cover @ information)[1]
        modes.append(Mode(left @ score, 0.5 * (left + left.T), share + 0.5 * score @ left @ score - freedom))
    exact = float(np.logaddexp.reduce([mode.log_factor for mode in modes]))
    near = tuple(mode for mode in modes if mode.log_factor > max(one.log_factor for one in modes) - 4.0)
    assert 1 < len(near) < len(modes)
    fit = base.fit
    profile = Profile(kind, Prior(1.0, 80.0), at, near[0].mean, near[0].covariance, 0.0, 0.0, fit, near)
    monkeypatch.setattr(profile_evidence, "refit", refitted)
    own = max(near, key=lambda mode: mode.log_factor)
    monkeypatch.setattr(profile_evidence, "mode_at", lambda base, profile, values: own)
    assert sampled_log_factor(base, profile, pool, seed=seed) == pytest.approx(exact, abs=0.3)


@pytest.mark.parametrize("kind", [0, 1])
def test_laplace_where_gates_are_dense(
    base: Base, pool: Executor, kind: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Readings are nearly linear in a weak force there: under one prior both routes agree."""
    at = np.array([700.0, 750.0, 850.0, 900.0])
    force = combined(base.setting, KINDS[kind], at, (0.2, 3e-4)[kind] * np.array([0.0, 1.0, 1.0, 0.0]))
    changed = recorded(base, force)
    found = fit_profile(changed, KINDS[kind])
    cover = found.prior.cover(found.knots_m)
    price = 0.5 * found.mean @ np.linalg.solve(cover, found.mean)
    freedom = 0.5 * (np.linalg.slogdet(cover)[1] - np.linalg.slogdet(found.covariance)[1])
    laplace = max(found.gain - price, 0.0) - freedom
    alone = replace(found, modes=(Mode(found.mean, found.covariance, 0.0),))
    monkeypatch.setattr(profile_evidence, "priors_of", lambda kind, at: {found.prior: 0.0})
    sampled = [sampled_log_factor(changed, alone, pool, seed=seed) for seed in range(2)]
    assert sampled == pytest.approx([laplace] * 2, abs=0.4)
    # From a draw beside the top the mode is found again.
    rng = np.random.default_rng(7)
    mode = mode_at(changed, found, rng.multivariate_normal(found.mean, found.covariance, method="cholesky"))
    off = mode.mean - found.mean
    assert off @ np.linalg.solve(found.covariance, off) < 1.0


def test_which_forces_are_sampled(
    base: Base, pool: ThreadPoolExecutor, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those that some nats more would bring near the best of all, if they are more probable than none."""
    profile = on_two_hills(base, monkeypatch).profile
    asked: list[tuple[float, float]] = []

    def sampled(base: Base, profile: Profile, pool: Executor, least: float) -> float:
        pool.submit(int).result(timeout=10)  # its one thread must be free for what is waited for
        asked.append((profile.log_bayes_factor, least))
        return profile.log_bayes_factor + 3.0

    monkeypatch.setattr(corrections, "sampled_log_factor", sampled)

    def factors(laplace: list[float], best: float) -> list[float]:
        asked.clear()
        profiles = [replace(profile, log_bayes_factor=one) for one in laplace]
        _, again = corrections.recomputed(base, {}, profiles, pool, best)
        return [one.log_bayes_factor for one in again]

    assert factors([19.0, 13.0, 11.0], 20.0) == [22.0, 16.0, 11.0]
    assert sorted(asked) == [(13.0, 16.0), (19.0, 16.0)]
    assert factors([1.0, -1.0], -np.inf) == [4.0, -1.0] and asked == [(1.0, 0.0)]
