"""What is odd about a campaign that can be read, told before it is used.

Everything heavy is imported inside the functions, so that ``--help`` is instant.
"""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from skred.campaign import Campaign, Problem
    from skred.inference.problem import Problem as Calibrated
    from skred.physics.terrain import Terrain
    from skred.prediction.track import PredictionTrack


def hints_of(campaign: "Campaign", terrain: "Terrain | None" = None) -> "list[Problem]":
    """What is odd about a campaign on its terrain; by default the one of the default smoothing."""
    from skred.campaign.hints import campaign_hints
    from skred.physics.terrain import build_terrain
    from skred.physics.terrain_hints import campaign_places, terrain_hints

    track = campaign.track
    terrain = build_terrain(track.x_m, track.z_m) if terrain is None else terrain
    return [*campaign_hints(campaign), *terrain_hints(track, terrain, campaign_places(campaign))]


def tell_hints(problem: "Calibrated", tell: Callable[[str], None]) -> None:
    """Tell what is odd about the campaign of a problem."""
    for hint in hints_of(problem.campaign, problem.terrain):
        tell(f"warning: {hint}")


def tell_track_hints(where: "PredictionTrack", file: Path | None, tell: Callable[[str], None]) -> None:
    """Tell what is odd about the track of a prediction, where it is not the campaign's own."""
    from dataclasses import replace

    from skred.campaign.hints import start_hints
    from skred.physics.terrain_hints import terrain_hints

    if file is None:
        return
    hints = [replace(hint, file=file.name) for hint in start_hints(where.track)]
    for hint in [*hints, *terrain_hints(where.track, where.terrain, where.track.s_m, file.name)]:
        tell(f"warning: {hint}")
