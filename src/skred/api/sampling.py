"""What the functions share that sample: their arguments as the sampler wants them, and whom they tell."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from skred.inference.sampling import SamplerSettings

Tell = Callable[[str], None]
Likelihood = Literal["pooled", "hierarchical"]
Sampler = Literal["metropolis", "nuts", "smc"]


def silent(line: str) -> None:
    """Tell nobody."""


def settings_of(
    likelihood: str, draws: int, tune: int | None, chains: int, seed: int, sampler: Sampler = "metropolis"
) -> SamplerSettings:
    """Settings of the sampler from the arguments of a function, as plain numbers."""
    from skred.inference.sampling import TUNE, SamplerSettings

    tuned = TUNE[likelihood] if tune is None else tune
    return SamplerSettings(sampler, int(draws), int(tuned), int(chains), int(seed))
