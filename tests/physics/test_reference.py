"""The plain reference against closed forms, an integrator in time, and itself under refinement."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from time_integrator import integrate_in_time

from skred.physics.geometry import path_of, sensor_table
from skred.physics.kernel.columns import GRAVITY, Column
from skred.physics.kernel.fronts import simulate
from skred.physics.kernel.inputs import make_contributions
from skred.physics.reference import read_front, run_front
from skred.physics.terrain import Terrain

SlopeFunction = Callable[[float], float]


def terrain_from_slope(slope: SlopeFunction, length: float, n_cells: int) -> Terrain:
    """Cells of equal length whose angle change is that of the smooth slope function."""
    edge_s = np.linspace(0.0, length, n_cells + 1)
    middle = np.array([slope(s) for s in (edge_s[1:] + edge_s[:-1]) / 2])
    edge_phi = np.array([slope(s) for s in edge_s])
    return Terrain(edge_s, np.sin(middle), np.cos(middle), -np.diff(edge_phi) / np.diff(edge_s))


def coefficients(terrain: Terrain, dtype: type = float, **columns: complex) -> np.ndarray:
    table = np.zeros((len(Column), terrain.n_cells), dtype=dtype)
    for name, value in columns.items():
        table[Column[name.upper()]] = value
    return table


def plane(angle_deg: float, length: float, n_cells: int) -> Terrain:
    return terrain_from_slope(lambda s: math.radians(angle_deg), length, n_cells)


def parabola_slope(s: float) -> float:
    """Slope of z = a (x - x_bottom)^2, by inverting the arc length."""
    a, top = 0.0004, 0.9

    def arc(m: float) -> float:
        return (m * math.sqrt(1 + m * m) + math.asinh(m)) / (4 * a)

    return math.atan(brentq(lambda m: arc(top) - arc(m) - s, -2.0, 1.0, xtol=1e-14))


def roll_over_slope(s: float) -> float:
    """Slope that steepens so abruptly that a fast front leaves the ground, then runs out."""
    steepening = math.radians(12) * math.tanh((s - 150) / 12)
    return math.radians(38) + steepening - math.radians(26) * (1 + math.tanh((s - 450) / 90))


def counter_slope(s: float) -> float:
    """Valley with an opposite slope of 12 degrees."""
    return math.radians(11) - math.radians(23) * math.tanh((s - 500) / 120)


def derivative(slope: SlopeFunction) -> SlopeFunction:
    return lambda s: -(slope(s + 1e-3) - slope(s - 1e-3)) / 2e-3


def test_a_front_that_is_released_with_a_speed_on_a_plane() -> None:
    terrain, mu, begin = plane(10.0, 900.0, 41), 0.4, 23.0
    cell = coefficients(terrain, friction=mu)
    slowing = GRAVITY * (mu * math.cos(math.radians(10.0)) - math.sin(math.radians(10.0)))
    places = [20.0, 50.0, 99.0]
    sensors = [*(("point", s, s) for s in places), ("runout", 0.0, 0.0)]
    found = read_front(terrain, cell, 20.0, sensors, release_speed=begin)
    speeds = [math.sqrt(begin**2 - 2 * slowing * (s - 20.0)) for s in places]
    assert_allclose(found, [*speeds, 20.0 + begin**2 / (2 * slowing)], rtol=1e-13)
    path, law = path_of(terrain), make_contributions(np.array([3]), np.ones((1, 41)), 8.0)
    table = sensor_table([*((s, s) for s in places), None])
    kernel = simulate(np.array([[mu]]), np.array([20.0]), path, law, table, begin)[0]
    assert_allclose(kernel, found, rtol=1e-12)


def test_coulomb_front_on_a_plane() -> None:
    terrain, mu = plane(30.0, 500.0, 7), 0.3
    points = [50.0, 123.4, 500.0]
    speeds = read_front(terrain, coefficients(terrain, friction=mu), 20.0, [("point", s, s) for s in points])
    acceleration = GRAVITY * (math.sin(math.pi / 6) - mu * math.cos(math.pi / 6))
    assert_allclose(speeds, [math.sqrt(2 * acceleration * (s - 20.0)) for s in points], rtol=1e-13)
    span, runout = read_front(
        terrain, coefficients(terrain, friction=mu), 20.0, [("span", 60.0, 301.0), ("runout", 0.0, 0.0)]
    )
    travel = (math.sqrt(2 * 281.0) - math.sqrt(2 * 40.0)) / math.sqrt(acceleration)
    assert_allclose(span, 241.0 / travel, rtol=1e-13)
    assert runout == 500.0
    assert run_front(terrain, coefficients(terrain, friction=mu), 20.0).left_track


@pytest.mark.parametrize("slope", [parabola_slope, roll_over_slope, counter_slope])
def test_constant_retardation_is_an_energy_balance(slope: SlopeFunction) -> None:
    terrain, b, release = terrain_from_slope(slope, 900.0, 60), 2.5, 15.0
    run = run_front(terrain, coefficients(terrain, constant=b), release)
    drop = np.concatenate([[0.0], np.cumsum(terrain.sin_slope * 15.0)])
    energy = 2 * (GRAVITY * (drop - drop[1]) - b * (terrain.edge_s_m - release))
    below = (terrain.edge_s_m > release) & (terrain.edge_s_m < run.runout_s_m)
    assert below.sum() > 20
    assert_allclose(run.edge_speed_squared[below], energy[below], rtol=1e-12)
    last = int(np.flatnonzero(below)[-1])
    stop = np.interp(0.0, -energy[last : last + 2], terrain.edge_s_m[last : last + 2])
    assert_allclose(run.runout_s_m, stop, rtol=1e-12)


def test_turbulent_drag_approaches_the_terminal_speed_exponentially() -> None:
    terrain, mu, drag = plane(35.0, 2000.0, 11), 0.2, 4e-3
    run = run_front(terrain, coefficients(terrain, friction=mu, quadratic=drag), 0.0)
    phi = math.radians(35.0)
    terminal = GRAVITY * (math.sin(phi) - mu * math.cos(phi)) / drag
    assert_allclose(run.edge_speed_squared, terminal * -np.expm1(-2 * drag * terrain.edge_s_m), rtol=1e-13)


@pytest.mark.parametrize(
    ("columns", "grids", "ratio"),
    # From rest the error is h^2 log(1/h): the ratio comes to 4 slowly, and the faster the friction
    # changes in the first cells the later.
    [({"linear": 0.08}, (50, 100, 200), 3.2), ({"weakening": 0.4, "linear": 0.02}, (800, 1600, 3200), 2.8)],
)
def test_terms_in_speed_are_second_order_on_a_plane(
    columns: dict[str, float], grids: tuple[int, ...], ratio: float
) -> None:
    phi, critical = math.radians(32.0), 8.0

    def motion(_: float, state: np.ndarray) -> list[float]:
        speed = state[1]
        weakened = columns.get("weakening", 0.0) * GRAVITY * math.cos(phi) / (1 + speed / critical)
        return [speed, GRAVITY * math.sin(phi) - columns["linear"] * speed - weakened]

    events = [lambda _, state: state[0] - 100.0, lambda _, state: state[0] - 400.0]
    exact = solve_ivp(motion, (0, 60), [0, 0], method="DOP853", events=events, rtol=1e-12, atol=1e-12)
    (start,), (end,) = exact.t_events
    expected = [exact.y_events[1][0][1], 300.0 / (end - start)]
    errors = []
    for n_cells in grids:
        terrain = plane(32.0, 500.0, n_cells)
        readings = read_front(
            terrain,
            coefficients(terrain, **columns),
            0.0,
            [("point", 400.0, 400.0), ("span", 100.0, 400.0)],
            weakening_speed=critical,
        )
        errors.append(np.abs(readings - expected))
    ratios = np.array(errors[:-1]) / np.array(errors[1:])
    assert np.all(errors[-1] < 6e-4), errors
    assert np.all(ratios > ratio), ratios


@pytest.mark.parametrize("drag", [0.3, 1.0, 10.0])
def test_a_term_in_speed_alone_never_holds_a_front_at_rest(drag: float) -> None:
    """However short the way to the terminal speed: here far within the first cell of 6 m."""
    terrain = plane(30.0, 300.0, 50)
    point, runout = read_front(
        terrain, coefficients(terrain, linear=drag), 0.0, [("point", 280.0, 280.0), ("runout", 0.0, 0.0)]
    )
    assert runout == 300.0
    # At 10 1/s the way to the terminal speed is 2 cm, and its approach rings over many cells.
    assert_allclose(point, GRAVITY * 0.5 / drag, rtol=0.05)


LAWS = {
    "coulomb": {"friction": 0.35},
    "slippery": {"friction": 0.2, "constant": 1.0},
    "pcm": {"friction": 0.25, "quadratic": 2e-3},
    "constant": {"constant": 3.0},
    "viscous": {"friction": 0.25, "linear": 0.05},
    "weakening": {"friction": 0.12, "weakening": 0.25, "quadratic": 1e-3},
}
TRACKS = {"parabola": parabola_slope, "roll_over": roll_over_slope, "counter_slope": counter_slope}


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("track", TRACKS)
def test_agrees_with_integration_in_time_at_second_order(track: str, law: str) -> None:
    slope, columns, length, release = TRACKS[track], LAWS[law], 1400.0, 12.0
    weakening_speed = 8.0
    exact = integrate_in_time(
        slope,
        derivative(slope),
        release,
        [200.0, 300.0, 380.0],
        end=length,
        weakening_speed=weakening_speed,
        **columns,
    )
    assert exact.runout > 390.0
    span = 80.0 / (exact.arrival_time[2] - exact.arrival_time[1])
    expected = np.array([exact.speed[0], exact.speed[2], span, exact.runout])
    sensors = [("point", 200.0, 200.0), ("point", 380.0, 380.0), ("span", 300.0, 380.0), ("runout", 0.0, 0.0)]
    errors = []
    for n_cells in (700, 2800):
        terrain = terrain_from_slope(slope, length, n_cells)
        table = coefficients(terrain, **columns)
        readings = read_front(terrain, table, release, sensors, weakening_speed=weakening_speed)
        errors.append(np.abs(readings - expected))
    # Release and sensors lie on edges of both grids; the stop lies somewhere in a cell.
    assert np.all(errors[1] < [4e-4, 4e-4, 4e-4, 2e-3]), errors
    assert np.linalg.norm(errors[0][:3]) / np.linalg.norm(errors[1][:3]) > 8.8, errors


def test_roll_over_switches_the_normal_force_off() -> None:
    terrain = terrain_from_slope(roll_over_slope, 1400.0, 700)
    run = run_front(terrain, coefficients(terrain, friction=0.2), 11.0)
    normal = GRAVITY * terrain.cos_slope + terrain.curvature * run.edge_speed_squared[:-1]
    airborne = (normal < 0) & (run.edge_speed_squared[:-1] > 0)
    assert airborne.sum() > 5
    i = int(np.flatnonzero(airborne)[2])
    gained = run.edge_speed_squared[i + 1] - run.edge_speed_squared[i]
    assert_allclose(gained, 2 * GRAVITY * terrain.sin_slope[i] * 2.0, rtol=1e-11)


def test_front_stays_where_friction_holds_it_and_never_starts_again() -> None:
    terrain = plane(20.0, 100.0, 5)
    run = run_front(terrain, coefficients(terrain, friction=0.5), 33.0)
    assert run.runout_s_m == 33.0 and not run.left_track and not run.edge_speed_squared.any()
    # Steep, level, steep again: once stopped on the level part the front stays there.
    phi = np.radians([30.0, 0.0, 40.0])
    steps = Terrain(np.array([0.0, 100.0, 500.0, 900.0]), np.sin(phi), np.cos(phi), np.zeros(3))
    run = run_front(steps, coefficients(steps, friction=0.3), 0.0)
    assert_allclose(run.runout_s_m, 100 + 100 * (math.sin(phi[0]) - 0.3 * math.cos(phi[0])) / 0.3, rtol=1e-13)
    with pytest.raises(ValueError, match="release at 901"):
        run_front(steps, coefficients(steps, friction=0.3), 901.0)


def test_barrier_stops_below_its_threshold_and_takes_its_loss_above() -> None:
    terrain = plane(30.0, 300.0, 6)
    table = coefficients(terrain, constant=GRAVITY * 0.25)
    arriving = 2 * GRAVITY * 0.25 * 110.0
    height = arriving / (2 * GRAVITY)
    sensors = [("point", 110.0, 110.0), ("point", 200.0, 200.0), ("span", 90.0, 110.0), ("runout", 0.0, 0.0)]
    stopped = read_front(terrain, table, 0.0, sensors, barriers=[(110.0, height * 1.0001, 0.0)])
    assert_allclose(stopped[[0, 1, 3]], [math.sqrt(arriving), 0.0, 110.0], rtol=1e-13)
    assert stopped[2] > 0
    passed = read_front(terrain, table, 0.0, sensors, barriers=[(110.0, height * 0.9999, 30.0)])
    after = arriving - 60.0 + 2 * GRAVITY * 0.25 * 90.0
    assert_allclose(passed[[0, 1, 3]], [math.sqrt(arriving), math.sqrt(after), 300.0], rtol=1e-13)
    spent = run_front(terrain, table, 0.0, barriers=[(100.0, 0.0, 1e4)])
    assert spent.runout_s_m == 100.0 and not spent.left_track
    unmet = run_front(terrain, table, 120.0, barriers=[(110.0, 50.0, 0.0)])
    assert unmet.left_track


def test_sensors_the_front_does_not_come_to_read_zero() -> None:
    terrain = terrain_from_slope(counter_slope, 1400.0, 200)
    sensors = [("point", 5.0, 5.0), ("point", 1300.0, 1300.0), ("span", 300.0, 1300.0)]
    readings = read_front(terrain, coefficients(terrain, friction=0.4), 50.0, sensors)
    assert_allclose(readings, 0.0)
    with pytest.raises(ValueError, match="found 'radar'"):
        read_front(terrain, coefficients(terrain), 50.0, [("radar", 1.0, 2.0)])


@pytest.mark.parametrize("column", list(Column))
def test_complex_step_agrees_with_central_differences(column: Column) -> None:
    terrain = terrain_from_slope(roll_over_slope, 1400.0, 233)
    base = coefficients(
        terrain, complex, constant=0.1, linear=0.01, quadratic=1e-4, friction=0.3, weakening=0.1
    )
    sensors = [("point", 201.0, 201.0), ("span", 300.0, 391.0), ("runout", 0.0, 0.0)]

    def read(step: complex, along: Column | None) -> np.ndarray:
        table, release = base.copy(), 11.0 + step * (along is None)
        if along is not None:
            table[along] += step
        table = table if isinstance(step, complex) else table.real
        return read_front(terrain, table, release, sensors, weakening_speed=8.0, barriers=[(250.0, 2.0, 5.0)])

    exact = read(1e-30j, column).imag / 1e-30
    step = 1e-4 * base[column, 0].real
    differences = (read(step, column) - read(-step, column)) / (2 * step)
    assert np.all(exact < 0)
    assert_allclose(exact, differences, rtol=2e-6)


def test_complex_step_in_release_and_loss() -> None:
    terrain = plane(30.0, 300.0, 6)
    table = coefficients(terrain, constant=GRAVITY * 0.25)
    sensor = [("point", 200.0, 200.0)]
    speed = read_front(terrain, table, 12.0 + 1e-30j, sensor)[0]
    assert_allclose(speed.imag / 1e-30, -GRAVITY * 0.25 / speed.real, rtol=1e-12)
    speed = read_front(terrain, table, 12.0, sensor, barriers=[(110.0, 2.0, 30.0 + 1e-30j)])[0]
    assert_allclose(speed.imag / 1e-30, -1.0 / speed.real, rtol=1e-12)
