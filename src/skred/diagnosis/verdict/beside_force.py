"""That a mechanism has its evidence together with a force in no list, in words."""

from __future__ import annotations

from skred.diagnosis.compare.comparison import Comparison
from skred.diagnosis.evidence.prior_odds import UNLISTED
from skred.diagnosis.evidence.tolerance import DECIDES_NOTHING


def beside_force(comparison: Comparison) -> set[str]:
    """Ids of the mechanisms to whose evidence a force beside them adds more than what decides nothing."""
    factors, by_itself = comparison.log_factors, comparison.by_itself
    return {name for name, factor in factors.items() if factor - by_itself[name] > DECIDES_NOTHING}


def by_both(comparison: Comparison, name: str) -> str:
    """How much of a mechanism's evidence it has by itself; empty where nearly all."""
    if name not in beside_force(comparison):
        return ""
    factors, by_itself = comparison.log_factors, comparison.by_itself[name]
    return (
        "That is its probability together with a force in no list beside it: its log Bayes factor is"
        f" {by_itself:.1f} nats by itself and {factors[name]:.1f} with such a force allowed for, which by"
        f" itself has {factors[UNLISTED]:.1f}."
    )
