"""Campaigns of some of a campaign's avalanches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from skred.campaign.records import Campaign, Status


def of_events(campaign: Campaign, rows: Sequence[int]) -> Campaign:
    """The campaign of some avalanches, in this order, with all sensors.

    Parameters
    ----------
    campaign : Campaign
    rows : sequence of int
        Their numbers, from 0.
    """
    chosen = np.asarray(rows, dtype=np.int64)
    return replace(
        campaign,
        events=tuple(campaign.events[k] for k in chosen),
        values=campaign.values[chosen],
        status=campaign.status[chosen],
        stated_sd=campaign.stated_sd[chosen],
        values_to=campaign.values_to[chosen],
    )


def without_silent_events(campaign: Campaign) -> Campaign:
    """The campaign without avalanches of which nothing is known, not even that they did not come.

    Nothing can be learnt from them, and they must not count among those that something was learnt from.
    """
    known = np.any(campaign.status != Status.MISSING, axis=1)
    return campaign if known.all() else of_events(campaign, np.flatnonzero(known).tolist())


def without_silent_sensors(campaign: Campaign) -> Campaign:
    """The campaign without sensors of which nothing is known, neither a reading nor that none came there."""
    speaking = np.flatnonzero(np.any(campaign.status != Status.MISSING, axis=0))
    return replace(
        campaign,
        sensors=tuple(campaign.sensors[k] for k in speaking),
        values=campaign.values[:, speaking],
        status=campaign.status[:, speaking],
        stated_sd=campaign.stated_sd[:, speaking],
        values_to=campaign.values_to[:, speaking],
    )
