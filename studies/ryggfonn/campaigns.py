"""Build the Ryggfonn campaigns from Table 1 of the calibration paper and the two track profiles.

What is measured and what is inferred stands in ``data/ryggfonn/README.md``. The places of the sensors come
from ``places.csv`` beside the raw figures, relative to the dam's crown.
"""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np

from skred.arrays import FloatArray
from skred.campaign.records import Campaign, Event, Sensor, Status, Track

NATURAL_CROWN_S_M = 1940.0
# Where the crown is looked for on the surveyed track; beyond, the profile climbs the opposite slope.
DAM_ZONE_X_M = (1600.0, 1740.0)
# Both profiles lie within 0.09 m of each other here, and their slopes agree to 0.02.
SPLICE_X_M = (1740.0, 1780.0)

VELOCITY_RELATIVE_SD, VELOCITY_ABSOLUTE_SD = 0.1, 1.0
RUNOUT_RELATIVE_SD, RUNOUT_ABSOLUTE_SD = 0.1, 12.0

_COLUMNS = {"LC": "U_LC_m_s", "CD": "U_CD_m_s", "b": "U_b_m_s", "runout": "l_r_m"}
_POINTS = {"LC": ("midpoint_LC",) * 2, "CD": ("midpoint_CD",) * 2, "b": ("upstream_foot",) * 2}
_SPANS = {
    "LC": ("tower_LC45", "wedge_LC123"),
    "CD": ("wedge_LC123", "upstream_foot"),
    "b": ("upstream_foot",) * 2,
}
_EVENT_BEFORE_THE_DAM = "19750225"
_SOURCE = (
    "Recordings: Gauer, Medina-Cetina and co-workers, probabilistic calibration of block models with "
    "Ryggfonn data, Table 1. Track: 5 m terrain model distributed by NGI with the Ryggfonn example of "
    "MoT-Voellmy."
)
_DESCRIPTION = "22 dry-snow avalanches at Ryggfonn, Norway, 1975-2007, on the thalweg"
_MET_A_DAM = (
    f" The avalanches of 1983 and later met a dam at s = {NATURAL_CROWN_S_M:.0f} m that this track does not"
    " have."
)


def build(
    raw_dir: Path, *, with_dam: bool = False, spans: bool = False, release_s_m: float = 0.0
) -> Campaign:
    """Build a Ryggfonn campaign.

    Parameters
    ----------
    raw_dir : Path
        Folder with ``table1.csv``, ``places.csv``, ``track_natural.csv`` and ``track_with_dam.csv``, as
        ``find_campaign("ryggfonn") / "raw"``.
    with_dam : bool
        Take the terrain as surveyed with the dam, its end from the natural track; otherwise all from that.
    spans : bool
        Take U_LC and U_CD for mean velocities over their spans; otherwise for velocities at the midpoints.
    release_s_m : float
        Where all fronts start, arc length in m.

    Returns
    -------
    Campaign
        Places and runouts are arc lengths of the track in use.
    """
    natural = _read_track(raw_dir / "track_natural.csv")
    track, crown_s_m = natural, NATURAL_CROWN_S_M
    if with_dam:
        track = _with_end_of(_read_track(raw_dir / "track_with_dam.csv"), natural)
        crown_s_m = _crown_s_m(track)
    sensors = _sensors(raw_dir / "places.csv", crown_s_m, spans=spans)
    table = _read_csv(raw_dir / "table1.csv")
    readings = [[_reading(row[column]) for column in _COLUMNS.values()] for row in table]
    relative = np.array([[value for value, _ in of_event] for of_event in readings])
    campaign = Campaign(
        name="ryggfonn" + ("-with-dam" if with_dam else "") + ("-spans" if spans else ""),
        description=f"{_DESCRIPTION} {'with' if with_dam else 'without'} the dam; see README.md for how well "
        f"the sensors' places are known.{'' if with_dam else _MET_A_DAM}",
        source=_SOURCE,
        origin="measured",
        reference_s_m=crown_s_m,
        track=track,
        sensors=sensors,
        events=tuple(_event(row["event"], release_s_m) for row in table),
        values=relative + np.array([crown_s_m if sensor.is_runout else 0.0 for sensor in sensors]),
        status=np.array([[status for _, status in of_event] for of_event in readings]),
        stated_sd=_runout_sd(relative, sensors),
    )
    return _without_spans_that_were_not_crossed(campaign) if spans else campaign


