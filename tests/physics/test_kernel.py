"""The kernel against the plain reference: the same scheme, written twice.

Also terms in U agree to rounding, because both freeze them over the same stretch: from edge to edge, cut at
the release, at barriers and where the normal force switches. Both agree with the equation of motion itself
only to second order there (`test_reference.py` holds the reference against an integrator in time).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from test_reference import counter_slope, plane, roll_over_slope, terrain_from_slope

from skred.campaign import find_campaign, read_campaign
from skred.physics.geometry import path_of, sensor_table
from skred.physics.kernel.columns import GRAVITY, Column
from skred.physics.kernel.fronts import front_speeds, simulate, simulate_with_jacobian
from skred.physics.kernel.inputs import make_contributions
from skred.physics.reference import read_front, run_front
from skred.physics.terrain import Terrain, build_terrain

WEAKENING_SPEED = 8.0
COLUMNS = np.arange(len(Column))


def _ryggfonn() -> Terrain:
    track = read_campaign(find_campaign("ryggfonn")).track
    return build_terrain(track.x_m, track.z_m)


def _rough() -> Terrain:
    """Random slopes and curvatures far beyond any track's: the normal force goes off and on again."""
    rng = np.random.default_rng(8)
    edges = np.concatenate([[0.0], np.cumsum(rng.uniform(0.5, 20.0, 80))])
    phi = np.radians(rng.uniform(-25.0, 70.0, 80))
    return Terrain(edges, np.sin(phi), np.cos(phi), rng.normal(0.0, 0.05, 80))


TERRAINS = {
    "ryggfonn": _ryggfonn(),
    "roll over": terrain_from_slope(roll_over_slope, 900.0, 90),
    "counter slope": terrain_from_slope(counter_slope, 1200.0, 100),
    "rough": _rough(),
    "plane of one cell": plane(30.0, 100.0, 1),
}
POINTS = np.array([0.0, 0.02, 0.11, 0.25, 0.371, 0.5, 0.6, 0.77, 0.86, 0.999, 1.0])


