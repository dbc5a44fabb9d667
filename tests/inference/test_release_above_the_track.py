"""Releases that may be above the track's first point: its first slope goes on there."""

from __future__ import annotations

import numpy as np
import pytest

from skred.campaign import Campaign, Event, Sensor, Status, Track
from skred.diagnosis.evidence.extension import extended
from skred.inference.hierarchical.problem import hierarchical_problem
from skred.physics.laws import load_law

SLOPE, MU, SD_M = np.radians(30.0), 0.3, 5.0


def campaign_of(release_m: float, sd_m: float | None) -> Campaign:
    """Two fronts on a plane, past a gate at s = 80 m."""
    x = np.linspace(0.0, 300.0, 61)
    events = tuple(Event(str(k), release_m, sd_m, {}, None, None) for k in range(2))
    values = np.full((2, 1), 20.0)
    return Campaign(
        "plane", "", "", "simulated", None, Track(x, np.tan(SLOPE) * (300.0 - x)),
        (Sensor("gate", "front_velocity", 80.0, 80.0, 0.0, 0.3),), events, values,
        np.full(values.shape, int(Status.OBSERVED), dtype=np.int8), np.full(values.shape, np.nan),
    )  # fmt: skip


@pytest.mark.parametrize("deviation", [-3.0, -0.5, 1.0])
def test_speeds_are_those_of_a_longer_plane(deviation: float) -> None:
    extension = extended(hierarchical_problem(campaign_of(0.0, SD_M)), load_law("coulomb"))
    points = np.tile([np.log(MU), deviation], (2, 1))
    pull = 9.81 * (np.sin(SLOPE) - MU * np.cos(SLOPE))
    speed = np.sqrt(2.0 * pull * (80.0 - SD_M * deviation))
    found, by_points, _ = extension.tangents(np.arange(2), points, np.empty(0))
    assert found[:, 0] == pytest.approx(speed, rel=1e-9)
    assert by_points[:, 0, 1] == pytest.approx(-pull * SD_M / speed, rel=1e-6)


def test_only_as_far_as_releases_may_be() -> None:
    """Four standard deviations, and a cell; not at all where the release is exact or far down the track."""
    problem = hierarchical_problem(campaign_of(0.0, SD_M))
    first, cell = problem.terrain.edge_s_m[0], np.diff(problem.terrain.edge_s_m).max()
    assert -4.0 * SD_M - cell < first <= -4.0 * SD_M
    assert problem.releases.limits[0] == pytest.approx(first / SD_M)
    assert problem.releases.places(np.arange(2), np.array([-9.0, 0.0])) == pytest.approx([first, 0.0])
    for campaign in (campaign_of(0.0, None), campaign_of(21.0, SD_M)):
        assert hierarchical_problem(campaign).terrain.edge_s_m[0] == 0.0
    wide = hierarchical_problem(campaign_of(0.0, 1e4)).terrain  # no farther than the track is long
    assert wide.edge_s_m[0] == pytest.approx(-wide.length_m, rel=0.02)
