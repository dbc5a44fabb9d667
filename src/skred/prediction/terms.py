"""A law with what was added to it, on the track of a prediction: what goes along, and what is left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from skred.arrays import FloatArray, IntArray
from skred.inference.added_terms import GROUP, AddedTerm, contributions_with
from skred.inference.between_events import BetweenEvents, own_multiples
from skred.inference.hierarchical.releases import Releases
from skred.physics.geometry import contributions_of
from skred.physics.kernel.inputs import Contributions
from skred.physics.law import Law
from skred.physics.mechanisms.spec import BoundTo, Direction, Group
from skred.physics.terrain import Terrain
from skred.prediction.track import PredictionTrack


@dataclass(frozen=True, eq=False)
class Motion:
    """How fronts move: the law's strengths, which differ from avalanche to avalanche, and what is added.

    Attributes
    ----------
    contributions : Contributions
        How the law's and the added strengths enter the equation of motion.
    terms : tuple of Direction
        What a unit of each added strength changes on this track.
    added : (n_populations, n_terms) array
        Added strengths of each population.
    between : tuple of (BetweenEvents, (n_populations,) array)
        How avalanches differ in each, and by how much; none where they differ in no strength.
    """

    contributions: Contributions
    terms: tuple[Direction, ...] = ()
    added: FloatArray | None = None
    between: tuple[tuple[BetweenEvents, FloatArray], ...] = ()

    @property
    def differs_by_release(self) -> bool:
        """Whether releases differ in more than place and speed: in a property of their avalanches."""
        return any(term.log_strengths is not None for term in self.terms)

    def strengths(self, population: int, logs: FloatArray, event: IntArray) -> FloatArray:
        """Strengths of all columns, (n, n_columns), from logarithms of the law's own, (n, n_strengths)."""
        if self.added is None:
            return np.asarray(np.exp(logs))
        own, logs = self.added[population], logs.copy()
        for strength, term in zip(own, self.terms, strict=True):
            if term.log_strengths is not None:
                logs[:, 0] += strength * term.log_strengths[event]
        each = np.tile(own, (len(logs), 1))
        rng = np.random.default_rng([29, population])
        for k, (kind, parameter) in enumerate(self.between):
            each[:, k] *= own_multiples(kind, parameter[population], (len(logs),), rng)
        columns = np.repeat(each, [len(term.columns) for term in self.terms], axis=1)
        return np.column_stack([np.exp(logs), columns])

    def release(self, population: int, place: FloatArray, terrain: Terrain) -> FloatArray:
        """Where fronts start [m], from where releases were noted."""
        if self.added is None:
            return place
        shift = sum(s * term.release for s, term in zip(self.added[population], self.terms, strict=True))
        return np.clip(place + shift, terrain.edge_s_m[0], terrain.length_m)


@dataclass(frozen=True, eq=False)
class Moved:
    """What was added, and what becomes of it on the track of a prediction.

    Attributes
    ----------
    motion : Motion
    releases : Releases
    weights : (n_releases,) array or None
    added : list of dict
        For each mechanism: ``mechanism``, ``title``, ``used``, and ``why`` it is left out if it is.
    """

    motion: Motion
    releases: Releases
    weights: FloatArray | None
    added: list[dict[str, Any]]


def moved(
    law: Law, terms: Sequence[AddedTerm], posterior: xr.Dataset, track: PredictionTrack, chosen: IntArray
) -> Moved:
    """A law with what goes along of what was added to it.

    Parameters
    ----------
    law : Law
    terms : sequence of AddedTerm
    posterior : Dataset
        Draws of each term's strength by its name, or ``added_strengths`` (draw, added).
    track : PredictionTrack
    chosen : (n_populations,) integer array
        Numbers of the draws, chain after chain.
    """
    base = contributions_of(law.mechanisms, track.terrain)
    told = added_rows(terms, track)
    used = [term for term, row in zip(terms, told, strict=True) if row["used"]]
    if not used:
        return Moved(Motion(base), track.releases, track.weights, told)
    ids = tuple(mechanism.id for mechanism in law.mechanisms)
    directions = [term.direction if track.is_own else term.on(track.terrain, ids) for term in used]
    strengths = np.column_stack([_draws(posterior, term.name) for term in used])[chosen]
    releases, weights = track.releases, track.weights
    n_events = max((len(d.log_strengths) for d in directions if d.log_strengths is not None), default=0)
    if n_events and not track.as_recorded:
        # Every release with every recorded avalanche's property.
        n = len(releases.mean)
        releases = releases.take(np.repeat(np.arange(n), n_events))
        weights = None if weights is None else np.repeat(weights, n_events)
        directions = [_repeated(direction, n) for direction in directions]
    between = tuple(
        (term.between, _draws(posterior, term.between_name or term.name)[chosen]) for term in used
    )
    motion = Motion(contributions_with(base, directions), tuple(directions), strengths, between)
    return Moved(motion, releases, weights, told)


def _repeated(direction: Direction, n: int) -> Direction:
    if direction.log_strengths is None:
        return direction
    return Direction(
        direction.columns,
        direction.profiles,
        np.tile(direction.log_strengths, n),
        weakening_speed=direction.weakening_speed,
    )


def _draws(posterior: xr.Dataset, name: str) -> FloatArray:
    if name in posterior:
        return np.asarray(posterior[name].transpose("chain", "draw").values.ravel(), dtype=float)
    return np.asarray(posterior["added_strengths"].sel({GROUP: name}).values, dtype=float)


def added_rows(terms: Sequence[AddedTerm], track: PredictionTrack) -> list[dict[str, Any]]:
    """For each term whether it is used on a track, and why not where it is left out."""
    rows = []
    for term in terms:
        why, shape = _left_out(term, track), term.shape
        place = None if shape.s_to_m is None else [shape.s_from_m, shape.s_to_m]
        rows.append(
            {
                "mechanism": term.mechanism,
                "title": term.title,
                "parameter": term.name,
                "between_events": str(term.between),
                "place_m": place,
                "begins_m": shape.begins_m,
                "used": not why,
                "why": why,
            }
        )
    return rows


def _left_out(term: AddedTerm, track: PredictionTrack) -> str:
    """Why a term has no effect on fronts of this track; empty where it has one."""
    if term.bound_to is BoundTo.SENSOR:
        return "it is a fault of a sensor, and what is predicted are fronts"
    if term.group is Group.INSTRUMENT:
        if track.as_recorded:
            return ""
        return "it is a fault of how the recorded releases were noted, and the release is given here"
    if track.is_own or term.transfers:
        return ""
    return "it is bound to a place of the calibration's track, and does not transfer to another"
