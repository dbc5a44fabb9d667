"""How a diagnosis is run: what it may cost, how chains are sampled, and the clock that times its steps."""

from __future__ import annotations

from dataclasses import dataclass

from skred.diagnosis.clock import Clock
from skred.inference.sampling import SamplerSettings

QUICK_REPLICAS = 100
"""Bootstrap campaigns of a quick diagnosis: the fewest with which a p-value can reach 0.01."""


@dataclass(frozen=True)
class Effort:
    """How much is computed.

    Attributes
    ----------
    replicas : int
        Bootstrap campaigns simulated at most for each check.
    max_mechanisms : int
        1 or 2.
    exact_loo : bool
        Refit without every avalanche.
    """

    replicas: int = 120
    max_mechanisms: int = 2
    exact_loo: bool = False


@dataclass(frozen=True)
class Run:
    """One run of a diagnosis.

    Attributes
    ----------
    settings : SamplerSettings
    effort : Effort
    clock : Clock
        Which tells of each stage as it begins.
    """

    settings: SamplerSettings
    effort: Effort
    clock: Clock

    @property
    def seed(self) -> int:
        """Seed of all randomness."""
        return self.settings.seed
