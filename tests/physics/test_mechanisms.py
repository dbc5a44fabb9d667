"""Every mechanism of the library: a complete spec, a profile, and a retardation."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import skred.physics.mechanisms
from skred.campaign import find_campaign, read_campaign
from skred.physics.columns import Column
from skred.physics.geometry import contributions_of, path_of
from skred.physics.kernel import front_speeds
from skred.physics.mechanisms import Mechanism, mechanisms
from skred.physics.terrain import Terrain, build_terrain

ALL = mechanisms()
FOLDER = Path(skred.physics.mechanisms.__file__).parent


@pytest.fixture(scope="module")
def terrain() -> Terrain:
    track = read_campaign(find_campaign("ryggfonn")).track
    return build_terrain(track.x_m, track.z_m)


def test_a_mechanism_is_found_by_its_file() -> None:
    assert set(ALL) == {file.stem for file in FOLDER.glob("*.py")} - {"__init__", "spec"}
    assert {"coulomb_friction", "turbulent_drag", "constant_retardation"} <= set(ALL)


def test_strengths_have_names_of_their_own() -> None:
    assert len({mechanism.strength.name for mechanism in ALL.values()}) == len(ALL)


@pytest.mark.parametrize("mechanism", ALL.values(), ids=ALL)
def test_the_spec_is_complete(mechanism: Mechanism) -> None:
    strength = mechanism.strength
    for text in (
        mechanism.title, mechanism.equation, mechanism.mark, mechanism.reference,
        strength.name, strength.symbol, strength.unit, strength.prior_reason,
    ):  # fmt: skip
        assert text.strip() == text != ""
    assert re.fullmatch(r"10\.\d{4,}/\S+", mechanism.doi)
    assert re.fullmatch(r"1|(m|s)(-?\d)?( (m|s)(-?\d)?)*", strength.unit)
    assert np.isfinite(strength.prior_scale) and strength.prior_scale > 0
    assert mechanism.equation.startswith("-") and strength.symbol in mechanism.equation
    assert isinstance(mechanism.column, Column)


@pytest.mark.parametrize("mechanism", ALL.values(), ids=ALL)
def test_the_profile_has_one_value_per_cell(mechanism: Mechanism, terrain: Terrain) -> None:
    profile = mechanism.profile(terrain)
    assert profile.shape == (terrain.n_cells,) and np.all(np.isfinite(profile)) and np.any(profile)


@pytest.mark.parametrize("mechanism", ALL.values(), ids=ALL)
def test_a_positive_strength_retards(mechanism: Mechanism, terrain: Terrain) -> None:
    law = contributions_of([ALL["constant_retardation"], mechanism], terrain)
    some = 0.1 * mechanism.strength.prior_scale
    strengths = np.array([[0.5, 0.0], [0.5, some], [0.5, 2 * some]])
    without, with_it, with_more = front_speeds(strengths, np.zeros(3), path_of(terrain), law)
    moving = (without > 0) & (np.arange(len(without)) > 2)
    assert np.all(with_it[moving] < without[moving])
    assert np.all(with_more[moving] <= with_it[moving])
