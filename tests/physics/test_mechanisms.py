"""Every mechanism of the library: a complete spec, shapes, a retardation, and exact tangents where added."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import skred.physics.mechanisms
from skred.campaign import find_campaign, read_campaign
from skred.diagnosis.discrepancy.profile import KINDS
from skred.diagnosis.evidence.extension import Extension, extended, setting_of
from skred.inference.hierarchical.problem import HierarchicalProblem, hierarchical_problem
from skred.physics.geometry import contributions_of, path_of
from skred.physics.kernel.columns import GRAVITY, Column
from skred.physics.kernel.fronts import front_speeds
from skred.physics.kernel.inputs import make_contributions
from skred.physics.law import Law
from skred.physics.laws import check_library, law_ids, load_law
from skred.physics.mechanisms import Mechanism, mechanisms
from skred.physics.mechanisms.coulomb_friction import WITHOUT_CURVATURE
from skred.physics.mechanisms.entrainment import GROWTH
from skred.physics.mechanisms.library import NOT_MECHANISMS
from skred.physics.mechanisms.obstacle import LOSS, TAKEN
from skred.physics.mechanisms.placed import shapes_of
from skred.physics.mechanisms.spec import Added, BoundTo, Direction, Group, Setting, Shape
from skred.physics.mechanisms.stretches import OPPOSED_SHARE, U_1, ends_of, equation_of, is_opposed, shares
from skred.physics.terrain import Terrain

ALL = mechanisms()
FOLDER = Path(skred.physics.mechanisms.__file__).parent
IN_THE_FORMAT = {
    "coulomb_friction", "centrifugal", "turbulent_drag", "viscous_drag", "constant_retardation",
    "velocity_weakening", "obstacle", "segment_drag", "segment_friction", "entrainment",
    "covariate_friction", "sensor_bias", "release_offset", "sensor_place",
}  # fmt: skip
IN_A_LAW = {name: one for name, one in ALL.items() if one.column is not None}
ONLY_ADDED = {name: one for name, one in ALL.items() if one.column is None}
ONE_SIGN = {
    name: one
    for name, one in ALL.items()
    if one.group is Group.PHYSICS and one.added is not None and not one.added.either_sign
}
WHERE = {"pcm": (-1.14, -6.07), "voellmy": (-1.3, -6.07), "constant": (1.536,)}
"""Logarithms of the strengths of base laws, roughly as on Ryggfonn."""


def added_to(mechanism: Mechanism) -> Added:
    assert mechanism.added is not None, f"{mechanism.id} cannot be added to a law"
    return mechanism.added


def base_of(mechanism: Mechanism) -> Law:
    """A law that it may be missing from."""
    laws = [load_law(name) for name in WHERE]
    return next(law for law in laws if added_to(mechanism).joins(ids_of(law)))


def ids_of(law: Law) -> tuple[str, ...]:
    return tuple(part.id for part in law.mechanisms)


def some(shapes: Sequence[Shape], most: int = 12) -> list[Shape]:
    """Some of many shapes, from all parts of the list."""
    return [shapes[k] for k in np.unique(np.linspace(0, len(shapes) - 1, most).astype(int))]


@pytest.fixture(scope="module")
def problem() -> HierarchicalProblem:
    """Ryggfonn with releases that can move both ways: at the end of the track they cannot."""
    campaign = read_campaign(find_campaign("ryggfonn"))
    events = tuple(replace(event, release_s_m=60.0, release_sd_m=15.0) for event in campaign.events)
    return hierarchical_problem(replace(campaign, events=events))


@pytest.fixture(scope="module")
def concave() -> Terrain:
    """From 40 to 6 degrees at a constant rate: a positive curvature throughout."""
    edge = np.linspace(0.0, 2000.0, 401)
    phi = np.interp(0.5 * (edge[1:] + edge[:-1]), [0.0, 2000.0], [0.7, 0.1])
    return Terrain(edge, np.sin(phi), np.cos(phi), np.full(400, 0.6 / 2000.0))


@pytest.fixture(scope="module")
def settings(problem: HierarchicalProblem, concave: Terrain) -> list[Setting]:
    """Ryggfonn, and recordings along the whole of a track, up to both its ends."""
    edges = problem.terrain.edge_s_m
    own = setting_of(problem, load_law("pcm"), np.where(edges < 2000.0, 25.0 - 0.005 * edges, 0.0))
    fronts = typical_fronts(concave)
    whole = replace(own, terrain=concave, recorded_m=(0.0, concave.length_m), front_speed=fronts)
    return [own, whole]


def typical_fronts(terrain: Terrain) -> np.ndarray:
    """Speed of one front under constant retardation, from the top."""
    law = contributions_of([ALL["constant_retardation"]], terrain)
    return front_speeds(np.array([[0.5]]), np.zeros(1), path_of(terrain), law)[0]


def test_a_mechanism_is_found_by_its_file() -> None:
    assert set(ALL) == {file.stem for file in FOLDER.glob("*.py")} - {"__init__", *NOT_MECHANISMS}


def test_all_of_the_format_are_there() -> None:
    assert set(ALL) == IN_THE_FORMAT
    assert {one.id for one in ALL.values() if one.group is Group.INSTRUMENT} == {
        "sensor_bias", "release_offset", "sensor_place"
    }  # fmt: skip


def test_coefficients_have_names_and_symbols_of_their_own() -> None:
    for what in ("name", "symbol"):
        assert len({getattr(mechanism.strength, what) for mechanism in ALL.values()}) == len(ALL)


def test_laws_and_the_mechanisms_that_join_them_have_symbols_of_their_own() -> None:
    for name in law_ids():
        check_library(load_law(name))


@pytest.mark.parametrize("mechanism", ALL.values(), ids=ALL)
def test_shapes_name_what_it_is_bound_to(mechanism: Mechanism, settings: list[Setting]) -> None:
    for setting in settings:
        for shape in shapes_of(mechanism, setting):  # refuses those that do not
            named = {
                BoundTo.PLACE: shape.place_m,
                BoundTo.SENSOR: shape.sensor,
                BoundTo.COVARIATE: shape.covariate,
            }
            assert {key for key, value in named.items() if value is not None} == {
                added_to(mechanism).bound_to
            } - {BoundTo.TRACK}


@pytest.mark.parametrize("mechanism", ALL.values(), ids=ALL)
def test_the_spec_is_complete(mechanism: Mechanism) -> None:
    strength, added = mechanism.strength, added_to(mechanism)
    for text in (
        mechanism.title, mechanism.equation, mechanism.signature, mechanism.reference,
        strength.name, strength.symbol, strength.unit, strength.prior_reason, added.reason,
    ):  # fmt: skip
        assert text.strip() == text != ""
    assert re.fullmatch(r"10\.\d{4,}/\S+", mechanism.doi)
    assert re.fullmatch(r"1|(m|s)(-?\d)?( (m|s)(-?\d)?)*", strength.unit)
    for scale in (strength.prior_scale, added.scale, added.relevant):
        assert np.isfinite(scale) and scale > 0
    assert re.search(rf"(?<!\w){re.escape(strength.symbol)}(?!\w)", mechanism.equation)
    if mechanism.group is Group.PHYSICS:
        assert mechanism.equation.startswith("-")
    if mechanism.same_term_as:
        assert mechanism.same_term_as in set(ALL) - {mechanism.id}


@pytest.mark.parametrize("mechanism", ALL.values(), ids=ALL)
def test_where_it_can_be_missing(mechanism: Mechanism) -> None:
    joins = added_to(mechanism).joins
    assert any(joins(ids_of(load_law(name))) for name in law_ids())
    if mechanism.column is not None:  # it is everywhere already where the law has it
        assert not joins((mechanism.id,))


def test_parts_of_dry_friction() -> None:
    """Friction without curvature lacks the curvature part, not friction; friction with it lacks neither."""
    friction, centrifugal = added_to(ALL["coulomb_friction"]), added_to(ALL["centrifugal"])
    for base, lacks in (((WITHOUT_CURVATURE.id,), True), (("coulomb_friction",), False)):
        assert centrifugal.joins(base) is lacks
        assert not friction.joins(base)


@pytest.mark.parametrize("mechanism", ONLY_ADDED.values(), ids=ONLY_ADDED)
def test_what_can_only_be_added_is_no_part_of_a_law(mechanism: Mechanism, concave: Terrain) -> None:
    assert mechanism.profile is None
    with pytest.raises(ValueError, match=mechanism.id):
        mechanism.term(concave)
    added = added_to(mechanism)  # one prior, said twice
    assert (mechanism.strength.prior_scale, mechanism.strength.prior_reason) == (added.scale, added.reason)


@pytest.mark.parametrize("mechanism", IN_A_LAW.values(), ids=IN_A_LAW)
def test_the_profile_has_one_value_per_cell(mechanism: Mechanism, settings: list[Setting]) -> None:
    for setting in settings:
        column, profile = mechanism.term(setting.terrain)
        assert isinstance(column, Column)
        assert profile.shape == (setting.terrain.n_cells,)
        assert np.all(np.isfinite(profile)) and np.any(profile)


@pytest.mark.parametrize("mechanism", IN_A_LAW.values(), ids=IN_A_LAW)
def test_a_positive_strength_retards_as_a_part_of_a_law(mechanism: Mechanism, concave: Terrain) -> None:
    law = contributions_of([ALL["constant_retardation"], mechanism], concave)
    little = 0.1 * mechanism.strength.prior_scale
    strengths = np.array([[0.5, 0.0], [0.5, little], [0.5, 2 * little]])
    without, with_it, with_more = front_speeds(strengths, np.zeros(3), path_of(concave), law)
    moving = (without > 0) & (np.arange(len(without)) > 2)
    assert np.all(with_it[moving] < without[moving])
    assert np.all(with_more[moving] <= with_it[moving])


@pytest.mark.parametrize("mechanism", ONE_SIGN.values(), ids=ONE_SIGN)
def test_a_positive_strength_retards_when_added(mechanism: Mechanism, settings: list[Setting]) -> None:
    """Never a faster front than without it, as fast above it, slower below: on a concave track."""
    setting, added = settings[1], added_to(mechanism)
    edge = setting.terrain.edge_s_m
    plain = [shape for shape in added.shapes(setting) if not is_opposed(shape)]
    for shape in some(plain):
        direction = added.direction(setting, shape)
        sizes = added.scale * np.array([0.0, 0.25, 0.5])
        without, with_it, with_more = with_added(setting, direction, np.full(3, 0.5), sizes)
        assert without[-1] > 0
        assert np.all(with_it <= without * (1 + 1e-12)) and np.all(with_more <= with_it * (1 + 1e-12))
        above = 0.0 if shape.s_from_m is None else shape.s_from_m
        below = 15.0 if shape.s_to_m is None else shape.s_to_m
        np.testing.assert_array_equal(with_it[edge <= above], without[edge <= above])
        assert np.all(with_it[edge >= below] < without[edge >= below])


def with_added(setting: Setting, direction: Direction, b: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Front speeds under constant retardation b [m s-2] with something added."""
    contributions = make_contributions(
        np.array([Column.CONSTANT, *direction.columns], dtype=np.int64),
        np.vstack([np.ones((1, setting.terrain.n_cells)), direction.profiles]),
        direction.weakening_speed or 8.0,
    )
    strengths = np.column_stack([b, *[sizes] * len(direction.columns)])
    return front_speeds(strengths, np.zeros(len(b)), path_of(setting.terrain), contributions)


