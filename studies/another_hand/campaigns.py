"""The campaigns of other hands: an archive each, with what is hidden and the program that made them."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import ZipFile

HANDS = ("first", "second", "third")
"""``HAND.zip`` has ``campaigns/NAME/`` in the campaign format, ``truth.json`` by name, and ``generator/`` as
it was run. No name is in two."""


@dataclass(frozen=True)
class Hidden:
    """What is hidden in a campaign.

    Attributes
    ----------
    base_model : str
        Law that its fronts follow beside that, and that a diagnosis is asked about.
    ids : tuple of str
        Of mechanisms, ``unlisted`` where none describes it, none where nothing is hidden.
    note : str
        Its form in words.
    log_likelihood_ratio : float or None
        With the true effect against without, each avalanche's coefficients and the population refitted.
    spreads : tuple of float
        Standard deviations of the logarithms of the base law's coefficients across avalanches.
    errors : float
        Standard deviation of readings over what is stated.
    is_odd : bool
        Whether one reading is half of what it should be.
    differs : bool
        Whether avalanches differ in what is hidden.
    """

    base_model: str
    ids: tuple[str, ...]
    note: str
    log_likelihood_ratio: float | None
    spreads: tuple[float, ...]
    errors: float
    is_odd: bool
    differs: bool


def hidden(hand: str) -> dict[str, Hidden]:
    """What is hidden in each campaign of a hand, by its name."""
    with ZipFile(_archive(hand)) as archive:
        truth: dict[str, dict[str, Any]] = json.loads(archive.read("truth.json"))
    return {name: _hidden(one) for name, one in sorted(truth.items())}


def _hidden(one: dict[str, Any]) -> Hidden:
    differs = "acts_in" in one or "multiple_of_the_median" in one
    return Hidden(
        one["base"], tuple(one["truth"]), one["note"], one.get("llr_spread_refit"), tuple(one["base_log_sd"]),
        one["errors_times_stated"], one["odd_reading"] is not None, differs,
    )  # fmt: skip


def unpack(hand: str, name: str, folder: Path) -> Path:
    """Write the files of a campaign into a folder; returns where they are."""
    with ZipFile(_archive(hand)) as archive:
        for member in archive.namelist():
            if member.startswith(f"campaigns/{name}/"):
                archive.extract(member, folder)
    return folder / "campaigns" / name


def _archive(hand: str) -> Path:
    return Path(__file__).with_name(f"{hand}.zip")
