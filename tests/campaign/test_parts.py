"""Parts of a campaign: avalanches of which nothing is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from skred.campaign import Campaign, Event, Status, find_campaign, read_campaign
from skred.campaign.parts import without_silent_events
from skred.inference.hierarchical.problem import hierarchical_problem
from skred.inference.pooled.problem import pooled_problem
from skred.inference.problem import Problem


def with_a_silent_avalanche(campaign: Campaign) -> Campaign:
    """One more avalanche, the second, of which nothing was read."""
    at, nothing = 1, np.full((1, campaign.n_sensors), np.nan)
    events = list(campaign.events)
    events.insert(at, replace(campaign.events[0], id="unread"))
    silent = np.full((1, campaign.n_sensors), Status.MISSING)
    return replace(
        campaign,
        events=tuple(events),
        values=np.insert(campaign.values, at, nothing, axis=0),
        status=np.insert(campaign.status, at, silent, axis=0),
        stated_sd=np.insert(campaign.stated_sd, at, nothing, axis=0),
        values_to=np.insert(campaign.values_to, at, nothing, axis=0),
    )


@pytest.mark.parametrize("problem_of", [hierarchical_problem, pooled_problem])
def test_nothing_is_learnt_from_an_avalanche_without_a_reading(
    problem_of: Callable[[Campaign], Problem],
) -> None:
    """It is none of those fitted, so that no count, no score and no part of a share has it."""
    campaign = read_campaign(find_campaign("ryggfonn"))
    silent = with_a_silent_avalanche(campaign)
    assert silent.n_events == campaign.n_events + 1 and isinstance(silent.events[1], Event)
    problem = problem_of(silent)
    assert problem.campaign.fingerprint() == campaign.fingerprint()
    assert problem.coords["event"] == problem_of(campaign).coords["event"]


def test_fronts_that_did_not_come_are_known() -> None:
    campaign = read_campaign(find_campaign("ryggfonn"))
    silent = with_a_silent_avalanche(campaign)
    status = silent.status.copy()
    status[1, 0] = Status.NOT_REACHED
    assert without_silent_events(replace(silent, status=status)).n_events == silent.n_events
    assert without_silent_events(campaign) is campaign