def test_entrainment_of_a_limited_supply(settings: list[Setting]) -> None:
    """Every metre adds as much mass: momentum is kept, so U falls as 1 over the mass, to a half."""
    setting, added = settings[1], added_to(ALL["entrainment"])
    own = [one for one in added.shapes(setting) if GROWTH in dict(one.constants)]
    twin = added_to(ALL["segment_drag"]).shapes(setting)
    assert own and not set(own) & set(twin)  # the other shapes are computed under that id
    for shape in some(own, 6):
        first, last = ends_of(shape)
        direction = added.direction(setting, shape)
        edge = setting.terrain.edge_s_m
        # dU/ds = -(1/m)(dm/ds) U, and all that is lost on a stretch is the integral of (dm/ds)/m.
        mass = 1.0 + np.clip((edge - first) / (last - first), 0.0, 1.0)
        lost = np.cumsum(direction.profiles[0] * np.diff(edge)) / (last - first)
        np.testing.assert_allclose(
            lost, np.log(mass[1:]), atol=2e-3 + (np.diff(edge).max() / (last - first)) ** 2
        )
        parts = added.split(setting, shape, 1.0)
        assert parts and all(part.constants == shape.constants for part in parts)


def test_the_equation_of_an_obstacle_is_that_of_its_shape() -> None:
    place = {"s_from_m": 100.0, "s_to_m": 150.0}
    share, same = (
        equation_of(ALL["obstacle"], Shape(**place, constants=(one,)))
        for one in ((LOSS, 0.006), (TAKEN, 1.0))
    )
    assert "descent" in share and "l h" in share and "J" not in share
    assert "descent" not in same and "l h" not in same and "J = g h" in same
    assert "U^2 < 2 g h stops" in share and "U^2 < 2 g h stops" in same


