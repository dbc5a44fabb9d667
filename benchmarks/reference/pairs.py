"""Pairs of a campaign and a candidate, drawn at random from a seed and a number."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from skred.campaign import Campaign, find_campaign, read_campaign
from skred.campaign.parts import of_events
from skred.diagnosis.detect.score_test import placed_mechanisms
from skred.physics.mechanisms.spec import Mechanism, Setting, Shape
from skred.physics.mechanisms.stretches import shares
from skred.simulator.draw import Trial, draw_trial
from skred.simulator.fresh import draw_fresh

BASES = ("coulomb", "pcm", "constant", "voellmy")
SIMULATED, RYGGFONN = "simulated", "ryggfonn"
HIDDEN = {"listed": 0.6, "instrument": 0.1, "unlisted": 0.1, "two": 0.05, "nasty": 0.05, "nothing": 0.1}
SNR = (2.0, 16.0)
EVENTS = (6, 60)
"""Events of a simulated campaign, drawn evenly by their logarithm."""
_RYGGFONN, _ALSO = 0.15, 0.1
"""Shares of the pairs."""
_HIDDEN_ONE, _NEAREST = 0.65, 0.6
"""How often the candidate is what is hidden, and of the shape that is nearest."""
_MOST_SHAPES = 3
"""Of a candidate that is averaged over shapes: each takes the reference a minute."""
_DENSE = 10
"""Speed sensors from which on a campaign is dense."""
_ROADS = ("turbulent_drag", "segment_drag", "viscous_drag", "constant_retardation")
"""Of recordings with nothing known to be hidden, half of the candidates."""


@dataclass(frozen=True, eq=False)
class Drawn:
    """A campaign and a base law, and what is hidden in it.

    Attributes
    ----------
    source : str
        ``simulated``, ``ryggfonn`` or the name of another campaign.
    base : str
    campaign : Campaign
    hidden : list of dict
        As in a trial's truth; empty where nothing is known.
    snr : float or None
    averaged : bool
        Whether the candidate is to have several shapes.
    rng : numpy.random.Generator
        For the candidate.
    """

    source: str
    base: str
    campaign: Campaign
    hidden: list[dict[str, Any]]
    snr: float | None
    averaged: bool
    rng: np.random.Generator

    @property
    def dense(self) -> bool:
        """Whether there are many speed sensors."""
        return sum(not sensor.is_runout for sensor in self.campaign.sensors) > _DENSE

    def as_dict(self) -> dict[str, Any]:
        """As plain data."""
        return {
            "source": self.source,
            "base": self.base,
            "recorded": "dense" if self.dense else "sparse",
            "n_events": self.campaign.n_events,
            "hidden": [one["id"] for one in self.hidden],
            "snr": self.snr,
            "averaged": self.averaged,
        }


def draw_pair(seed: int, number: int, also: Sequence[Path] = ()) -> Drawn:
    """Draw the campaign of a pair.

    Parameters
    ----------
    also : sequence of Path
        Folders of other campaigns.
    """
    rng = np.random.default_rng([seed, number, 77])
    averaged = number % 3 == 0
    # Drawn in any case, so that other pairs stay what they are with other campaigns.
    share, base, other = rng.random(), BASES[(number - 1) % len(BASES)], rng.random()
    if share < _RYGGFONN:
        return Drawn(RYGGFONN, base, read_campaign(find_campaign(RYGGFONN)), [], None, averaged, rng)
    if share < _RYGGFONN + _ALSO and also:
        folder = also[int(other * len(also))]
        road: Literal["coulomb", "constant"] = "coulomb" if rng.random() < 0.7 else "constant"
        return Drawn(folder.name, road, read_campaign(folder), [], None, averaged, rng)
    trial = _trial(rng, base)
    hidden, snr = trial.truth["mechanisms"], float(trial.truth["snr"])
    return Drawn(SIMULATED, base, _of_size(trial, rng), hidden, snr, averaged, rng)


def _trial(rng: np.random.Generator, base: str) -> Trial:
    """A trial of a base law; drawn anew where that law allows no scene."""
    while True:
        seed, kind = int(rng.integers(10_000_000, 20_000_000)), ("sparse", "dense")[int(rng.integers(2))]
        hidden, snr = str(rng.choice(list(HIDDEN), p=list(HIDDEN.values()))), float(rng.uniform(*SNR))
        try:
            return draw_trial(
                seed, kind="dense" if kind == "dense" else "sparse", hidden=hidden, snr=snr, base=base
            )
        except RuntimeError:
            continue


def _of_size(trial: Trial, rng: np.random.Generator) -> Campaign:
    """The trial's campaign with fewer of its avalanches, or with further ones."""
    wanted = round(float(np.exp(rng.uniform(*np.log(EVENTS)))))
    campaign = trial.campaign
    if wanted <= campaign.n_events:
        return of_events(campaign, np.sort(rng.permutation(campaign.n_events)[:wanted]).tolist())
    more = draw_fresh(trial.source, wanted - campaign.n_events)
    return replace(
        campaign,
        events=(*campaign.events, *more.events),
        values=np.vstack([campaign.values, more.values]),
        status=np.vstack([campaign.status, more.status]),
        stated_sd=np.vstack([campaign.stated_sd, more.stated_sd]),
    )


