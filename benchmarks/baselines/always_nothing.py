"""Says that nothing is missing, always, with the campaign format's prior odds as its probabilities."""

from __future__ import annotations

from skred.campaign import Campaign
from skred.diagnosis.evidence.prior_odds import prior_odds

from .common import Answer, possible


class AlwaysNothing:
    """The baseline that never alarms."""

    id = "always_nothing"

    def answer(self, campaign: Campaign, base_law: str) -> Answer:
        """Nothing is missing."""
        return Answer("nothing_missing", None, (), prior_odds(possible(base_law).values()), None, 0.0)
