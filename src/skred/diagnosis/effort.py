"""How a diagnosis is run: what it may cost, how chains are sampled, and the clock that times its steps."""

from __future__ import annotations

from dataclasses import dataclass

from skred.diagnosis.clock import Clock
from skred.inference.sampling import SamplerSettings

SAMPLING = SamplerSettings("metropolis", draws=600, tune=1000, chains=4, seed=0)
"""How a diagnosis samples: enough to converge nearly always; with more draws where it did not."""


@dataclass(frozen=True)
class Effort:
    """How much is computed.

    Attributes
    ----------
    max_mechanisms : int
        1 or 2.
    exact_loo : bool
        Refit without every avalanche.
    """

    max_mechanisms: int = 2
    exact_loo: bool = False


def effort_of(quick: bool) -> Effort:
    """How much a diagnosis computes for a person who sets nothing, or only asks for a quick one.

    A quick one adds no second mechanism: that takes another comparison, half of the time.
    """
    return Effort(max_mechanisms=1) if quick else Effort()


@dataclass(frozen=True)
class Run:
    """One run of a diagnosis, whose clock tells of each stage as it begins."""

    settings: SamplerSettings
    effort: Effort
    clock: Clock

    @property
    def seed(self) -> int:
        """Seed of all randomness."""
        return self.settings.seed