def draw_candidate(drawn: Drawn, setting: Setting) -> tuple[Mechanism, list[Shape]]:
    """A mechanism that may be missing, and its shapes: one, or some where it is to be averaged."""
    rng = drawn.rng
    shapes: dict[str, list[Shape]] = {}
    mechanisms: dict[str, Mechanism] = {}
    for placed in placed_mechanisms(setting):
        shapes.setdefault(placed.mechanism.id, []).append(placed.shape)
        mechanisms[placed.mechanism.id] = placed.mechanism
    truth = next((one for one in drawn.hidden if one["id"] in shapes), None)
    likely = [one for one in _ROADS if one in shapes]
    if truth is not None and rng.random() < _HIDDEN_ONE:
        chosen = str(truth["id"])
    elif drawn.source != SIMULATED and rng.random() < 0.5:
        chosen = str(rng.choice(likely))
    else:
        chosen, truth = str(rng.choice(sorted(shapes))), None
    own = shapes[chosen]
    order = rng.choice(len(own), size=len(own), replace=False, p=shares(own)).tolist()
    if truth is not None and truth["id"] == chosen and rng.random() < _NEAREST:
        nearest = int(np.argmin([_apart(shape, truth) for shape in own]))
        order = [nearest, *(k for k in order if k != nearest)]
    size = _MOST_SHAPES if drawn.averaged else 1
    return mechanisms[chosen], [own[k] for k in order[:size]]


def _apart(shape: Shape, truth: dict[str, Any]) -> float:
    """How far a shape is from what is hidden."""
    if shape.s_from_m is not None and shape.s_to_m is not None and truth["s_from_m"] is not None:
        return abs(shape.s_from_m - truth["s_from_m"]) + abs(shape.s_to_m - truth["s_to_m"])
    if shape.sensor is not None:
        return float(shape.sensor != truth["sensor"])
    return float(shape.covariate is not None and shape.covariate != truth.get("covariate"))


def shape_as_dict(shape: Shape) -> dict[str, Any]:
    """A shape as plain data."""
    return asdict(shape)


def shape_from_dict(content: dict[str, Any]) -> Shape:
    """What `shape_as_dict` was given."""
    constants = tuple((str(name), float(value)) for name, value in content.get("constants", ()))
    return Shape(**{**content, "constants": constants})


def campaigns_in(folders: Sequence[Path]) -> list[Path]:
    """Campaign folders: each given, or those in it."""
    found: list[Path] = []
    for folder in folders:
        own = [folder] if (folder / "campaign.toml").is_file() else sorted(folder.iterdir())
        found += [one for one in own if (one / "campaign.toml").is_file()]
    return found
