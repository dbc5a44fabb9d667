"""The track of a prediction, the campaign's own or another, and the releases on it."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from skred.arrays import FloatArray
from skred.campaign import CampaignError, Problem, Track
from skred.campaign.problems import SHOWN_CHARACTERS
from skred.campaign.reading import TRACK
from skred.campaign.tables import read_table
from skred.campaign.track_rules import track_problems
from skred.errors import InputError
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.inference.hierarchical.releases import Releases
from skred.physics.terrain import Terrain, build_terrain
from skred.prediction.track_origin import track_origin

Scenarios = Sequence[tuple[float, float]]
"""Releases [m] with their weights."""


@dataclass(frozen=True, eq=False)
class PredictionTrack:
    """A track, and where fronts start on it.

    Attributes
    ----------
    name : str
        For titles and files.
    track : Track
    terrain : Terrain
        Made with the smoothing length of the calibration.
    releases : Releases
        A new avalanche starts from any of them.
    release_text : str
        The same in words.
    is_own : bool
        Whether it is the campaign's own track.
    reference_s_m : float or None
        The campaign's zero for reports, where the track is its own.
    weights : (n_releases,) array or None
        How likely each release is; None where all are as likely.
    as_recorded : bool
        Whether the releases are the recorded ones, in their order.
    origin : dict or None
        Where a table that was given comes from.
    """

    name: str
    track: Track
    terrain: Terrain
    releases: Releases
    release_text: str
    is_own: bool
    reference_s_m: float | None
    weights: FloatArray | None = None
    as_recorded: bool = False
    origin: dict[str, Any] | None = None

    @property
    def length_m(self) -> float:
        """Arc length of the lower end [m]."""
        return self.terrain.length_m

    @property
    def highest_release_m(self) -> float:
        """Where the highest front starts [m]; of releases that are not known well, 0."""
        return 0.0 if self.releases.sd.any() else float(self.releases.mean.min())

    def fingerprint(self) -> str:
        """SHA-256 of the track's points."""
        points = np.array([self.track.x_m, self.track.z_m], dtype="<f8") + 0.0
        return hashlib.sha256(points.tobytes()).hexdigest()


def prediction_track(
    problem: HierarchicalProblem, file: Path | None = None, release: Scenarios | float | None = None
) -> PredictionTrack:
    """The track to predict on.

    Parameters
    ----------
    problem : HierarchicalProblem
    file : Path, optional
        A table of the columns x_m and z_m, as a campaign's track.csv; by default the campaign's own track.
    release : float or sequence of (float, float), optional
        Where fronts start [m]: one place, or several, each with its weight; by default the campaign's
        releases on its own track, on another its first point.

    Raises
    ------
    CampaignError
        With every problem of the file.
    InputError
        If the release is not on the track, or the track is too long.
    """
    scenarios = [(float(release), 1.0)] if isinstance(release, (int, float)) else list(release or ())
    if file is None:
        return _own(problem, scenarios)
    track = read_track(file)
    try:
        terrain = build_terrain(track.x_m, track.z_m, smoothing_m=problem.terrain.smoothing_m)
    except ValueError as error:
        raise InputError(f"--track {file}: {error}") from error
    releases, weights, text = _given(scenarios or [(0.0, 1.0)], terrain.length_m)
    if not scenarios:
        text += ", the first point of the track, because no --release was given"
    return PredictionTrack(
        file.name,
        track,
        terrain,
        releases,
        text,
        is_own=False,
        reference_s_m=None,
        weights=weights,
        origin=track_origin(file, track),
    )


def _own(problem: HierarchicalProblem, scenarios: Scenarios) -> PredictionTrack:
    campaign, terrain = problem.campaign, problem.terrain
    if scenarios:
        releases, weights, text = _given(scenarios, terrain.length_m)
    else:
        releases, weights, text = problem.releases, None, _release_text(problem.releases)
    return PredictionTrack(
        campaign.name,
        campaign.track,
        terrain,
        releases,
        text,
        is_own=True,
        reference_s_m=campaign.reference_s_m,
        weights=weights,
        as_recorded=not scenarios,
    )


def _given(scenarios: Scenarios, length_m: float) -> tuple[Releases, FloatArray | None, str]:
    """Releases that were asked for, from rest; their weights, None where they are alike; and in words."""
    for place, weight in scenarios:
        if not 0.0 <= place < length_m:
            raise InputError(
                f"--release {place:g}: expected a place on the track, from 0 to below {length_m:.1f} m"
            )
        if not 0.0 < weight < np.inf:
            raise InputError(f"--release {place:g}:{weight:g}: expected a weight above 0")
    places, weights = np.array(scenarios, dtype=float).T
    none = np.zeros(len(places))
    releases = Releases(places, none, 0.0, float(length_m), none, none)
    if np.ptp(weights) == 0.0:
        named = " or ".join(f"{place:.0f}" for place in places)
        return releases, None, f"s = {named} m" + (", each as likely" if len(places) > 1 else "")
    shares = weights / weights.sum()
    named = " or ".join(f"{place:.0f} m ({100 * w:.0f} %)" for place, w in zip(places, shares, strict=True))
    return releases, weights, f"s = {named}"


def _release_text(releases: Releases) -> str:
    """The campaign's releases in words."""
    low, high = float(releases.mean.min()), float(releases.mean.max())
    which = f"s = {low:.0f} m" if low == high else f"the recorded releases, s = {low:.0f} to {high:.0f} m"
    if releases.sd.any():
        which += f", known to {np.median(releases.sd[releases.sd > 0.0]):.0f} m"
    if releases.speed.any():
        slow, fast = float(releases.speed.min()), float(releases.speed.max())
        which += f", at {slow:.1f} m/s" if slow == fast else f", at {slow:.1f} to {fast:.1f} m/s"
    return which


def read_track(file: Path) -> Track:
    """Read and check a track's table.

    Raises
    ------
    CampaignError
        With every problem: file, row, column, and what to do.
    """
    name = str(file) if len(str(file)) <= SHOWN_CHARACTERS else file.name
    try:
        place = file.resolve(strict=True)
    except (OSError, RuntimeError, ValueError):
        message = "there is no such file; give a table with the columns x_m and z_m, in downhill order"
        raise CampaignError([Problem(name, None, None, None, message)]) from None
    table = read_table(place.parent, place.name, TRACK)
    problems = list(table.problems)
    if table.is_usable:
        problems += track_problems(table.rows)
    if problems:
        ordered = sorted(problems, key=lambda problem: problem.row or 0)
        raise CampaignError([replace(problem, file=name) for problem in ordered])
    columns = {column: np.array([row.number(column) for row in table.rows]) for column in table.columns}
    return Track(columns["x_m"], columns["z_m"], columns.get("width_m"))