@dataclass(frozen=True)
class Case:
    """A front: five strengths in the order of `Column`, its release, barriers, the speed at the release."""

    terrain: str
    strengths: tuple[float, ...]
    release_s_m: float
    barriers: tuple[tuple[float, float, float], ...] = ()
    release_speed: float = 0.0
    sensors: tuple[tuple[str, float, float], ...] = field(init=False)

    def __post_init__(self) -> None:
        """Points and spans over the whole track, at edges and inside cells, and the runout."""
        edges = TERRAINS[self.terrain].edge_s_m
        places = np.sort(np.concatenate([POINTS * edges[-1], edges[[0, len(edges) // 2, -1]]]))
        places = np.unique(np.append(places, [self.release_s_m, *(place for place, _, _ in self.barriers)]))
        points = [("point", s, s) for s in places]
        spans = [
            ("span", s, t) for s, t in zip(places[:-2], places[2:], strict=True) if s != self.release_s_m
        ]
        to_stop = [("span to stop", s, t) for _, s, t in spans if s < t]
        object.__setattr__(self, "sensors", (*points, *spans, *to_stop, ("runout", 0.0, 0.0)))

    def kernel(self) -> tuple[np.ndarray, np.ndarray]:
        """Readings and jacobian."""
        terrain = TERRAINS[self.terrain]
        law = make_contributions(COLUMNS, np.ones((5, terrain.n_cells)), WEAKENING_SPEED)
        if self.strengths[Column.LINEAR] == self.strengths[Column.WEAKENING] == 0:
            law = law._replace(speed_terms=False)
        table = np.vstack(
            [
                sensor_table([None if kind == "runout" else (s, t)], to_stop=kind == "span to stop")
                for kind, s, t in self.sensors
            ]
        )
        arguments = (
            np.array([self.strengths]),
            np.array([self.release_s_m]),
            path_of(terrain, self.barriers),
            law,
            table,
            np.array([self.release_speed]),
        )
        readings, jacobian = simulate_with_jacobian(*arguments, by_speed=True)
        np.testing.assert_array_equal(simulate(*arguments), readings)
        np.testing.assert_array_equal(simulate_with_jacobian(*arguments)[1], jacobian[..., :-1])
        return readings[0], jacobian[0]

    def reference(self, along: int | None = None) -> np.ndarray:
        """Readings, or their derivative by a strength by a complex step.

        Number 5 is the place of the release, 6 the speed there.
        """
        step = 0.0 if along is None else 1e-40j
        strengths = [value + step * (k == along) for k, value in enumerate(self.strengths)]
        readings = read_front(
            TERRAINS[self.terrain],
            np.repeat(np.array(strengths)[:, None], TERRAINS[self.terrain].n_cells, axis=1),
            self.release_s_m + step * (along == 5),
            self.sensors,
            weakening_speed=WEAKENING_SPEED,
            barriers=self.barriers,
            release_speed=self.release_speed + step * (along == 6),
        )
        return readings if along is None else readings.imag / 1e-40

    def settled(self) -> np.ndarray:
        """Readings for which rounding decides nothing: not within a millimetre of the stop."""
        runout = run_front(
            TERRAINS[self.terrain],
            np.repeat(np.array(self.strengths)[:, None], TERRAINS[self.terrain].n_cells, axis=1),
            self.release_s_m,
            weakening_speed=WEAKENING_SPEED,
            barriers=self.barriers,
            release_speed=self.release_speed,
        ).runout_s_m
        at_barrier = [place for place, _, _ in self.barriers]
        ends = np.array([t for _, _, t in self.sensors])
        starts = np.array([s if kind == "span to stop" else np.inf for kind, s, _ in self.sensors])
        clear = (abs(ends - runout) > 1e-3) | np.isin(ends, at_barrier) | (ends == runout)
        return clear & (abs(starts - runout) > 1e-3)


@st.composite
def cases(draw: st.DrawFn, speed_terms: bool = True) -> Case:
    """Fronts over the prior range, with releases and barriers anywhere, at edges and ends as well."""
    name = draw(st.sampled_from(sorted(TERRAINS)))
    edges = TERRAINS[name].edge_s_m.tolist()
    # To a micrometre: a barrier 1e-323 m below the release has derivatives that no number holds.
    place = st.one_of(
        st.sampled_from(edges), st.floats(0.0, edges[-1]).map(lambda s: min(round(s, 6), edges[-1]))
    )

    def strength(largest: float) -> float:
        return draw(st.one_of(st.just(0.0), st.floats(0.0, largest / 10), st.floats(0.0, largest)))

    largest = (12.0, 0.3 * speed_terms, 0.04, 1.5, 0.5 * speed_terms)
    strengths = tuple(strength(value) if value > 0 else 0.0 for value in largest)
    barrier = st.tuples(place, st.floats(0.0, 20.0), st.sampled_from([0.0, 10.0, 60.0]))
    release = draw(st.one_of(st.sampled_from([0.0, edges[-1]]), place))
    speed = draw(st.one_of(st.just(0.0), st.floats(0.5, 60.0)))
    return Case(name, strengths, release, tuple(sorted(draw(st.lists(barrier, max_size=3)))), speed)


SLIPPERY = (0.0, 0.0, 0.0, 0.05, 0.0)
BARRIER_AT_RELEASE = Case("counter slope", SLIPPERY, 60.0, ((60.0, 5.0, 1.0), (600.0, 2.0, 10.0)))


def compare(case: Case) -> None:
    expected, (readings, jacobian) = case.reference(), case.kernel()
    assert np.all(np.isfinite(readings)) and np.all(np.isfinite(jacobian))
    settled = case.settled()
    assert_allclose(readings[settled], expected[settled], rtol=1e-10, atol=1e-9)


@settings(max_examples=250, deadline=None, derandomize=True)
@given(cases(speed_terms=False))
@example(BARRIER_AT_RELEASE)
def test_closed_forms_agree_with_the_reference(case: Case) -> None:
    compare(case)


@settings(max_examples=80, deadline=None, derandomize=True)
@given(cases())
def test_terms_in_speed_agree_with_the_reference(case: Case) -> None:
    compare(case)


def directed(
    terrain: str, release: float, barriers: tuple = (), speed: float = 0.0, **columns: float
) -> Case:
    return Case(terrain, tuple(columns.get(c.name.lower(), 0.0) for c in Column), release, barriers, speed)


DIRECTED = {
    "pcm": directed("ryggfonn", 0.0, friction=0.26, quadratic=3e-3),
    "all terms": directed(
        "ryggfonn", 3.3, constant=0.5, linear=0.02, quadratic=1e-3, friction=0.15, weakening=0.1
    ),
    "viscous": directed("ryggfonn", 0.0, friction=0.25, linear=0.05),
    "weakening": directed("ryggfonn", 17.0, friction=0.15, weakening=0.2, quadratic=1e-3),
    "ballistic on a real track": directed("ryggfonn", 0.0, friction=0.15),
    "beyond the series": directed("ryggfonn", 0.0, friction=0.2, quadratic=0.3),
    "far beyond the series": directed("ryggfonn", 0.0, quadratic=80.0),
    "switch": directed("roll over", 11.0, friction=0.2),
    "switch with terms in U": directed("roll over", 11.0, friction=0.2, linear=0.02, weakening=0.05),
    "switch within cells": directed("rough", 3.0, friction=0.3, quadratic=2e-3),
    "stop on the counter slope": directed("counter slope", 7.0, friction=0.1),
    "barrier passed": directed("counter slope", 7.0, ((303.0, 3.0, 20.0),), friction=0.1, linear=0.01),
    "several in one cell": directed(
        "counter slope", 7.0, ((303.0, 3.0, 20.0), (303.0, 3.0, 10.0), (305.0, 2.0, 5.0)), friction=0.1
    ),
    "barrier in the cell of release": directed(
        "counter slope", 61.0, ((62.0, 0.1, 0.5),), friction=0.05, linear=0.05
    ),
    "barrier at an edge": directed("counter slope", 7.0, ((300.0, 3.0, 20.0),), friction=0.1),
    "barrier that stops": directed("counter slope", 7.0, ((300.0, 80.0, 0.0),), friction=0.1),
    "barrier beyond the stop": directed("counter slope", 7.0, ((1150.0, 3.0, 20.0),), friction=0.25),
    "barrier at the end": directed("roll over", 7.0, ((900.0, 1.0, 2.0),), friction=0.1),
    "never starts": directed("ryggfonn", 100.0, friction=1.5),
    "one cell": directed("plane of one cell", 12.0, friction=0.2, quadratic=2e-3, linear=0.1),
    "with a speed, at an edge": directed("counter slope", 60.0, speed=21.0, friction=0.4, quadratic=1e-3),
    "with a speed, in a cell": directed("ryggfonn", 703.3, speed=31.0, friction=0.3, quadratic=1e-3),
    "with a speed and terms in U": directed(
        "ryggfonn", 703.3, speed=31.0, friction=0.2, linear=0.02, weakening=0.1
    ),
    "with a speed, off the ground": directed("rough", 33.0, speed=40.0, friction=0.2, quadratic=1e-3),
    "with a speed, stops in its cell": directed("plane of one cell", 12.0, speed=9.0, friction=1.2),
    "with a speed, before a barrier": directed(
        "counter slope", 301.0, ((303.0, 3.0, 20.0),), speed=12.0, friction=0.3
    ),
}


@pytest.mark.parametrize("name", DIRECTED)
def test_readings_and_jacobian_agree_with_the_reference(name: str) -> None:
    case = DIRECTED[name]
    compare(case)
    jacobian, settled = case.kernel()[1], case.settled()
    # A span that starts at the release has an infinite derivative by it, a point there none.
    settled &= [case.release_s_m not in (s, t) for _, s, t in case.sensors]
    speed_terms = case.strengths[Column.LINEAR] + case.strengths[Column.WEAKENING] > 0
    for k in range(7):
        if k in (Column.LINEAR, Column.WEAKENING) and not speed_terms:
            continue
        expected = case.reference(k)[settled]
        scale = np.abs(expected).max(initial=0.0)
        assert_allclose(jacobian[settled, k], expected, rtol=1e-8, atol=1e-9 * scale + 1e-30)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(cases(speed_terms=False))
def test_jacobian_agrees_with_a_complex_step_of_the_reference(case: Case) -> None:
    # A front released with a speed at the very place of a barrier stops there, or goes on from just below it.
    assume(case.release_speed == 0.0 or case.release_s_m not in [place for place, _, _ in case.barriers])
    jacobian, settled = case.kernel()[1], case.settled()
    settled &= [case.release_s_m not in (s, t) for _, s, t in case.sensors]
    for k in (Column.CONSTANT, Column.QUADRATIC, Column.FRICTION, 5, 6):
        expected = case.reference(k)[settled]
        scale = max(np.abs(expected).max(initial=0.0), 1e-3)
        assert_allclose(jacobian[settled, k], expected, rtol=1e-7, atol=1e-8 * scale)


def test_front_speeds_are_those_of_the_reference() -> None:
    case = DIRECTED["switch"]
    terrain = TERRAINS[case.terrain]
    law = make_contributions(COLUMNS, np.ones((5, terrain.n_cells)), WEAKENING_SPEED)
    path = path_of(terrain)
    table = np.repeat(np.array(case.strengths)[:, None], terrain.n_cells, axis=1)
    for release, begin in ((case.release_s_m, 30.0), (terrain.edge_s_m[5], 25.0)):
        fast = front_speeds(np.array([case.strengths]), np.array([release]), path, law, begin)[0]
        expected = run_front(terrain, table, release, release_speed=begin).edge_speed_squared
        assert_allclose(fast, np.sqrt(expected), rtol=1e-10)
    speeds = front_speeds(np.array([case.strengths]), np.array([case.release_s_m]), path, law)[0]
    run = run_front(terrain, table, case.release_s_m)
    assert_allclose(speeds, np.sqrt(run.edge_speed_squared), rtol=1e-10)
    airborne = GRAVITY * terrain.cos_slope + terrain.curvature * speeds[:-1] ** 2 < 0
    assert 0 < airborne.sum() < np.count_nonzero(speeds)


def test_profiles_of_one_column_add_up() -> None:
    terrain = TERRAINS["ryggfonn"]
    # Each of the two is 0 on a quarter of the track, where the table is not filled with it.
    ramp = np.clip(np.linspace(-0.5, 1.5, terrain.n_cells), 0.0, 1.0)
    law = make_contributions(np.array([3, 2, 3]), np.array([ramp, ramp, 1 - ramp]), WEAKENING_SPEED)
    # Two runs: the second must not find what the first left in the table.
    strengths, sensors = (
        np.array([[0.3, 2e-3, 0.2], [0.25, 0.0, 0.22]]),
        sensor_table([(1650.0, 1650.0), None]),
    )
    readings, jacobian = simulate_with_jacobian(strengths, np.zeros(2), path_of(terrain), law, sensors)

    def reference(run: int, step: np.ndarray) -> np.ndarray:
        a, d, b = strengths[run] + step
        table = np.zeros((5, terrain.n_cells), dtype=complex)
        table[Column.QUADRATIC], table[Column.FRICTION] = d * ramp, a * ramp + b * (1 - ramp)
        return read_front(terrain, table, 0.0, [("point", 1650.0, 1650.0), ("runout", 0.0, 0.0)])

    for run in range(2):
        assert_allclose(readings[run], reference(run, np.zeros(3)).real, rtol=1e-11)
        derivatives = np.array([reference(run, row).imag for row in np.eye(3) * 1e-40j]).T / 1e-40
        assert_allclose(jacobian[run, :, :3], derivatives, rtol=1e-9)


def test_a_profile_that_is_nil_everywhere_changes_nothing() -> None:
    terrain = TERRAINS["ryggfonn"]
    one, nil = np.ones(terrain.n_cells), np.zeros(terrain.n_cells)
    sensors = sensor_table([(1650.0, 1650.0), None])

    def readings(*profiles: np.ndarray) -> np.ndarray:
        law = make_contributions(np.full(len(profiles), 3), np.array(profiles), WEAKENING_SPEED)
        strengths = np.tile(np.linspace(0.4, 0.5, 3)[:, None], len(profiles))
        return simulate(strengths, np.zeros(3), path_of(terrain), law, sensors)

    assert_allclose(readings(nil, one, nil), readings(one), rtol=0.0)


@pytest.mark.parametrize("name", TERRAINS)
def test_the_far_corner_of_the_prior_is_finite(name: str) -> None:
    terrain = TERRAINS[name]
    rng = np.random.default_rng(4)
    strengths = 10.0 ** rng.uniform(-6.0, 3.0, (300, 5))
    strengths[rng.random(strengths.shape) < 0.4] = 0.0
    releases = rng.uniform(0.0, terrain.length_m, 300)
    law = make_contributions(COLUMNS, np.ones((5, terrain.n_cells)), WEAKENING_SPEED)
    end = terrain.length_m
    sensors = sensor_table([(0.5 * end, 0.5 * end), (0.3 * end, 0.9 * end), None])
    for speed_terms in (True, False):
        readings, jacobian = simulate_with_jacobian(
            strengths, releases, path_of(terrain), law._replace(speed_terms=speed_terms), sensors
        )
        assert np.all(np.isfinite(readings)) and np.all(np.isfinite(jacobian))
        assert np.all(readings >= 0.0) and np.all(readings[:, 2] >= releases)
        assert np.all(readings[:, 2] <= end)


@pytest.mark.parametrize("name", TERRAINS)
def test_a_front_with_terms_in_speed_is_the_same_alone_and_beside_others(name: str) -> None:
    terrain = TERRAINS[name]
    rng = np.random.default_rng(5)
    n = 37  # not a multiple of how many go abreast
    strengths = np.array([2.0, 0.1, 0.004, 0.4, 0.2]) * rng.uniform(0.0, 1.5, (n, 5))
    releases = rng.uniform(0.0, 0.5 * terrain.length_m, n)
    releases[::5] = terrain.edge_s_m[terrain.n_cells // 4]
    law = make_contributions(COLUMNS, np.ones((5, terrain.n_cells)), WEAKENING_SPEED)
    end = terrain.length_m
    path = path_of(terrain, ((0.6 * end, 5.0, 50.0),))
    sensors = sensor_table([(0.5 * end, 0.5 * end), (0.3 * end, 0.9 * end), None])
    begin = np.where(np.arange(n) % 3 == 0, 0.0, 15.0)
    together = simulate_with_jacobian(strengths, releases, path, law, sensors, begin)
    speeds = front_speeds(strengths, releases, path, law, begin)
    assert len(np.unique(together[0][:, 2])) > 3
    for k in range(n):
        one_alone = strengths[[k]], releases[[k]], path, law
        alone = simulate_with_jacobian(*one_alone, sensors, begin[[k]])
        for one, own in zip(together, alone, strict=True):
            np.testing.assert_array_equal(one[k], own[0])
        np.testing.assert_array_equal(speeds[k], front_speeds(*one_alone, begin[[k]])[0])


def test_each_front_has_its_sensors_where_they_are_for_it() -> None:
    """Moved sensors read what sensors noted there read, with tangents; none goes beyond the track's ends."""
    terrain = TERRAINS["counter slope"]
    rng, n, end = np.random.default_rng(8), 9, terrain.length_m
    strengths = np.array([0.5, 0.002, 0.2]) * rng.uniform(0.3, 1.5, (n, 3))
    columns = np.array([int(c) for c in (Column.CONSTANT, Column.QUADRATIC, Column.FRICTION)])
    law = make_contributions(columns, np.ones((3, terrain.n_cells)), WEAKENING_SPEED)
    releases, path = rng.uniform(0.0, 0.1 * end, n), path_of(terrain)
    places = [(0.3 * end, 0.3 * end), (0.4 * end, 0.5 * end)]
    shifts = np.column_stack([rng.uniform(-0.1 * end, 0.1 * end, (n, 2)), np.zeros(n)])
    shifts[0, 0], shifts[1, 1] = -end, end
    found = simulate_with_jacobian(strengths, releases, path, law, sensor_table([*places, None]), 8.0, shifts)
    for k in range(n):
        moved = [(a + by, b + by) for (a, b), by in zip(places, shifts[k, :2], strict=True)]
        moved[0] = moved[0] if k != 0 else (0.0, 0.0)
        moved[1] = moved[1] if k != 1 else (0.9 * end, end)
        sensors = sensor_table([*moved, None])
        alone = simulate_with_jacobian(strengths[[k]], releases[[k]], path, law, sensors, 8.0)
        for one, own in zip(found, alone, strict=True):
            np.testing.assert_allclose(one[k], own[0], rtol=1e-12)