def test_what_passing_an_obstacle_costs(settings: list[Setting]) -> None:
    """v < 2 g h at the crown stops; one that passes loses a share of v, or the same v as all others."""
    setting, added = settings[1], added_to(ALL["obstacle"])
    edge, b, h, loss = setting.terrain.edge_s_m, np.array([0.2, 0.5, 1.0]), 6.0, 0.025
    shapes = added.shapes(setting)
    ways = {name: [one for one in shapes if name in dict(one.constants)] for name in (LOSS, TAKEN)}
    assert len(ways[LOSS]) == 2 * len(ways[TAKEN]) > 0
    for shape in some(ways[TAKEN], 6):
        first, last = ends_of(shape)
        v, kept = (
            with_added(setting, added.direction(setting, shape), b, size) ** 2
            for size in np.array([[0.0] * 3, [h] * 3])
        )
        crown = edge >= 0.5 * (first + last) + np.diff(edge).max()
        np.testing.assert_allclose(kept[:, crown], v[:, crown] - 2.0 * GRAVITY * h, rtol=1e-9)
        too_high = 1.01 * v[:, crown][:, 0] / (2.0 * GRAVITY)
        stopped = with_added(setting, added.direction(setting, shape), b, too_high)
        assert np.all(stopped[:, edge >= last] == 0.0)
        other = replace(shape, constants=((LOSS, loss),))
        below = np.searchsorted(edge, last + np.diff(edge).max())
        drop = (v - with_added(setting, added.direction(setting, other), b, np.full(3, h)) ** 2)[:, below]
        share, at_foot = 1.0 - np.exp(-loss * h), v[:, np.searchsorted(edge, first)]
        assert np.all(drop < share * np.maximum(at_foot, v[:, below]))
        assert np.all(drop > share * (np.minimum(at_foot, v[:, below]) - 2.0 * GRAVITY * h))


