"""What is odd about a campaign that breaks no rule: it is read, and its owner is told."""

from __future__ import annotations

import numpy as np

from skred.campaign.order_rules import LARGEST_SDS
from skred.campaign.problems import Problem
from skred.campaign.records import Campaign, Status, Track
from skred.campaign.rules import EVENTS, RECORDINGS, SENSORS
from skred.campaign.track_rules import TRACK


def campaign_hints(campaign: Campaign) -> list[Problem]:
    """What is odd about a campaign, without any model of its terrain."""
    return [
        *start_hints(campaign.track),
        *_short_track(campaign),
        *_two_unknowns(campaign),
        *_stopped_inside(campaign),
        *_stopped_below(campaign),
    ]


def start_hints(track: Track) -> list[Problem]:
    """Whether the first point of a track lies where distances begin."""
    first = float(track.x_m[0])
    if first == 0.0:
        return []
    message = (
        "x_m does not begin at 0; places s count from this first point, so check that those of sensors, "
        "releases and runouts do too"
    )
    return [Problem(TRACK, 2, "x_m", f"{first:g}", message)]


def _short_track(campaign: Campaign) -> list[Problem]:
    """Whether the track goes on below the farthest runout by at least how well that is known."""
    runouts = np.array([sensor.is_runout for sensor in campaign.sensors], dtype=bool)
    known = runouts & (campaign.status != Status.MISSING) & np.isfinite(campaign.values)
    if not known.any():
        return []
    stops = np.where(known, np.fmax(campaign.values, campaign.values_to), -np.inf)
    event, sensor = np.unravel_index(int(stops.argmax()), stops.shape)
    one, stop = campaign.sensors[sensor], float(stops[event, sensor])
    stated = float(campaign.stated_sd[event, sensor])
    sd = stated if np.isfinite(stated) else float(np.hypot(one.relative_sd * stop, one.absolute_sd))
    below = campaign.track.length_m - stop
    if below >= sd:
        return []
    message = (
        f"the track ends {below:.4g} m below the farthest runout (event '{campaign.event_ids[event]}', s = "
        f"{stop:.4g} m, known to {sd:.3g} m); a front that comes to the end counts as stopped there: add"
        " points further down"
    )
    return [Problem(TRACK, len(campaign.track.x_m) + 1, None, None, message)]


def _two_unknowns(campaign: Campaign) -> list[Problem]:
    """Whether an event states how well both its release's place and its speed are known."""
    both = [e.id for e in campaign.events if e.release_sd_m and e.release_speed_sd_m_s]
    if not both:
        return []
    message = (
        f"events that have a release_sd_m too: {len(both)} (first '{both[0]}'); the models vary one of"
        " the two, the place, and take the speed as exact: leave release_sd_m empty where the speed is"
        " what is uncertain"
    )
    return [Problem(EVENTS, None, "release_speed_sd_m_s", None, message)]


def _stopped_inside(campaign: Campaign) -> list[Problem]:
    """Whether fronts were read over a span, and did not come to another sensor within it."""
    speeds = np.where(campaign.status == Status.OBSERVED, campaign.values, campaign.bounds[0])
    stayed = campaign.status == Status.NOT_REACHED
    ends = np.array([np.nan if sensor.is_runout else sensor.s_to_m for sensor in campaign.sensors])
    problems = []
    for sensor, speed, end in zip(campaign.sensors, speeds.T, ends, strict=True):
        stopped = (speed > 0.0)[:, None] & stayed & (ends <= end)
        if stopped.any():
            event, other = np.argwhere(stopped)[0]
            message = (
                f"'{sensor.id}' has a speed, down to s = {end:.4g} m, of fronts that did not reach another "
                f"sensor above its end, or at it: {stopped.any(axis=1).sum()} (first event "
                f"'{campaign.event_ids[event]}', '{campaign.sensors[other].id}' at s = {ends[other]:.4g} m); "
                "they count as read up to where they stopped: check the places if they came to the end"
            )
            problems.append(Problem(SENSORS, None, "s_to_m", None, message))
    return problems


def _stopped_below(campaign: Campaign) -> list[Problem]:
    """Whether runouts are below sensors that their fronts did not reach, by more than their errors."""
    runouts = [sensor.is_runout for sensor in campaign.sensors]
    seen = np.isin(campaign.status, (Status.OBSERVED, Status.AT_LEAST, Status.BETWEEN)) & runouts
    least = np.where(seen, campaign.values - LARGEST_SDS * campaign.stated_or_usual_sd(), -np.inf)
    ends = np.array([np.nan if sensor.is_runout else sensor.s_to_m for sensor in campaign.sensors])
    stayed = campaign.status == Status.NOT_REACHED
    below = stayed & (ends < least.max(axis=1, initial=-np.inf)[:, None])
    if not below.any():
        return []
    event, sensor = np.argwhere(below)[0]
    n, first, other = below.any(axis=1).sum(), campaign.event_ids[event], campaign.sensors[sensor].id
    message = (
        f"runouts more than {LARGEST_SDS:g} sd below a sensor that was not reached: {n} "
        f"(first event '{first}', '{other}' at s = {ends[sensor]:.4g} m); write 'missing' where the sensor "
        "only recorded nothing, correct what is wrong, or leave two honest readings as they are"
    )
    return [Problem(RECORDINGS, None, "status", None, message)]
