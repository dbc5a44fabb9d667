"""A trial from a seed: a campaign in which something, or nothing, is hidden, and the truth about it.

Seeds: 1000 and up are for development; reported results use others, and so other tracks and avalanches.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import numpy as np

from skred.campaign import Campaign
from skred.errors import InputError
from skred.simulator.effects import Effect
from skred.simulator.fresh import Source, draw_fresh
from skred.simulator.listed import BASES, INSTRUMENT, LISTED, OF_RECORD, PHYSICS, fits
from skred.simulator.masked import draw_masked, largest_mean
from skred.simulator.observe import NASTY, observe
from skred.simulator.scene import Scene, TrialKind, draw_scene
from skred.simulator.strength import Truth, nothing, refined, with_strength, with_two
from skred.simulator.unlisted import UNLISTED

SNR = (2.0, 12.0)
"""Signal-to-noise is asked for evenly in this range."""
SHARES = {"nothing": 0.175, "nasty": 0.175, "listed": 0.35, "two": 0.1, "unlisted": 0.1, "instrument": 0.1}
"""How often each class is drawn; `masked` only where it is asked for."""
MOST_SCENES = 4
"""How many scenes are tried until one allows the signal-to-noise asked for."""
NEAR = 0.2
"""How far from it is near enough."""


@dataclass(frozen=True, eq=False)
class Trial:
    """A campaign with concealed physics.

    Attributes
    ----------
    campaign : Campaign
        What a diagnosis may see.
    truth : dict
        What it may not; plain data.
    source : Source
        What further avalanches come from.
    """

    campaign: Campaign
    truth: dict[str, Any]
    source: Source = field(repr=False)

    @cached_property
    def fresh(self) -> Campaign:
        """Twelve further avalanches, for predictions made before they are looked at; drawn when asked for."""
        return draw_fresh(self.source)


def draw_trial(
    seed: int,
    *,
    kind: Literal["sparse", "dense", "mixed"] = "mixed",
    hidden: str | None = None,
    snr: float | None = None,
    base: str | None = None,
    family: str | None = None,
) -> Trial:
    """Draw a trial.

    Parameters
    ----------
    seed : int
        The same seed and options give the same trial.
    kind : {"sparse", "dense", "mixed"}
        Three speeds and a runout of 18 to 30 events, 30 to 45 gates and a runout of 12 to 20, or either.
    hidden : str, optional
        ``nothing``, ``nasty``, ``listed``, the id of a listed or unlisted effect, ``two``, ``unlisted``,
        ``instrument`` or ``masked``; drawn by `SHARES` if not given.
    snr : float, optional
        Signal-to-noise; drawn from `SNR` if not given.
    base : str, optional
        Base law: pcm, voellmy, coulomb or constant; drawn, among those that suit, if not given.
    family : str, optional
        Kind of track; drawn if not given.

    Raises
    ------
    InputError
        If there is no such thing to hide, or the base law has it already.
    """
    rng = np.random.default_rng([seed, 20_911])
    drawn_kind: TrialKind = kind if kind != "mixed" else ("sparse", "dense")[int(rng.integers(2))]
    group, ids = _what(rng, hidden, base)
    asked = float(rng.uniform(*SNR)) if snr is None else float(snr)
    best: tuple[Truth, list[float]] | None = None
    for _ in range(MOST_SCENES):
        names = ids if ids is not None else _draw_ids(rng, group, base)
        law = base or _draw_base(rng, names)
        made = _make(rng, draw_scene(rng, drawn_kind, law, family), group, names, asked)
        if made is None:
            continue
        made = refined(made[0]), made[1]
        if best is None or _distance(made[0], asked) < _distance(best[0], asked):
            best = made
        if group in ("nothing", "nasty") or _distance(best[0], asked) < NEAR:
            break
    if best is None:
        raise RuntimeError(f"seed {seed}: no scene of {MOST_SCENES} is plausible with {hidden or group}")
    truth, alone = best
    nasty = str(rng.choice(NASTY)) if group == "nasty" else None
    campaign, facts = observe(rng, truth, nasty)
    record = _record(truth, alone, group, asked)
    record.update(seed=seed, kind=drawn_kind, nasty=nasty, campaign=campaign.name, **facts)
    return Trial(campaign, record, Source(seed, truth, nasty, campaign.name))


def _distance(truth: Truth, asked: float) -> float:
    return float(abs(np.log((truth.found.snr + 0.05) / asked)))


def _what(
    rng: np.random.Generator, hidden: str | None, base: str | None
) -> tuple[str, tuple[str, ...] | None]:
    """Class of what is hidden, and its ids where they were asked for."""
    if base is not None and base not in BASES:
        raise InputError(f"no base law '{base}'; choose one of {', '.join(BASES)}")
    if hidden is None:
        return str(rng.choice(list(SHARES), p=list(SHARES.values()))), None
    if hidden in SHARES or hidden == "masked":
        return hidden, None
    if hidden in UNLISTED:
        return "unlisted", (hidden,)
    if hidden not in LISTED:
        known = ", ".join([*SHARES, "masked", *LISTED, *UNLISTED])
        raise InputError(f"nothing is known of '{hidden}' that could be hidden; choose one of {known}")
    if base is not None and not fits(hidden, base):
        raise InputError(f"the base law {base} has {hidden} already; choose another")
    return ("instrument" if hidden in INSTRUMENT else "listed"), (hidden,)


def _draw_ids(rng: np.random.Generator, group: str, base: str | None) -> tuple[str, ...]:
    """Draw what a class holds."""
    if group in ("nothing", "nasty", "masked"):
        return ()
    if group == "unlisted":
        return (str(rng.choice(sorted(UNLISTED))),)
    if group == "instrument":
        return (str(rng.choice(OF_RECORD)),)
    while True:
        names = tuple(str(name) for name in rng.choice(PHYSICS, 2 if group == "two" else 1, replace=False))
        if any(all(fits(name, law) for name in names) for law in ([base] if base else BASES)):
            return names


def _draw_base(rng: np.random.Generator, ids: tuple[str, ...]) -> str:
    """Draw a base law that lacks all of these."""
    laws = [law for law in BASES if all(fits(name, law) for name in ids)]
    weights = np.array([BASES[law] for law in laws])
    return str(rng.choice(laws, p=weights / weights.sum()))


def _make(
    rng: np.random.Generator, scene: Scene, group: str, ids: tuple[str, ...], snr: float
) -> tuple[Truth, list[float]] | None:
    """Hide something in a scene; None where that is not plausible."""
    if group in ("nothing", "nasty"):
        return nothing(scene), []
    if group == "masked":
        masked = draw_masked(rng, scene, snr)
        return None if masked is None else (masked, [])
    effects = [{**LISTED, **UNLISTED}[name](rng, scene) for name in ids]
    if len(effects) == 2:
        two, alone = with_two(scene, effects, snr)
        return None if two is None else (two, alone)
    one = with_strength(scene, effects[0], snr)
    return None if one is None else (one, [])


def _mechanism(truth: Truth, effect: Effect, strength: float) -> dict[str, Any]:
    """One hidden effect as plain data; places along the campaign's track."""
    place = effect.place_m
    from_m, to_m = (None, None) if place is None else truth.scene.setting.ground.to_campaign(np.array(place))
    word = "gate" if len(truth.scene.setting.sensors.s_from_m) > 10 else "v"
    return {
        "id": effect.id,
        "listed": effect.listed,
        "target": effect.target,
        "parameter": effect.parameter,
        "unit": effect.unit,
        "strength": effect.sign * strength,
        "s_from_m": None if from_m is None else round(float(from_m), 1),
        "s_to_m": None if to_m is None else round(float(to_m), 1),
        "sensor": f"{word}{effect.sensor + 1:02d}" if effect.sensor >= 0 else None,
        **effect.details,
    }


def _record(truth: Truth, alone: list[float], group: str, asked: float) -> dict[str, Any]:
    """The truth as plain data."""
    scene = truth.scene
    median = scene.median * np.concatenate([[truth.factor], np.ones(len(scene.median) - 1)])
    pairs = list(zip(truth.effects, truth.strengths, strict=True))
    return {
        "format": 1,
        "family": scene.setting.ground.family,
        "base_model": scene.setting.base,
        "hidden": group,
        "masked": group == "masked",
        "mechanisms": [_mechanism(truth, effect, strength) for effect, strength in pairs],
        "snr": round(truth.found.snr, 3),
        "snr_asked": round(asked, 3) if pairs else 0.0,
        "snr_alone": [round(value, 3) for value in alone],
        "largest_mean_residual_se": round(largest_mean(truth), 3),
        "base_median": median.tolist(),
        "base_spread": scene.spread.tolist(),
        "base_correlation": scene.correlation,
        "release_sd_m": scene.setting.release_sd_m,
        "release_deviation_m": (scene.release_scores * scene.setting.release_sd_m).tolist(),
    }