@pytest.mark.parametrize("name", ["segment_drag", "entrainment"])
def test_what_is_opposed_does_not_show_in_a_typical_front(name: str, settings: list[Setting]) -> None:
    """Below the stretch a typical front is as fast as without it; drag brings others closer."""
    setting, added = settings[1], added_to(ALL[name])
    opposed = [shape for shape in added.shapes(setting) if is_opposed(shape)]
    assert opposed
    for shape in some(opposed, 6):
        direction = added.direction(setting, shape)
        assert "U_0" in equation_of(ALL[name], shape)
        b = np.array([0.5, 0.0, 1.0])
        without = with_added(setting, direction, b, np.zeros(3))
        with_it = with_added(setting, direction, b, np.full(3, added.scale))
        below = setting.terrain.edge_s_m >= (shape.s_to_m or 0.0)
        change = np.log(with_it[:, below] / without[:, below])[:, 0]
        faster, slower = -change[1], change[2]
        assert abs(change[0]) < 0.02 and faster > 5 * abs(change[0]) and slower > 5 * abs(change[0])


def test_opposed_shapes_have_a_share_of_their_own(settings: list[Setting]) -> None:
    """As the opposed kinds of the unlisted force do."""
    shapes = added_to(ALL["segment_drag"]).shapes(settings[1])
    opposed = np.array([is_opposed(shape) for shape in shapes])
    found = shares(shapes)
    assert found.sum() == pytest.approx(1.0) and found[opposed].sum() == pytest.approx(OPPOSED_SHARE)
    assert sum(kind.share for kind in KINDS if kind.opposed) == pytest.approx(OPPOSED_SHARE)
    for some_of in (~opposed, opposed):
        chosen = [shape for shape, one in zip(shapes, some_of, strict=True) if one]
        assert shares(chosen).sum() == pytest.approx(1.0)
    assert not any(is_opposed(shape) for shape in added_to(ALL["segment_friction"]).shapes(settings[1]))


