"""What was added to a base law, as a group of a DataTree and back: enough to simulate fronts with it.

A group ``added`` holds how each term enters the kernel on the campaign's own terrain, so that the law can be
used again without the diagnosis that found it. Terms that act alike along the whole track can be made anew on
another one.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

from skred.inference.between_events import BetweenEvents
from skred.physics.kernel.columns import Column
from skred.physics.kernel.inputs import Contributions, make_contributions
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.placed import direction_of
from skred.physics.mechanisms.spec import BoundTo, Direction, Group, Setting, Shape
from skred.physics.terrain import Terrain

GROUP = "added"
"""Name of the group."""


@dataclass(frozen=True, eq=False)
class AddedTerm:
    """One term that was added to a base law.

    Attributes
    ----------
    name : str
        Of its strength among the draws.
    mechanism, title : str
        Id and plain words.
    group : Group
        Whether it is physics or a fault of the instruments.
    bound_to : BoundTo
        What it acts on.
    shape : Shape
        Where and how it acts: the most probable one.
    direction : Direction
        What a unit of its strength changes on the campaign's own terrain, event by event where it differs.
    between : BetweenEvents
        How avalanches differ in it.
    between_name : str
        Of what says how, among the draws; empty where they do not.
    """

    name: str
    mechanism: str
    title: str
    group: Group
    bound_to: BoundTo
    shape: Shape
    direction: Direction
    between: BetweenEvents = BetweenEvents.COMMON
    between_name: str = ""

    @property
    def transfers(self) -> bool:
        """Whether it goes with avalanches to another track: physics that is bound to no place or sensor."""
        return self.group is Group.PHYSICS and self.bound_to in (BoundTo.TRACK, BoundTo.COVARIATE)

    def on(self, terrain: Terrain, base: tuple[str, ...]) -> Direction:
        """The same on another terrain; along all of it, as no recording says from where there.

        Raises
        ------
        ValueError
            If it does not transfer.
        """
        if not self.transfers:
            raise ValueError(f"{self.mechanism} is bound to the {self.bound_to} of its own track")
        if self.bound_to is BoundTo.COVARIATE:
            return self.direction  # of the avalanches, whatever the ground
        empty = np.zeros(terrain.n_cells + 1)
        setting = Setting(terrain, base, (0.0, terrain.length_m), (), (), {}, 0, empty)
        return direction_of(mechanisms()[self.mechanism], setting, replace(self.shape, s_from_m=None))


def contributions_with(base: Contributions, directions: Sequence[Direction]) -> Contributions:
    """How a law's strengths and what was added to it enter the equation of motion."""
    entering = [d for d in directions if d.columns]
    columns = [base.columns, *(np.array([int(c) for c in d.columns]) for d in entering)]
    profiles = [base.profiles, *(d.profiles for d in entering)]
    speeds = [d.weakening_speed for d in directions if d.weakening_speed is not None]
    weakening = speeds[0] if speeds and Column.WEAKENING not in base.columns else base.weakening_speed
    contributions: Contributions = make_contributions(
        np.concatenate(columns).astype(np.int64),
        np.ascontiguousarray(np.concatenate(profiles)),
        float(weakening),
    )
    return contributions


def added_group(terms: Sequence[AddedTerm]) -> xr.Dataset:
    """Terms as a dataset that netCDF can hold; `added_terms` reads it.

    Variables
    ---------
    mechanism, title, group, bound_to, shape, between_events, between_events_parameter (added) : texts, the
        shape as JSON
    release_shift (added) : m; weakening_speed (added) : m s-1, NaN where it has none
    kernel_column, kernel_owner (part) : a column of the kernel's table, and the number of the term it is of
    kernel_profile (part, cell) : what a unit of strength adds to that column
    log_strengths (added, event) : change of the logarithm of the first coefficient; only where one has it
    """
    directions = [term.direction for term in terms]
    owner = np.repeat(np.arange(len(terms)), [len(d.columns) for d in directions])
    of_events = [d.log_strengths for d in directions if d.log_strengths is not None]
    texts = {
        "mechanism": [term.mechanism for term in terms],
        "title": [term.title for term in terms],
        "group": [str(term.group) for term in terms],
        "bound_to": [str(term.bound_to) for term in terms],
        "shape": [json.dumps(asdict(term.shape)) for term in terms],
        "between_events": [str(term.between) for term in terms],
        "between_events_parameter": [term.between_name for term in terms],
    }
    weakening = [np.nan if d.weakening_speed is None else d.weakening_speed for d in directions]
    group = xr.Dataset(
        {
            **{name: (GROUP, np.array(values, dtype=str)) for name, values in texts.items()},
            "release_shift": (GROUP, [float(d.release) for d in directions], {"units": "m"}),
            "weakening_speed": (GROUP, weakening, {"units": "m s-1"}),
            "kernel_column": ("part", np.array([int(c) for d in directions for c in d.columns], dtype=int)),
            "kernel_owner": ("part", owner.astype(int)),
        },
        coords={GROUP: [term.name for term in terms]},
    )
    profiles = [d.profiles for d in directions if d.columns]
    if profiles:
        group["kernel_profile"] = (("part", "cell"), np.concatenate(profiles))
    if of_events:
        none = np.zeros(len(of_events[0]))
        rows = [none if d.log_strengths is None else d.log_strengths for d in directions]
        group["log_strengths"] = ((GROUP, "event"), np.array(rows))
    return group


def added_terms(tree: xr.DataTree) -> tuple[AddedTerm, ...]:
    """Terms of a tree; none where it is of a base law.

    Raises
    ------
    KeyError
        If the group is not one of `added_group`.
    ValueError
        If it names columns or shapes that there are not.
    """
    if GROUP not in tree.children:
        return ()
    group = tree[GROUP].to_dataset()
    names = [str(name) for name in group[GROUP].values]
    return tuple(_term(group, number, name) for number, name in enumerate(names))


def _term(group: xr.Dataset, number: int, name: str) -> AddedTerm:
    keys = "mechanism", "title", "group", "bound_to", "shape", "between_events", "between_events_parameter"
    text = {key: str(group[key].values[number]) for key in keys}
    mine = group["kernel_owner"].values == number
    columns = tuple(Column(int(c)) for c in group["kernel_column"].values[mine])
    profiles = group["kernel_profile"].values[mine] if columns else np.empty((0, 0))
    logs = group["log_strengths"].values[number] if "log_strengths" in group else np.zeros(1)
    weakening = float(group["weakening_speed"].values[number])
    direction = Direction(
        columns,
        np.asarray(profiles, dtype=float),
        log_strengths=logs if logs.any() else None,
        release=float(group["release_shift"].values[number]),
        weakening_speed=None if np.isnan(weakening) else weakening,
    )
    kind, bound_to = Group(text["group"]), BoundTo(text["bound_to"])
    return AddedTerm(
        name, text["mechanism"], text["title"], kind, bound_to, _shape(json.loads(text["shape"])), direction,
        BetweenEvents(text["between_events"]), text["between_events_parameter"],
    )  # fmt: skip


def _shape(entry: dict[str, Any]) -> Shape:
    constants = tuple((str(name), float(value)) for name, value in entry.pop("constants", ()))
    return Shape(**entry, constants=constants)