def _read_csv(path: Path) -> list[dict[str, str]]:
    """Read one of the raw tables as text."""
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def _read_track(path: Path) -> Track:
    """Read a profile."""
    rows = _read_csv(path)
    return Track(np.array([float(row["x_m"]) for row in rows]), np.array([float(row["z_m"]) for row in rows]))


def _with_end_of(track: Track, natural: Track) -> Track:
    """Replace a track's end by the natural one, passing smoothly from one elevation to the other.

    The weight is a polynomial whose first two derivatives vanish at both ends of the splice, so slope and
    curvature have no jump there.
    """
    start_m, end_m = SPLICE_X_M
    part = np.clip((natural.x_m - start_m) / (end_m - start_m), 0.0, 1.0)
    weight = part**3 * (10.0 - 15.0 * part + 6.0 * part**2)
    surveyed_z_m = np.interp(natural.x_m, track.x_m, track.z_m)
    return Track(natural.x_m, np.round((1.0 - weight) * surveyed_z_m + weight * natural.z_m, 3))


def _crown_s_m(track: Track) -> float:
    """Return the arc length of the highest track point between the dam's feet, to 0.1 m."""
    zone = (track.x_m >= DAM_ZONE_X_M[0]) & (track.x_m <= DAM_ZONE_X_M[1])
    # The approach starts higher than the crown, so look only below the foot, where the track first rises.
    rises = np.flatnonzero(zone[1:] & (np.diff(track.z_m) > 0.0))
    foot = rises[0]
    top = foot + int(np.argmax(track.z_m[foot : np.flatnonzero(zone)[-1] + 1]))
    return round(float(track.s_m[top]), 1)


def _sensors(places_file: Path, crown_s_m: float, *, spans: bool) -> tuple[Sensor, ...]:
    """Place the sensors relative to the crown."""
    offset_m = {row["place"]: float(row["s_minus_crown_m"]) for row in _read_csv(places_file)}
    speeds = tuple(
        Sensor(
            id=sensor_id,
            quantity="front_velocity",
            s_from_m=crown_s_m + offset_m[first],
            s_to_m=crown_s_m + offset_m[last],
            relative_sd=VELOCITY_RELATIVE_SD,
            absolute_sd=VELOCITY_ABSOLUTE_SD,
        )
        for sensor_id, (first, last) in (_SPANS if spans else _POINTS).items()
    )
    # The relative part of a runout's error is a share of its distance from the crown, not of its arc length:
    # each reading states its own standard deviation.
    return (*speeds, Sensor("runout", "runout", np.nan, np.nan, 0.0, RUNOUT_ABSOLUTE_SD))


def _reading(cell: str) -> tuple[float, Status]:
    """Read a cell of Table 1: a number, ``-`` for a place that was not reached, nothing for no reading."""
    if cell == "-":
        return np.nan, Status.NOT_REACHED
    if cell == "":
        return np.nan, Status.MISSING
    return float(cell), Status.OBSERVED


def _event(event_id: str, release_s_m: float) -> Event:
    """Return an avalanche; all are taken to start at the same place, no better one being known."""
    dam_present = "no" if event_id == _EVENT_BEFORE_THE_DAM else "yes"
    return Event(event_id, release_s_m, None, {"dam_present": dam_present})


def _runout_sd(relative: FloatArray, sensors: tuple[Sensor, ...]) -> FloatArray:
    """Return 10 % of the runout's distance from the crown and an absolute part, to 0.01 m; NaN for speeds."""
    sd = np.round(np.hypot(RUNOUT_RELATIVE_SD * relative, RUNOUT_ABSOLUTE_SD), 2)
    return np.where([sensor.is_runout for sensor in sensors], sd, np.nan)


def _without_spans_that_were_not_crossed(campaign: Campaign) -> Campaign:
    """Call a mean velocity `not_reached` where the recorded runout lies inside or above its span.

    Length over travel time is not defined for a span that the front did not cross. Whatever the number in
    Table 1 means there, it is not what a span sensor reads.
    """
    ids = list(campaign.sensor_ids)
    runout_s_m = campaign.values[:, ids.index("runout")]
    values, status = campaign.values.copy(), campaign.status.copy()
    for j, sensor in enumerate(campaign.sensors):
        if sensor.is_span:
            not_crossed = (status[:, j] == Status.OBSERVED) & (runout_s_m < sensor.s_to_m)
            values[not_crossed, j] = np.nan
            status[not_crossed, j] = Status.NOT_REACHED
    return replace(campaign, values=values, status=status)
