"""The forward map as an Op: gradients, backends, shapes, pickling, and inputs that must be refused."""

from __future__ import annotations

import multiprocessing
import pickle

import numpy as np
import pytensor
import pytensor.tensor as pt
import pytest
from numpy.testing import assert_allclose
from pytensor.gradient import verify_grad

from skred.campaign import find_campaign, read_campaign
from skred.inference.pooled.forward_op import FrontReadings, FrontReadingsJacobian, front_readings
from skred.physics.geometry import contributions_of, path_of, sensor_table
from skred.physics.kernel.fronts import simulate
from skred.physics.mechanisms import mechanisms
from skred.physics.reference import read_front
from skred.physics.terrain import build_terrain

TRACK = read_campaign(find_campaign("ryggfonn")).track
TERRAIN = build_terrain(TRACK.x_m, TRACK.z_m)
PATH = path_of(TERRAIN)
PCM = contributions_of([mechanisms()[name] for name in ("coulomb_friction", "turbulent_drag")], TERRAIN)
SENSORS = sensor_table([(1650.0, 1650.0), (1810.0, 1910.0), None])
# Stops below the last sensor, stops between sensors, leaves the track, never starts (the release far down).
STRENGTHS = np.array([[0.26, 2.9e-3], [0.3, 3.3e-3], [0.05, 1e-3], [0.9, 1e-3]])
RELEASES = np.array([3.3, 100.0, 17.0, 2200.0])


def readings_of(strengths: np.ndarray, releases: np.ndarray) -> np.ndarray:
    return simulate(strengths, releases, PATH, PCM, SENSORS)


def compiled(mode: str = "NUMBA") -> pytensor.compile.Function:
    strengths, releases = pt.dmatrix("strengths"), pt.dvector("releases")
    readings = front_readings(strengths, releases, PATH, PCM, SENSORS)
    weights = np.arange(1.0, 4.0)
    gradients = pytensor.grad((readings * weights).sum(), [strengths, releases])
    return pytensor.function([strengths, releases], [readings, *gradients], mode=mode)


@pytest.mark.parametrize("mode", ["NUMBA", "FAST_COMPILE"])
def test_value_and_gradient_agree_with_the_reference(mode: str) -> None:
    """The complex step of the plain reference is the second route."""
    readings, by_strength, by_release = compiled(mode)(STRENGTHS, RELEASES)
    assert_allclose(readings, readings_of(STRENGTHS, RELEASES), rtol=1e-14)
    assert readings[0, 2] < TERRAIN.length_m == readings[2, 2] and readings[3, 2] == RELEASES[3]
    sensors = [("point", 1650.0, 1650.0), ("span", 1810.0, 1910.0), ("runout", 0.0, 0.0)]
    for run, (strengths, release) in enumerate(zip(STRENGTHS, RELEASES, strict=True)):
        for k in range(3):
            step = 1e-40j * (np.arange(3) == k)
            table = np.zeros((5, TERRAIN.n_cells), dtype=complex)
            table[3], table[2] = strengths[0] + step[0], strengths[1] + step[1]
            derivative = read_front(TERRAIN, table, release + step[2], sensors).imag / 1e-40
            found = by_strength[run, k] if k < 2 else by_release[run]
            assert_allclose(found, derivative @ [1.0, 2.0, 3.0], rtol=1e-9, atol=1e-12)


