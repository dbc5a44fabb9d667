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
        "covariates_known": _known(campaign),
        "track_points": len(campaign.track.x_m),
        "track_length_m": campaign.track.length_m,
        "reference_s_m": campaign.reference_s_m,
        "fingerprint": campaign.fingerprint(),
    }


def _known(campaign: Campaign) -> dict[str, int]:
    """For how many events each covariate is known."""
    covariates = [event.covariates for event in campaign.events]
    names = sorted({name for one in covariates for name in one})
    return {name: sum(one.get(name) is not None for one in covariates) for name in names}


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
    """How many sensors of speed, whether runouts are there too, and how well places are known."""
    stops = ", and the runout" if summary["runouts"] else ""
    of_speed = f"{summary['sensors'] - summary['runouts']} of front speed{stops}"
    return "\n".join([of_speed, *place_sentences(summary["places_known_to"])])


def _covariates(summary: dict[str, Any]) -> str:
    """The covariates, and for how many events those are known that are not known for all."""
    known = summary["covariates_known"].items()
    each = [name if n == summary["events"] else f"{name} (known for {n})" for name, n in known]
    return ", ".join(each) or "none"


def _smoothing(cost: dict[str, float] | None) -> str | None:
    """What smoothing the terrain changes, where it was looked at."""
    if cost is None:
        return None
    return (
        f"by {cost['smoothing_m']:.3g} m: changes the fall between releases and sensors by up to "
        f"{cost['change_of_fall_m']:.2g} m, and the length by {cost['change_of_length_m']:.2g} m; steepest "
        f"slope {cost['steepest_deg']:.1f} degrees, smoothed {cost['steepest_smoothed_deg']:.1f}"
    )


def summary_table(summary: dict[str, Any], n_warnings: int) -> Table:
    """Show a summary as a table; ``smoothing`` in it, if it is there, says what that changes of the track."""
    found = "no problems"
    if n_warnings:
        found = f"can be read; {n_warnings} warning{'s' if n_warnings > 1 else ''} below"
    usual = [status.name.lower() for status in Status if not status.is_bound]
    readings = ", ".join(
        f"{count} {status.replace('_', ' ')}"
        for status, count in summary["readings"].items()
        if count or status in usual
    )
    reference = summary["reference_s_m"]
    rows = {
        "campaign": f"{summary['name']} ({summary['origin']}): {found}",
        "events": _events(summary),
        "sensors": _sensors(summary),
        "readings": readings,
        "covariates": _covariates(summary),
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
