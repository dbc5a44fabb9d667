"""What `skred validate` says of a campaign without problems."""

from __future__ import annotations

from typing import Any

from rich.table import Table
from rich.text import Text

from skred.campaign import Campaign, Status


def campaign_summary(campaign: Campaign) -> dict[str, Any]:
    """Count what a campaign holds."""
    return {
        "name": campaign.name,
        "origin": campaign.origin,
        "events": campaign.n_events,
        "sensors": campaign.n_sensors,
        "runouts": sum(sensor.is_runout for sensor in campaign.sensors),
        "readings": {status.name.lower(): int((campaign.status == status).sum()) for status in Status},
        "released_with_a_speed": sum(bool(event.release_speed_m_s) for event in campaign.events),
        "places_known_to": {
            sensor.id: sensor.place_sd_m for sensor in campaign.sensors if sensor.place_sd_m is not None
        },
        "covariates": sorted({name for event in campaign.events for name in event.covariates}),
        "track_points": len(campaign.track.x_m),
        "track_length_m": campaign.track.length_m,
        "reference_s_m": campaign.reference_s_m,
        "fingerprint": campaign.fingerprint(),
    }


def place_sentences(places_known_to: dict[str, float]) -> list[str]:
    """How well the places of sensors are known, one by one; said, because calibrations do not use it yet."""
    return [
        f"{sensor}: place known to ± {sd:g} m; odds of a diagnosis allow for it, calibrations do not"
        for sensor, sd in places_known_to.items()
    ]


def _events(summary: dict[str, Any]) -> str:
    """How many events, and how many of them do not start from rest."""
    moving = summary["released_with_a_speed"]
    return f"{summary['events']}{f', {moving} released with a speed' if moving else ''}"


def _sensors(summary: dict[str, Any]) -> str:
    """How many sensors, whether the runout is one of them, and how well places are known."""
    stops = ", one of them the runout" if summary["runouts"] else ""
    return "\n".join([f"{summary['sensors']}{stops}", *place_sentences(summary["places_known_to"])])


def _smoothing(cost: dict[str, float] | None) -> str | None:
    """What smoothing the terrain changes, where it was looked at."""
    if cost is None:
        return None
    return (
        f"by {cost['smoothing_m']:.3g} m: changes the fall between releases and sensors by up to "
        f"{cost['change_of_fall_m']:.2g} m; steepest slope {cost['steepest_deg']:.1f} degrees, smoothed "
        f"{cost['steepest_smoothed_deg']:.1f}"
    )


def summary_table(summary: dict[str, Any]) -> Table:
    """Show a summary as a table; ``smoothing`` in it, if it is there, says what that changes of the track."""
    usual = [status.name.lower() for status in Status if not status.is_bound]
    readings = ", ".join(
        f"{count} {status.replace('_', ' ')}"
        for status, count in summary["readings"].items()
        if count or status in usual
    )
    reference = summary["reference_s_m"]
    rows = {
        "campaign": f"{summary['name']} ({summary['origin']}): no problems",
        "events": _events(summary),
        "sensors": _sensors(summary),
        "readings": readings,
        "covariates": ", ".join(summary["covariates"]) or "none",
        "track": f"{summary['track_length_m']:.1f} m, {summary['track_points']} points",
        "smoothing": _smoothing(summary.get("smoothing")),
        "reference": "none" if reference is None else f"s = {reference:.1f} m",
    }
    table = Table(box=None, show_header=False)
    for name, text in rows.items():
        if text is None:
            continue
        # Text, because names come from a file and may look like rich's markup.
        table.add_row(Text(name, style="bold"), Text(text))
    return table