@pytest.mark.parametrize("name", ["segment_drag", "segment_friction", "entrainment"])
def test_every_stretch_ends_in_the_recorded_part_and_each_length_is_as_probable(
    settings: list[Setting], name: str
) -> None:
    """One prior for all mechanisms of a stretch: plain or opposed, they begin above the first sensor too."""
    setting = replace(settings[1], recorded_m=(600.0, 1100.0))
    shapes = added_to(ALL[name]).shapes(setting)
    assert len(set(shapes)) == len(shapes)
    plain = [one for one in shapes if not is_opposed(one) and GROWTH not in dict(one.constants)]
    ends = np.array([ends_of(one) for one in plain])
    assert (ends[:, 1] > 600.0).all() and (ends[:, 1] <= 1100.0).all() and ends[:, 0].min() < 400.0
    lengths = np.round(ends[:, 1] - ends[:, 0])
    for length in (75.0, 200.0, 500.0):
        assert shares(plain)[lengths == length].sum() == pytest.approx(1.0 / 3.0)
        np.testing.assert_allclose(
            np.diff(np.sort(ends[lengths == length, 1])), 500.0 / (lengths == length).sum()
        )
    opposed = {ends_of(one) for one in shapes if is_opposed(one)}
    assert opposed <= {ends_of(one) for one in plain if np.diff(ends_of(one)) > 150.0}
    shallow = replace(setting, recorded_m=(100.0, 1100.0))
    assert min(ends_of(one)[0] for one in added_to(ALL[name]).shapes(shallow)) >= 0.0


def test_parts_of_an_opposed_stretch_keep_its_relief_or_vary_it(settings: list[Setting]) -> None:
    """Where it is, by another relief; elsewhere by the same one, relative to the typical speed there."""
    setting, added = settings[1], added_to(ALL["segment_drag"])
    first = next(one for one in added.shapes(setting) if is_opposed(one))
    assert added.scale_of(first) == pytest.approx(3.0 * added.scale)
    shape = max(added.split(setting, first, 1.0), key=lambda one: relief_of(setting, one))
    assert (shape.s_from_m, shape.s_to_m) == (first.s_from_m, first.s_to_m)
    assert relief_of(setting, shape) == pytest.approx(1.08, rel=0.01)
    for steps in (1.0, 0.5):
        parts = added.split(setting, shape, steps)
        reliefs = np.array([relief_of(setting, one) for one in parts])
        changed = np.abs(reliefs - 1.08) > 0.01
        np.testing.assert_allclose(
            np.sort(reliefs[changed]) / 1.08, [1 - 0.08 * steps, 1 + 0.08 * steps], atol=0.01
        )
        assert all(is_opposed(one) and one.prior_scales == first.prior_scales for one in parts)
        for part, other in zip(parts, changed, strict=True):
            assert not other or (part.s_from_m, part.s_to_m) == (shape.s_from_m, shape.s_to_m)


def relief_of(setting: Setting, shape: Shape) -> float:
    """Speed at which relief and drag are equal, over the typical one."""
    assert shape.s_from_m is not None
    typical = np.interp(shape.s_from_m, setting.terrain.edge_s_m, setting.front_speed)
    return float(dict(shape.constants)[U_1] / typical)


def test_where_no_front_comes_nothing_is_opposed(settings: list[Setting]) -> None:
    setting = replace(settings[0], front_speed=np.zeros_like(settings[0].front_speed))
    shapes = added_to(ALL["segment_drag"]).shapes(setting)
    assert shapes and not any(is_opposed(shape) for shape in shapes)


@pytest.mark.parametrize("mechanism", ALL.values(), ids=ALL)
def test_shapes_and_their_parts_are_on_the_track(mechanism: Mechanism, settings: list[Setting]) -> None:
    added = added_to(mechanism)
    for setting in settings:
        shapes = added.shapes(setting)
        assert shapes and len(set(shapes)) == len(shapes)
        for shape in [*shapes, *(part for one in shapes for part in added.split(setting, one, 1.0))]:
            if shape.place_m is not None:
                assert shape.s_from_m is not None and shape.s_to_m is not None
                assert 0.0 <= shape.s_from_m < shape.s_to_m <= setting.terrain.length_m
            assert shape.sensor is None or shape.sensor in setting.sensors
            assert shape.covariate is None or shape.covariate in setting.covariates
            assert_well_formed(added.direction(setting, shape), setting)


