"""How many threads there are changes how long it takes, and nothing else."""

from __future__ import annotations

import os

import numpy as np
import pytest
from diagnosis_cases import sparse_base

from skred.diagnosis.check.bootstrap_test import odds_test
from skred.diagnosis.compare.screening import curve
from skred.diagnosis.evidence.coefficient import curve_near
from skred.diagnosis.evidence.event_quadrature import FINE
from skred.diagnosis.evidence.extension import extended
from skred.diagnosis.tabulated.coefficient_grid import locate
from skred.diagnosis.tabulated.tables import build_tables
from skred.parallel.processes import helpers
from skred.parallel.threads import in_parts, side_by_side, threads
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.placed import placed


@pytest.mark.parametrize(("said", "n"), [("3", 3), ("1", 1), ("0", None), ("many", None), ("", None)])
def test_threads_are_as_many_as_allowed(monkeypatch: pytest.MonkeyPatch, said: str, n: int | None) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", said)
    assert threads() == (n or os.cpu_count())


@pytest.mark.parametrize(("n", "parts"), [(0, 0), (1, 1), (2, 2), (3, 3), (10, 3)])
def test_parts_are_everything_once(monkeypatch: pytest.MonkeyPatch, n: int, parts: int) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    found = in_parts(n)
    assert len(found) == parts
    assert [k for part in found for k in range(n)[part]] == list(range(n))
    assert side_by_side(lambda part: part.stop - part.start, found) == [one.stop - one.start for one in found]


def test_there_are_no_threads_within_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    assert side_by_side(lambda _: (threads(), len(in_parts(10))), range(5)) == [(1, 1)] * 5
    assert threads() == 3


@pytest.mark.slow
def test_the_check_is_the_same_in_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    base = sparse_base()
    n = len(base.law.mechanisms)
    rng = np.random.default_rng(3)
    means = base.population.mean + 0.05 * rng.standard_normal((120, n))
    draws = means, np.tile(0.1 * np.eye(n), (120, 1, 1))
    found = []
    for said in ("1", "2"):
        monkeypatch.setenv("OMP_NUM_THREADS", said)
        found.append(odds_test(base, draws, 5, -1.2))
    with helpers():
        found.append(odds_test(base, draws, 5, -1.2))
    one, *others = found
    assert all(one.statistic == other.statistic for other in others)
    assert 4 <= len(one.simulated) < 120  # it stopped at the fourth that is as odd
    assert (one.simulated >= one.statistic).sum() == 4 and one.simulated[-1] >= one.statistic
    for other in others:
        np.testing.assert_array_equal(one.simulated, other.simulated)


@pytest.mark.slow
def test_tables_are_the_same_in_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    base = sparse_base()
    mechanism = mechanisms()["viscous_drag"]
    assert mechanism.added is not None
    shape = mechanism.added.shapes(base.setting)[0]
    near = curve_near(base, curve(base, placed(mechanism, base.setting, shape)), shape)
    extension = extended(base.problem, base.law, (near.direction,))
    found = []
    for said in ("1", "3"):
        monkeypatch.setenv("OMP_NUM_THREADS", said)
        found.append(build_tables(base, extension, locate(base, extension, [near]), FINE))
    one, two = found
    np.testing.assert_array_equal(one.grid.points, two.grid.points)
    np.testing.assert_array_equal(one.modes, two.modes)
    for name, values in one.arrays.items():
        np.testing.assert_array_equal(values, two.arrays[name])
