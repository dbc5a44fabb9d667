"""The figure of a track shows what the document holds."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from map_cases import plane, write_dem, write_line

from skred.report.track.figures import track_figure
from skred.tracks.build import Wanted, make_track


@pytest.fixture
def document(tmp_path: Path) -> dict[str, Any]:
    line = write_line(tmp_path / "line.gpkg", [(100.0, 100.0), (500.0, 400.0)], names=["$x^"])
    wanted = Wanted(write_dem(tmp_path / "dem.tif", plane), line, extend_m=100.0)
    release = {"file": "r.shp", "name": "r", "s_from_m": 20.0, "s_to_m": 80.0, "distance_m": 0.0}
    return {**make_track(wanted), "releases": [release, {**release, "s_from_m": None, "s_to_m": None}]}


def test_terrain_and_slope_are_those_of_the_profile(document: dict[str, Any]) -> None:
    figure = track_figure(document)
    terrain, slope, moved = figure.axes
    profile = document["profile"]
    drawn = {line.get_label(): line.get_xydata() for line in terrain.get_lines()}
    assert np.array_equal(drawn["as written"], np.column_stack([profile["s_m"], profile["z_m"]]))
    assert np.array_equal(drawn["as in the terrain model"][:, 1], profile["z_sampled_m"])
    angles = np.asarray(slope.get_lines()[1].get_ydata())
    assert angles.max() == pytest.approx(document["smoothing"]["written"]["steepest_deg"], abs=1e-3)
    assert len(moved.get_lines()) >= 1
    assert [label for label in drawn if label == "release"] == ["release"]


def test_the_extension_is_marked_where_there_is_one(document: dict[str, Any]) -> None:
    start = document["extension"]["s_from_m"]

    def marks(of: dict[str, Any]) -> int:
        return sum(
            np.allclose(line.get_xdata(), start)
            for axes in track_figure(of).axes
            for line in axes.get_lines()
        )

    assert marks(document) == 3 and marks({**document, "extension": None}) == 0
