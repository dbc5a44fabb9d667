"""What a proof consists of: kinds and classes of its trials, all from a seed, and how they are diagnosed."""

from __future__ import annotations

import secrets
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np

from skred.errors import InputError

Kind = Literal["sparse", "dense", "mixed"]
KINDS = ("sparse", "dense")
FIRST_SEED = 1_000_000
"""Seeds below belong to development: thresholds and priors may have been chosen on their trials."""
LAST_SEED = 2**31 - 1
NULLS = ("nothing", "nasty")


@dataclass(frozen=True)
class Plan:
    """What to seal.

    Attributes
    ----------
    n : int
        Number of trials; trial i (from 0) has the seed ``seed + i``.
    seed : int
    kind : {"sparse", "dense", "mixed"}
        Mixed: each in turn.
    masked_share : float
        Of the trials with one listed mechanism, how many are masked.
    nothing_share : float or None
        Of all trials, how many hide nothing, half of them contaminated: to the nearest number of trials.
        None draws each trial's class by `skred.simulator.draw.SHARES`.
    unlisted_share : float or None
        Of the trials that hide something, how many hide what is in no list; None by the same shares.
    quick : bool
        Diagnosed as by ``skred diagnose --quick``.
    """

    n: int
    seed: int
    kind: Kind = "mixed"
    masked_share: float = 0.1
    nothing_share: float | None = None
    unlisted_share: float | None = None
    quick: bool = False

    def __post_init__(self) -> None:
        """Refuse what cannot be a proof."""
        if self.seed < FIRST_SEED and not self.quick:
            raise InputError(
                f"--seed {self.seed}: seeds below {FIRST_SEED} are for development, and a proof needs trials "
                "that nobody has developed on; choose a larger one, or none for a random one"
            )
        if self.seed + 9 * self.n > LAST_SEED:
            raise InputError(f"--seed {self.seed}: too large for {self.n} trials; at most {LAST_SEED}")

    def as_dict(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)


def random_seed() -> int:
    """A seed that nobody could choose."""
    return FIRST_SEED + secrets.randbelow(LAST_SEED - 100 * FIRST_SEED)


def asked(plan: Plan) -> list[dict[str, Any]]:
    """Seed, kind and hidden class of every trial, in order."""
    kinds = [KINDS[i % 2] if plan.kind == "mixed" else plan.kind for i in range(plan.n)]
    nulls = _nulls(plan, kinds)
    return [
        {"seed": plan.seed + i, "kind": kinds[i], "hidden": nulls.get(i) or _hidden(plan, plan.seed + i)}
        for i in range(plan.n)
    ]


def _nulls(plan: Plan, kinds: list[str]) -> dict[int, str]:
    """Which trials hide nothing, where their number was asked for: evenly over kinds, contaminated or not."""
    if plan.nothing_share is None:
        return {}
    order = np.random.default_rng([plan.seed, 61_031]).permutation(plan.n).tolist()
    by_kind = [[i for i in order if kinds[i] == kind] for kind in KINDS]
    longest = max(len(one) for one in by_kind)
    # Alternating kinds by pairs, so that each kind has as many contaminated as plain ones, up to one.
    in_turn = [one[i] for i in range(longest) for one in by_kind if i < len(one)]
    n_nulls = round(plan.nothing_share * plan.n)
    pairs = 2 if plan.kind == "mixed" else 1
    return {i: NULLS[(place // pairs) % 2] for place, i in enumerate(in_turn[:n_nulls])}


def _hidden(plan: Plan, seed: int) -> str:
    """Class of what a trial hides, from its own seed."""
    rng = np.random.default_rng([seed, 50_021])
    shares = {
        name: share
        for name, share in _shares(plan).items()
        if plan.nothing_share is None or name not in NULLS
    }
    weights = np.array(list(shares.values()))
    name = str(rng.choice(list(shares), p=weights / weights.sum()))
    masked = bool(rng.random() < plan.masked_share)
    return "masked" if name == "listed" and masked else name


def _shares(plan: Plan) -> dict[str, float]:
    """How often each class is drawn; those that hide something as often together as ever."""
    from skred.simulator.draw import SHARES

    if plan.unlisted_share is None:
        return SHARES
    something = sum(share for name, share in SHARES.items() if name not in NULLS)
    listed = something - SHARES["unlisted"]
    others = {
        name: share if name in NULLS else share / listed * something * (1.0 - plan.unlisted_share)
        for name, share in SHARES.items()
    }
    return others | {"unlisted": something * plan.unlisted_share}


def diagnosis_settings(quick: bool) -> dict[str, Any]:
    """How ``skred diagnose`` diagnoses for a user who sets nothing, or only ``--quick``."""
    from skred.diagnosis.effort import SAMPLING, effort_of
    from skred.inference.error_model import DEFAULT_ERRORS
    from skred.physics.terrain import SMOOTHING_M

    return {
        "sampler": SAMPLING.as_dict(),
        "effort": asdict(effort_of(quick)),
        "errors": DEFAULT_ERRORS,
        "smoothing_m": SMOOTHING_M,
    }
