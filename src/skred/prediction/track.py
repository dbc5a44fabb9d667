"""The track of a prediction, the campaign's own or another, and the releases on it."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from skred.campaign import CampaignError, Problem, Track
from skred.campaign.problems import SHOWN_CHARACTERS
from skred.campaign.reading import TRACK
from skred.campaign.tables import read_table
from skred.campaign.track_rules import track_problems
from skred.errors import InputError
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.inference.hierarchical.releases import Releases, exact_release
from skred.physics.terrain import Terrain, build_terrain


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
        A new avalanche starts from any of them, each as likely.
    release_text : str
        The same in words.
    is_own : bool
        Whether it is the campaign's own track.
    reference_s_m : float or None
        The campaign's zero for reports, where the track is its own.
    """

    name: str
    track: Track
    terrain: Terrain
    releases: Releases
    release_text: str
    is_own: bool
    reference_s_m: float | None

    @property
    def length_m(self) -> float:
        """Arc length of the lower end [m]."""
        return self.terrain.length_m

    def fingerprint(self) -> str:
        """SHA-256 of the track's points."""
        points = np.array([self.track.x_m, self.track.z_m], dtype="<f8") + 0.0
        return hashlib.sha256(points.tobytes()).hexdigest()


def prediction_track(
    problem: HierarchicalProblem, file: Path | None = None, release_s_m: float | None = None
) -> PredictionTrack:
    """The track to predict on.

    Parameters
    ----------
    problem : HierarchicalProblem
    file : Path, optional
        A table of the columns x_m and z_m, as a campaign's track.csv; by default the campaign's own track.
    release_s_m : float, optional
        Where all fronts start; by default the campaign's releases on its own track, on another its
        first point.

    Raises
    ------
    CampaignError
        With every problem of the file.
    InputError
        If the release is not on the track, or the track is too long.
    """
    if file is None:
        return _own(problem, release_s_m)
    track = read_track(file)
    try:
        terrain = build_terrain(track.x_m, track.z_m, smoothing_m=problem.terrain.smoothing_m)
    except ValueError as error:
        raise InputError(f"--track {file}: {error}") from error
    place = 0.0 if release_s_m is None else release_s_m
    releases = _single(place, terrain.length_m)
    default = ", the first point of the track, because no --release was given" if release_s_m is None else ""
    text = f"s = {place:.0f} m{default}"
    return PredictionTrack(file.name, track, terrain, releases, text, is_own=False, reference_s_m=None)


def _own(problem: HierarchicalProblem, release_s_m: float | None) -> PredictionTrack:
    campaign, terrain = problem.campaign, problem.terrain
    if release_s_m is None:
        releases = problem.releases
        text = _release_text(releases)
    else:
        releases = _single(release_s_m, terrain.length_m)
        text = f"s = {release_s_m:.0f} m"
    zero = campaign.reference_s_m
    return PredictionTrack(
        campaign.name, campaign.track, terrain, releases, text, is_own=True, reference_s_m=zero
    )


def _single(release_s_m: float, length_m: float) -> Releases:
    if not 0.0 <= release_s_m < length_m:
        raise InputError(
            f"--release {release_s_m:g}: expected a place on the track, from 0 to below {length_m:.1f} m"
        )
    return exact_release(release_s_m, length_m)


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
