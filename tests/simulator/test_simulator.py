"""The simulator: alone, exact where there are closed forms, and equal to another integrator elsewhere."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

import skred.simulator
from skred.simulator.effects import force_row
from skred.simulator.forces import GRAVITY, Kind, acceleration
from skred.simulator.readings import PARAMETERS, Sensors, law_table, read
from skred.simulator.terrain import FAMILIES, GRID_M, Ground, draw_ground, make_ground

ALLOWED = {"arrays", "campaign", "errors", "simulator", "parallel"}
"""Of arrays only names in annotations."""


def plane(degrees: float, length_m: float = 3000.0) -> Ground:
    slope = np.full(int(length_m / GRID_M) + 1, np.radians(degrees))
    return make_ground(slope, np.zeros_like(slope), "plane", 20.0, 0.0)


def points(*s_m: float) -> Sensors:
    return Sensors(np.array(s_m), np.array(s_m))


def drop(ground: Ground, s_from: float, s_to: float) -> float:
    s = np.linspace(s_from, s_to, 20_001)
    return float(np.trapezoid(np.sin(ground.slope_rad(s)), s))


def test_campaigns_errors_and_where_machine_code_is_cached_are_all_that_is_shared() -> None:
    files = sorted(Path(skred.simulator.__file__).parent.glob("*.py"))
    assert len(files) > 10
    for file in files:
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            names = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                assert node.level == 0, f"{file}: relative import"
                names = [f"{node.module}.{alias.name}" for alias in node.names]
            rooms = {name.split(".")[1] for name in names if name.startswith("skred.")}
            assert rooms <= ALLOWED, f"{file}, line {node.lineno}: imports {rooms - ALLOWED}"
            assert not any(name.split(".")[0] == "models" for name in names)


@pytest.mark.parametrize("mu", [0.1, 0.25])
def test_dry_friction_on_a_plane(mu: float) -> None:
    a = GRAVITY * (np.sin(0.5) - mu * np.cos(0.5))
    sensors = Sensors(np.array([150.0, 600.0, 300.0]), np.array([150.0, 600.0, 700.0]))
    found = read(plane(np.degrees(0.5)), "coulomb", np.array([[mu]]), np.array([100.0]), sensors)
    speeds = np.sqrt(2 * a * (np.array([150.0, 600.0]) - 100.0))
    time = np.sqrt(2 * 600.0 / a) - np.sqrt(2 * 200.0 / a)
    assert found.values[0, :3] == pytest.approx([*speeds, 400.0 / time], rel=1e-5)


def test_drag_approaches_its_limit() -> None:
    ground, mu, drag = plane(30.0), 0.2, 3e-3
    a = GRAVITY * (np.sin(np.pi / 6) - mu * np.cos(np.pi / 6))
    found = read(ground, "voellmy", np.array([[mu, drag]]), np.array([50.0]), points(100.0, 1000.0))
    expected = np.sqrt(a / drag * (1.0 - np.exp(-2.0 * drag * np.array([50.0, 950.0]))))
    assert found.values[0, :2] == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("family", FAMILIES)
def test_energy_under_constant_retardation(family: str) -> None:
    """U^2 = 2 (g drop - b way) on any terrain, and the stop is where that vanishes."""
    ground, release = draw_ground(np.random.default_rng(3), family), 100.0
    place, stop = 0.3 * ground.length_m, 0.7 * ground.length_m
    b = GRAVITY * drop(ground, release, stop) / (stop - release)
    found = read(ground, "constant", np.array([[b]]), np.array([release]), points(place))
    expected = np.sqrt(2.0 * (GRAVITY * drop(ground, release, place) - b * (place - release)))
    assert found.values[0, 0] == pytest.approx(expected, rel=1e-5)
    assert found.values[0, 1] == pytest.approx(stop, rel=1e-5)


TERMS = {
    "none": np.zeros((0, 12)),
    "dam": force_row(Kind.DAM, 800.0, 12.0, 9.0, 0.3, 6.0)[None, :] * np.array([1, 4.0] + [1.0] * 10),
    "taking": force_row(Kind.DAM, 800.0, 12.0, 9.0, 0.0, 6.0, 0.7)[None, :] * np.array([1, 4.0] + [1.0] * 10),
    "forest": force_row(Kind.STRETCH_DRAG, 600.0, 800.0, 20.0, 1.8, 1.0)[None, :]
    * np.array([1, 2e-3] + [1.0] * 10),
    "two": np.array(
        [
            force_row(Kind.WAVE, 300.0, 1.0) * np.array([1, 0.5] + [1.0] * 10),
            force_row(Kind.EROSION, 500.0, 900.0, 25.0, 9.0, 2.5) * np.array([1, 1e-3] + [1.0] * 10),
        ]
    ),
}


@pytest.mark.parametrize("terms", TERMS)
@pytest.mark.parametrize("base", PARAMETERS)
def test_another_integrator_agrees(base: str, terms: str) -> None:
    ground = draw_ground(np.random.default_rng(11), "ryggfonn_like")
    typical = {"pcm": [0.25, 2e-3], "coulomb": [0.45], "constant": [4.0], "voellmy": [0.25, 2.5e-3]}
    parameters, release = np.array([typical[base]]), 100.0
    law, rows = law_table(base, parameters)[0], TERMS[terms]

    def motion(t: float, y: np.ndarray) -> list[float]:
        return [y[1], acceleration(y[0], y[1], t, release, ground.table, GRID_M, law, rows)]

    def stopped(t: float, y: np.ndarray) -> float:
        return float(y[1]) if t > 0.1 else 1.0

    stopped.terminal = True  # type: ignore[attr-defined]
    solution = solve_ivp(
        motion, (0.0, 900.0), [release, 0.0], "DOP853", events=stopped, rtol=1e-10, atol=1e-9, max_step=0.2
    )
    s, u, t = solution.y[0], solution.y[1], solution.t
    sensors = Sensors(np.array([400.0, 700.0]), np.array([400.0, 950.0]))
    found = read(ground, base, parameters, np.array([release]), sensors, rows[None])
    time = CubicSpline(s[1:-1], t[1:-1])
    assert found.values[0, 2] == pytest.approx(s[-1], rel=1e-5)
    assert found.values[0, 0] == pytest.approx(float(CubicSpline(s, u)(400.0)), rel=1e-4)
    if s[-1] > 960.0:
        assert found.values[0, 1] == pytest.approx(250.0 / float(time(950.0) - time(700.0)), rel=1e-4)


def test_acceleration_against_its_equation() -> None:
    ground = draw_ground(np.random.default_rng(5), "stepped")
    s, u, h = 432.1, 31.0, 0.01
    slope = ground.slope_rad(np.array([s - h, s, s + h]))
    curvature = -(slope[2] - slope[0]) / (2 * h)
    normal = GRAVITY * np.cos(slope[1]) + curvature * u**2
    expected = GRAVITY * np.sin(slope[1]) - 0.3 * normal - 2e-3 * u**2
    law = law_table("pcm", np.array([[0.3, 2e-3]]))[0]
    found = acceleration(s, u, 0.0, 0.0, ground.table, GRID_M, law, TERMS["none"])
    assert found == pytest.approx(expected, abs=1e-6)


def over_a_dam(height: float, loss: float, taken: float) -> tuple[np.ndarray, np.ndarray]:
    """U^2 before and after of what passes a dam on level ground without friction; v < 2 g h stops."""
    place = 900.0
    row = force_row(Kind.DAM, place, 12.0, 9.0, loss, 6.0, taken)
    row[1] = height
    slope = np.radians(np.where(np.arange(601) * GRID_M < 300.0, 30.0, 0.0))
    ground = make_ground(slope, np.zeros(601), "ramp", 20.0, 0.0)
    releases = np.linspace(280.0, 297.0, 15)
    found = read(
        ground, "constant", np.zeros((15, 1)), releases, points(500.0, 1500.0), np.tile(row, (15, 1, 1))
    )
    before, after, runout = found.values.T
    assert np.all(runout[before**2 < 2.0 * GRAVITY * height] < place)
    passed = runout > place
    assert passed.any() and not passed.all()
    return before[passed] ** 2, after[passed] ** 2


def test_what_passes_a_dam_keeps_its_share_of_v() -> None:
    height, loss = 5.0, 0.3
    before, after = over_a_dam(height, loss, 0.0)
    kept = np.exp(-2.0 * loss * np.tanh(height / 6.0))
    assert np.all(before - after < (1.0 - kept) * before)
    assert np.all(before - after > 0.8 * (1.0 - kept) * (before - 2.0 * GRAVITY * height))


def test_a_dam_takes_its_share_of_the_climb() -> None:
    """v of all that passes drops by as much."""
    height, taken = 5.0, 0.6
    before, after = over_a_dam(height, 0.0, taken)
    np.testing.assert_allclose(before - after, 2.0 * taken * GRAVITY * height, rtol=0.01)


def test_a_front_that_cannot_start_stays() -> None:
    found = read(plane(20.0), "coulomb", np.array([[0.5]]), np.array([100.0]), points(200.0))
    assert found.values[0].tolist() == [0.0, 100.0]
    assert not found.reached[0, 0]


def test_places_on_the_polyline() -> None:
    ground = draw_ground(np.random.default_rng(2), "short_and_steep")
    s = np.array([0.0, 123.4, 600.0])
    assert ground.from_campaign(ground.to_campaign(s)) == pytest.approx(s, abs=1e-6)
    steps = np.hypot(np.diff(ground.track_x_m), np.diff(ground.track_z_m))
    assert ground.polyline_s_m[-1] == pytest.approx(steps.sum())
    assert abs(ground.polyline_s_m[-1] - ground.length_m) < 1.0
