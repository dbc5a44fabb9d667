"""Hand-made trials and answers for the scorecard's tests."""

from __future__ import annotations

from typing import Any

import numpy as np

from skred.prove.scoring.answers import Pair

LISTED = (
    "viscous_drag", "turbulent_drag", "segment_drag", "segment_friction", "entrainment", "obstacle",
    "constant_retardation", "covariate_friction", "sensor_bias", "release_offset",
)  # fmt: skip
LOCAL = ("segment_drag", "segment_friction", "entrainment", "obstacle", "cubic_drag")


def effect(name: str, **more: Any) -> dict[str, Any]:
    """A hidden effect; local ones act from 1000 to 1200 m."""
    place = (1000.0, 1200.0) if name in LOCAL else (None, None)
    return {
        "id": name, "listed": name in LISTED, "parameter": "c", "unit": "s-1", "strength": 0.02,
        "s_from_m": place[0], "s_to_m": place[1], "sensor": None, **more,
    }  # fmt: skip


def truth(hidden: str, *effects: dict[str, Any], **more: Any) -> dict[str, Any]:
    """A truth document, as short as the scores allow."""
    return {
        "kind": "sparse", "hidden": hidden, "masked": hidden == "masked", "nasty": None, "base_model": "pcm",
        "mechanisms": list(effects), "snr": 7.0 if effects else 0.0, **more,
    }  # fmt: skip


def answer(verdict: str, *names: str, **more: Any) -> dict[str, Any]:
    """An answer: verdict and names, the first leading."""
    return {
        "verdict": verdict, "mechanism": names[0] if names else None, "indistinguishable": list(names[1:]),
        "wall_seconds": 30.0, "cpu_seconds": 30.0, **more,
    }  # fmt: skip


def named(*names: str, **more: Any) -> dict[str, Any]:
    """An answer that names mechanisms."""
    return answer("missing_physics", *names, **more)


QUIET = answer("nothing_missing", probability={"nothing": 0.9, "unlisted": 0.1})
CRASH = {"verdict": "crash", "error": "boom"}


def pair(one: dict[str, Any], other: dict[str, Any], name: str = "trial-0001") -> Pair:
    """A truth beside an answer."""
    return Pair(name, one, other)


def drawn(n: int, seed: int = 0) -> tuple[list[dict[str, Any]], dict[str, dict[str, Any]]]:
    """Trials of all kinds and answers of a diagnosis that is often right, drawn with a seed."""
    rng = np.random.default_rng(seed)
    groups = ("nothing", "nasty", "listed", "two", "unlisted", "instrument", "masked")
    trials, answers = [], {}
    for k in range(n):
        group = groups[k % len(groups)]
        ids = {"listed": LISTED[:8], "unlisted": ("cubic_drag", "wave"), "instrument": LISTED[8:],
               "two": LISTED[:8], "masked": ("segment_drag",)}.get(group, ())  # fmt: skip
        effects = (
            [effect(str(i)) for i in rng.choice(ids, 2 if group == "two" else 1, replace=False)]
            if ids
            else []
        )
        snr = float(rng.uniform(2, 12)) if effects else 0.0
        nasty = "odd_event" if group == "nasty" else None
        one = truth(group, *effects, kind=("sparse", "dense")[k % 2], snr=snr, nasty=nasty, seed=k)
        trials.append({"trial": f"trial-{k + 1:04d}", "truth": one})
        answers[f"trial-{k + 1:04d}"] = _drawn_answer(rng, one)
    return trials, answers


def _drawn_answer(rng: np.random.Generator, one: dict[str, Any]) -> dict[str, Any]:
    if rng.random() < 0.03:
        return dict(CRASH)
    spread = dict(zip([*LISTED, "unlisted"], rng.dirichlet(np.full(len(LISTED) + 1, 0.3)), strict=True))
    effects = one["mechanisms"]
    if not effects or rng.random() > one["snr"] / 6.0:
        stated = {"nothing": 0.7, **{name: 0.3 * value for name, value in spread.items()}}
        return answer("cannot_tell" if rng.random() < 0.3 else "nothing_missing", probability=stated)
    stated = {"nothing": 0.05, **{name: 0.35 * value for name, value in spread.items()}}
    shift = float(rng.normal(0.0, 60.0))
    place = {"s_from_m": 1000.0 + shift, "s_to_m": 1200.0 + shift} if effects[0]["s_from_m"] else None
    if not effects[0]["listed"]:
        stated["unlisted"] += 0.6
        return answer("unexplained", probability=stated, location=place)
    name = effects[0]["id"] if rng.random() < 0.8 else "viscous_drag"
    stated[name] += 0.6
    gain = {"promised": float(rng.uniform(0.2, 2.0)), "realised": float(rng.uniform(0.1, 2.0)), "n_fresh": 40}
    ties = ["obstacle"] if rng.random() < 0.3 and name != "obstacle" else []
    mean = float(rng.normal(0.02, 0.004))
    return named(
        name,
        *ties,
        probability=stated,
        location=place,
        gain=gain,
        evidence={"elpd_diff": 9.0, "p_value": 0.01},
        strength={"parameter": "viscous_drag", "unit": "s-1", "mean": mean, "sd": 0.004},
        seconds={"identify": 0.4},
    )