def test_gradients_of_fronts_that_are_released_with_a_speed() -> None:
    speeds = np.array([0.0, 21.0, 9.0, 14.0])
    strengths, releases = pt.dmatrix("strengths"), pt.dvector("releases")
    readings = front_readings(strengths, releases, PATH, PCM, SENSORS, speeds)
    gradients = pytensor.grad(readings.sum(), [strengths, releases])
    function = pytensor.function([strengths, releases], [readings, *gradients], mode="FAST_COMPILE")
    found, by_strength, by_release = function(STRENGTHS, RELEASES)
    assert_allclose(found, simulate(STRENGTHS, RELEASES, PATH, PCM, SENSORS, speeds), rtol=1e-14)
    assert found[3, 2] > RELEASES[3] + 1.0, "friction holds it at rest, not in motion"
    sensors = [("point", 1650.0, 1650.0), ("span", 1810.0, 1910.0), ("runout", 0.0, 0.0)]
    for run, speed in enumerate(speeds):
        for k in range(3):
            step = 1e-40j * (np.arange(3) == k)
            table = np.zeros((5, TERRAIN.n_cells), dtype=complex)
            table[3], table[2] = STRENGTHS[run] + step[:2]
            front = read_front(TERRAIN, table, RELEASES[run] + step[2], sensors, release_speed=speed)
            one = by_strength[run, k] if k < 2 else by_release[run]
            assert_allclose(one, front.imag.sum() / 1e-40, rtol=1e-9, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("run", [0, 2])
def test_verify_grad(run: int) -> None:
    def scaled(strengths: pt.TensorVariable, releases: pt.TensorVariable) -> pt.TensorVariable:
        # Of order one in all directions, as finite differences need it.
        return front_readings(strengths * [0.1, 1e-3], releases * 10.0, PATH, PCM, SENSORS) / 100.0

    point = [STRENGTHS[[run]] / [0.1, 1e-3], RELEASES[[run]] / 10.0]
    verify_grad(scaled, point, rng=np.random.default_rng(1), eps=1e-5, mode="FAST_COMPILE")


def test_numba_and_python_give_the_same() -> None:
    for one, other in zip(
        compiled("NUMBA")(STRENGTHS, RELEASES), compiled("FAST_COMPILE")(STRENGTHS, RELEASES), strict=True
    ):
        assert_allclose(one, other, rtol=1e-14)


def test_ops_of_a_class_are_equal() -> None:
    assert FrontReadings() == FrontReadings() and hash(FrontReadings()) == hash(FrontReadings())
    assert FrontReadings() != FrontReadingsJacobian()
    assert pickle.loads(pickle.dumps(FrontReadings())) == FrontReadings()


def evaluate(pickled: bytes) -> np.ndarray:
    """Runs in a process of its own."""
    return pickle.loads(pickled).eval()


@pytest.mark.slow
def test_a_node_travels_to_another_process() -> None:
    node = front_readings(STRENGTHS, RELEASES, PATH, PCM, SENSORS)
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        there = pool.apply(evaluate, (pickle.dumps(node),))
    np.testing.assert_array_equal(there, node.eval())


@pytest.mark.slow
def test_shapes_are_known_without_evaluating() -> None:
    strengths, releases = pt.dmatrix("strengths"), pt.dvector("releases")
    node = front_readings(strengths, releases, PATH, PCM, SENSORS)
    assert node.type.shape == (None, 3)
    assert front_readings(STRENGTHS, RELEASES, PATH, PCM, SENSORS).type.shape == (4, 3)
    shape = pytensor.function([strengths, releases], node.shape, on_unused_input="ignore")
    assert tuple(shape(STRENGTHS, RELEASES)) == (4, 3)
    applied = [apply.op for apply in shape.maker.fgraph.apply_nodes]
    assert not any(isinstance(op, FrontReadings) for op in applied)
    jacobian = FrontReadingsJacobian()(*node.owner.inputs)
    assert jacobian.type.shape == (None, 3, None)
    assert jacobian.eval({strengths: STRENGTHS, releases: RELEASES}).shape == (4, 3, 3)


def test_whole_numbers_become_real_ones() -> None:
    node = front_readings(np.zeros((1, 2), dtype=np.int64), np.zeros(1), PATH, PCM, SENSORS)
    assert node.type.dtype == "float64"


def test_wrong_inputs_are_named() -> None:
    with pytest.raises(TypeError, match="strengths: expected 2 dimensions, found 1"):
        front_readings(STRENGTHS[0], RELEASES, PATH, PCM, SENSORS)
    with pytest.raises(TypeError, match="releases: expected 1 dimensions, found 0"):
        front_readings(STRENGTHS, 0.0, PATH, PCM, SENSORS)
    with pytest.raises(TypeError, match="columns: expected int64, found float64"):
        front_readings(STRENGTHS, RELEASES, PATH, PCM._replace(columns=np.array([3.0, 2.0])), SENSORS)
    with pytest.raises(TypeError, match="sensors: expected 2 dimensions, found 1"):
        front_readings(STRENGTHS, RELEASES, PATH, PCM, SENSORS[0])
    with pytest.raises(TypeError, match="expected 12 inputs, found 1"):
        FrontReadings()(STRENGTHS)


def test_releases_at_and_off_the_ends_of_the_track() -> None:
    """Off the track a front is where the nearest end is, or stays where it is: never a crash."""
    length = TERRAIN.length_m
    strengths, releases = np.tile(STRENGTHS[0], (4, 1)), np.array([0.0, length, -50.0, length + 50.0])
    values = compiled()(strengths, releases)
    assert all(np.all(np.isfinite(value)) for value in values)
    assert values[0][1, 2] == length and np.all(values[0][1, :2] == 0.0)
