"""What is said of a track that was made."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from skred.tracks.releases import release_sentences


def track_statement(document: Mapping[str, Any]) -> list[str]:
    """Sentences on a track, for people.

    Parameters
    ----------
    document : mapping
        As `skred.tracks.build.make_track` returns it.
    """
    notices = [f"Notice: {notice}." for notice in document["notices"]]
    return [
        *notices,
        _lengths(document),
        *_extension(document),
        *_smoothing(document),
        *release_sentences(document["releases"]),
    ]


def _lengths(document: Mapping[str, Any]) -> str:
    """That places count along the slope, and how much that differs from the map."""
    along, map_m = (document["profile"][name][-1] for name in ("s_m", "x_m"))
    return (
        f"The track is {along:.0f} m long along the slope and {map_m:.0f} m on the map. Places s (--at,"
        " --release) are lengths along the slope from its first point."
    )


def _extension(document: Mapping[str, Any]) -> Iterator[str]:
    extension = document["extension"]
    if extension is None:
        return
    asked, got, stopped = (extension[name] for name in ("asked_m", "horizontal_length_m", "stopped"))
    place = f"s = {extension['s_from_m']:.0f} to {extension['s_to_m']:.0f} m"
    if stopped is None:
        yield f"Extended along the fall line by {got:.0f} m: {place}."
    elif got == 0:
        yield f"Not extended along the fall line: {stopped}."
    else:
        yield f"Extended along the fall line by {got:.0f} of {asked:.0f} m, {place}; stopped: {stopped}."


def _smoothing(document: Mapping[str, Any]) -> Iterator[str]:
    smoothing = document["smoothing"]
    length = smoothing["smoothing_m"]
    if length == 0:
        yield "The elevations are written as sampled."
    else:
        changes = " and ".join(_change(smoothing, what) for what in ("fall", "length"))
        shift = smoothing["largest_shift_m"]
        yield f"Smoothing by {length:g} m changes {changes}. It moves the ground by up to {shift:.1f} m."
    own, together = smoothing["smoothing_of_commands_m"], smoothing["with_the_commands_m"]
    later = smoothing["as_read"]
    yield (
        f"Commands that read the track smooth it by {own:.3g} m along its arc "
        f"length; on gentle ground both together are as once by {together:.1f} m. The steepest slope is then "
        f"{later['steepest_deg']:.1f} degrees, the fall {later['fall_m']:.1f} m."
    )


def _change(smoothing: Mapping[str, Any], what: str) -> str:
    """How much longer or higher something became."""
    before, after = (smoothing[state][f"{what}_m"] for state in ("sampled", "written"))
    return f"the {what} by {after - before:+.1f} m ({100 * (after / before - 1):+.2f} %)"
