"""Read, check and write campaigns: everything recorded on one avalanche path.

A campaign is a folder of five files (campaign format, version 1). `read_campaign` checks all of them at
once and either returns a `Campaign` or raises a `CampaignError` that lists every problem.
"""

from skred.campaign.finding import embedded_campaigns, find_campaign
from skred.campaign.problems import CampaignError, Problem
from skred.campaign.reading import read_campaign
from skred.campaign.records import Campaign, Event, Sensor, Status, Track
from skred.campaign.writing import write_campaign

__all__ = [
    "Campaign",
    "CampaignError",
    "Event",
    "Problem",
    "Sensor",
    "Status",
    "Track",
    "embedded_campaigns",
    "find_campaign",
    "read_campaign",
    "write_campaign",
]
