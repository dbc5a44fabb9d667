"""What commands say before they begin of a campaign, or of another track, that is odd."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from skred.campaign import find_campaign, read_campaign
from skred.cli.hints import tell_hints, tell_track_hints
from skred.inference.hierarchical.problem import hierarchical_problem
from skred.prediction.track import prediction_track


def test_ryggfonn_has_none_and_the_track_with_the_dam_loses_some_of_its_fall() -> None:
    told: list[str] = []
    tell_hints(hierarchical_problem(read_campaign(find_campaign("ryggfonn"))), told.append)
    assert told == []
    with_dam = hierarchical_problem(read_campaign(find_campaign("ryggfonn-with-dam")))
    tell_hints(with_dam, told.append)
    assert len(told) == 1 and told[0].startswith("warning: track.csv: between s = 1654 m and s = 1914 m")


def test_another_track_is_looked_at_as_a_campaign_s_is(tmp_path: Path) -> None:
    problem, file = hierarchical_problem(read_campaign(find_campaign("ryggfonn"))), tmp_path / "other.csv"
    x = np.arange(0.0, 801.0, 10.0)
    z = np.where(x < 400.0, 900.0 - 1.2 * x, 420.0 - 1e-4 * x)
    file.write_text("x_m,z_m\n" + "".join(f"{a + 3.0},{b}\n" for a, b in zip(x, z, strict=True)))
    told: list[str] = []
    tell_track_hints(prediction_track(problem, file), file, told.append)
    assert told[0].startswith("warning: other.csv, row 2, column x_m: found '3': x_m does not begin at 0")
    assert all(line.startswith("warning: other.csv") for line in told)
    told.clear()
    tell_track_hints(prediction_track(problem), None, told.append)
    assert told == []
