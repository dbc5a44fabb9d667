"""Fall lines against closed forms, and against an integrator that shares nothing with them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from map_cases import EAST, NORTH, bowl, plane, write_dem, write_line
from scipy.integrate import solve_ivp

from skred.tracks.build import Wanted, make_track
from skred.tracks.elevations import open_elevations
from skred.tracks.fall_line import FallLine, fall_line, turn_notice
from skred.tracks.plan import Plan
from skred.tracks.statement import track_statement


def from_dem(dem: Path, x: float, y: float, length: float) -> FallLine:
    """The fall line on a terrain model, its places as distances from the corner."""
    with open_elevations(dem) as elevations:
        line = fall_line(elevations, EAST + x, NORTH + y, length, elevations.cell_m)
    return FallLine(Plan(line.plan.x - EAST, line.plan.y - NORTH), line.stopped)


def test_on_a_plane_it_is_straight(tmp_path: Path) -> None:
    line = from_dem(write_dem(tmp_path / "dem.tif", plane), 103.0, 204.0, 333.0)
    x, y, along = line.plan.x - 103.0, line.plan.y - 204.0, line.plan.along
    assert line.stopped is None and along[-1] == pytest.approx(333.0, abs=1e-6)
    np.testing.assert_allclose(x, along * 2 / math.sqrt(5), atol=1e-6)
    np.testing.assert_allclose(y, along / math.sqrt(5), atol=1e-6)


def test_on_a_bowl_it_is_a_parabola(tmp_path: Path) -> None:
    """dx/dt = -2 a x and dy/dt = -4 a y: y is in proportion to x squared."""
    line = from_dem(write_dem(tmp_path / "dem.tif", bowl), 120.0, 250.0, 420.0)
    x, y = line.plan.x - 500.0, line.plan.y - 500.0
    np.testing.assert_allclose(y, -250.0 * (x / 380.0) ** 2, atol=0.01)
    assert line.plan.length == pytest.approx(420.0, abs=1e-6)


def test_on_a_bowl_it_is_as_an_ode_solver_has_it(tmp_path: Path) -> None:
    """The place after each length, by the steepest direction of the formula itself."""
    line = from_dem(write_dem(tmp_path / "dem.tif", bowl), 900.0, 850.0, 400.0)

    def direction(_: float, at: np.ndarray) -> np.ndarray:
        slope = np.array([2e-3 * (at[0] - 500.0), 4e-3 * (at[1] - 500.0)])
        return -slope / np.hypot(*slope)

    wanted = solve_ivp(
        direction, (0.0, 400.0), [900.0, 850.0], rtol=1e-10, atol=1e-8, t_eval=line.plan.along[:-1]
    ).y
    np.testing.assert_allclose(np.array([line.plan.x, line.plan.y])[:, :-1], wanted, atol=0.02)


def test_the_midpoint_rule_is_of_second_order() -> None:
    """Half the step, a quarter of the error, on the surface without a raster."""

    class Bowl:
        def heights(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
            return bowl(x, y)

        def gradient(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            return 2e-3 * (x - 500.0), 4e-3 * (y - 500.0)

    errors = []
    for cell in (80.0, 40.0, 20.0):
        plan = fall_line(Bowl(), 120.0, 250.0, 400.0, cell).plan
        errors.append(abs(plan.y[-1] - 500.0 + 250.0 * ((plan.x[-1] - 500.0) / 380.0) ** 2))
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.3)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.3)


def test_it_ends_in_a_pit(tmp_path: Path) -> None:
    line = from_dem(write_dem(tmp_path / "dem.tif", bowl), 120.0, 250.0, 2000.0)
    assert math.hypot(line.plan.x[-1] - 500.0, line.plan.y[-1] - 500.0) < 2.5
    assert line.stopped is not None and ("a pit at (4004" in line.stopped or "flat ground" in line.stopped)


def test_it_ends_before_a_hole_and_at_the_edge(tmp_path: Path) -> None:
    holes = [(row, 60) for row in range(100)]
    hole = from_dem(write_dem(tmp_path / "hole.tif", plane, holes=holes), 503.0, 504.0, 500.0)
    edge = from_dem(write_dem(tmp_path / "edge.tif", plane), 903.0, 504.0, 500.0)
    for line, least, most in ((hole, 580.0, 595.0), (edge, 980.0, 995.0)):
        assert line.stopped is not None and line.stopped.startswith("no data beyond at (400")
        assert least <= line.plan.x[-1] <= most


def test_flat_ground_leads_nowhere(tmp_path: Path) -> None:
    line = from_dem(write_dem(tmp_path / "dem.tif", lambda x, y: 700.0 + 0 * x * y), 503.0, 504.0, 500.0)
    assert (
        line.plan.length == 0.0
        and line.stopped == "flat ground at (400503.0, 5200504.0), 700.0 m above sea level"
    )


def test_a_zigzag_does_not_lengthen_a_gully(tmp_path: Path) -> None:
    """A steep V whose bottom falls by 10 %, crosswise to the cells: hardly longer than the bottom is."""

    def gully(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return 1500.0 - 0.1 * (x + y) / math.sqrt(2) + np.abs(x - y)

    line = from_dem(write_dem(tmp_path / "dem.tif", gully), 200.0, 200.0, 500.0)
    straight = math.hypot(line.plan.x[-1] - 200.0, line.plan.y[-1] - 200.0)
    assert line.stopped is None and straight > 0.97 * 500.0


def test_a_track_is_extended(tmp_path: Path) -> None:
    """Fall and place of the extension are those of the plane."""
    dem = write_dem(tmp_path / "dem.tif", plane)
    line = write_line(tmp_path / "line.gpkg", [(100.0, 100.0), (400.0, 250.0)])
    made = make_track(Wanted(dem, line, extend_m=200.0, smoothing_m=0.0))
    drawn, slope = math.hypot(300.0, 150.0), math.hypot(0.5, 0.25)
    assert made["smoothing"]["written"]["fall_m"] == pytest.approx(slope * (drawn + 200.0), abs=0.01)
    extension = made["extension"]
    assert extension["s_from_m"] == pytest.approx(drawn * math.hypot(1.0, slope), abs=0.01)
    assert extension["s_to_m"] == pytest.approx((drawn + 200.0) * math.hypot(1.0, slope), abs=0.01)
    assert extension["stopped"] is None and made["notices"] == []
    assert "Extended along the fall line by 200 m: s = 384 to 613 m." in track_statement(made)


def test_an_extension_that_stops_says_why(tmp_path: Path) -> None:
    dem = write_dem(tmp_path / "dem.tif", plane)
    line = write_line(tmp_path / "line.gpkg", [(100.0, 100.0), (900.0, 500.0)])
    made = make_track(Wanted(dem, line, extend_m=2000.0))
    (sentence,) = [one for one in track_statement(made) if one.startswith("Extended")]
    assert " of 2000 m, s = " in sentence and "stopped: no data beyond at (4009" in sentence


def test_a_sharp_turn_is_told() -> None:
    line = Plan(np.array([0.0, 100.0]), np.zeros(2))
    ahead, aside = (
        Plan(np.array([100.0, 200.0]), np.array([0.0, 30.0])),
        Plan(np.full(2, 100.0), np.array([0, 80.0])),
    )
    assert turn_notice(line, ahead, 5.0) == []
    (notice,) = turn_notice(line, aside, 5.0)
    assert notice.startswith("the fall line leaves the end of the line at 90 degrees")
