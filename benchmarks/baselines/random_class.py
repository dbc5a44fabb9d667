"""Draws what is missing from the prior odds, and its place evenly; the campaign's content is the seed."""

from __future__ import annotations

import numpy as np

from skred.campaign import Campaign
from skred.diagnosis.evidence.extension import setting_of
from skred.diagnosis.evidence.prior_odds import NOTHING, UNLISTED, prior_odds
from skred.inference.hierarchical.problem import hierarchical_problem
from skred.physics.laws import load_law

from .common import VERDICT_OF, Answer, group_of, possible


class RandomClass:
    """The baseline that guesses."""

    id = "random_class"

    def answer(self, campaign: Campaign, base_law: str) -> Answer:
        """Anything, as likely as it is beforehand."""
        rng = np.random.default_rng(int(campaign.fingerprint()[:16], 16))
        odds = prior_odds(possible(base_law).values())
        name = str(rng.choice(list(odds), p=list(odds.values())))
        chance = float(rng.random())
        if name == NOTHING:
            return Answer("nothing_missing", None, (), odds, None, 0.0)
        setting = setting_of(hierarchical_problem(campaign), load_law(base_law))
        added = None if name == UNLISTED else possible(base_law)[name].added
        shapes = () if added is None else added.shapes(setting)
        shape = shapes[int(rng.integers(len(shapes)))] if shapes else None
        stretch = None
        if shape is not None and shape.s_from_m is not None and shape.s_to_m is not None:
            stretch = (shape.s_from_m, shape.s_to_m)
        if name == UNLISTED:
            return Answer("unexplained", None, (), odds, None, chance, UNLISTED)
        return Answer(VERDICT_OF[group_of(name)], name, (), odds, stretch, chance, name)