def assert_well_formed(direction: Direction, setting: Setting) -> None:
    """Arrays of the right shapes, finite, and something in them."""
    changes = [direction.release != 0.0]
    if direction.columns:
        assert direction.profiles.shape == (len(direction.columns), setting.terrain.n_cells)
        changes.append(bool(np.any(direction.profiles)))
    assert (direction.weakening_speed is not None) == (Column.WEAKENING in direction.columns)
    for values, n in (
        (direction.log_strengths, setting.n_events),
        (direction.log_readings, len(setting.sensors)),
        (direction.places, len(setting.sensors)),
    ):
        if values is not None:
            assert values.shape == (n,)
            changes.append(bool(np.any(values)))
    for values in (direction.profiles, direction.log_strengths, direction.log_readings, direction.places):
        assert values is None or np.all(np.isfinite(values))
    assert np.isfinite(direction.release) and any(changes)


def test_parts_of_a_shape_are_near_it(settings: list[Setting]) -> None:
    for mechanism in ALL.values():
        added = added_to(mechanism)
        for shape in added.shapes(settings[0]):
            for part in (*added.split(settings[0], shape, 1.0), *added.split(settings[0], shape, 0.25)):
                assert shape.s_from_m is not None and shape.s_to_m is not None
                assert part.s_from_m is not None and part.s_to_m is not None
                assert part != shape and dict(part.constants).keys() == dict(shape.constants).keys()
                assert part.s_from_m < shape.s_to_m and part.s_to_m > shape.s_from_m


def test_what_the_recordings_do_not_hold_is_not_looked_for(settings: list[Setting]) -> None:
    setting = settings[0]
    assert not added_to(ALL["covariate_friction"]).shapes(replace(setting, covariates={}))
    one_velocity = tuple(k == 0 for k in range(len(setting.sensors)))
    assert not added_to(ALL["sensor_bias"]).shapes(replace(setting, velocities=one_velocity))


def central(extension: Extension, at: tuple[Any, ...], along: tuple[Any, ...], step: float) -> Any:
    """Central difference of the readings by points and strengths along some direction, per its unit."""
    events, points, strengths = at
    ahead, behind = (
        extension.predict(events, points + size * along[0], strengths + size * along[1])
        for size in (step, -step)
    )
    return (ahead - behind) / (2.0 * step)


@pytest.mark.parametrize("mechanism", ALL.values(), ids=ALL)
def test_tangents_of_an_added_mechanism(mechanism: Mechanism, problem: HierarchicalProblem) -> None:
    """Against central differences, wherever those of two step lengths agree: where fronts pass smoothly."""
    added, law = added_to(mechanism), base_of(mechanism)
    setting, n = setting_of(problem, law), problem.campaign.n_events
    events, rng = np.arange(n), np.random.default_rng(1)
    spreads = (0.03,) if law.id == "constant" else (0.05, 0.3)
    logs = [rng.normal(mean, spread, n) for mean, spread in zip(WHERE[law.id], spreads, strict=True)]
    points = np.column_stack([*logs, rng.normal(size=n)])
    strengths = np.array([0.4 * added.scale])
    units = [(axis, np.zeros(1)) for axis in np.eye(points.shape[1])]
    units.append((np.zeros(points.shape[1]), np.array([added.scale])))
    errors, n_all = [], 0
    for shape in some(added.shapes(setting)):
        extension = extended(problem, law, [added.direction(setting, shape)])
        readings, by_points, by_strengths = extension.tangents(events, points, strengths)
        np.testing.assert_allclose(readings, extension.predict(events, points, strengths), rtol=1e-12)
        assert by_points.shape == (*readings.shape, points.shape[1])
        assert by_strengths.shape == (*readings.shape, 1)
        tangents = np.concatenate([by_points, added.scale * by_strengths], axis=2)
        for k, unit in enumerate(units):
            coarse, fine = (central(extension, (events, points, strengths), unit, h) for h in (1e-4, 5e-5))
            size = np.abs(fine) + 1e-3 * np.abs(fine).max(axis=0) + 1e-9
            smooth = np.abs(coarse - fine) < 1e-3 * size
            errors.append((np.abs(tangents[:, :, k] - fine) / size)[smooth])
            n_all += fine.size
        assert np.any(by_points[:, :, :-1]) and np.any(by_points[:, :, -1])
    error = np.concatenate(errors)
    assert len(error) > 0.95 * n_all
    assert error.max() < 0.05 and np.mean(error > 1e-3) < 0.002
