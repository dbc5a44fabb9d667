"""No front is faster than a free fall down the track; what is refused is beyond the errors of readings."""

import csv
import io

import numpy as np
import pytest

from skred.campaign import CampaignError, find_campaign, read_campaign
from skred.campaign.writing import write_campaign

LIMIT = np.sqrt(2 * 9.81 * (300 - 220))
"""Free fall to the sensor `upper`, which stands at the second point of the track, m/s."""


def upper(texts, value, status="observed", sd=""):
    return texts["recordings.csv"].replace("upper,30,,observed", f"upper,{value},{sd},{status}")


def in_km_h(folder):
    """Recordings with every speed times 3.6, the header as it was."""
    rows = list(csv.DictReader(io.StringIO((folder / "recordings.csv").read_text())))
    for row in rows:
        if row["value"] and row["sensor"] != "runout" and float(row["value"]) < 100:
            row["value"] = repr(3.6 * float(row["value"]))
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def problems_of(folder):
    with pytest.raises(CampaignError) as caught:
        read_campaign(folder)
    return caught.value.problems


def test_speeds_in_km_h_are_told_once(tmp_path):
    """The embedded recordings: each of the fastest could be an error by itself, all of them cannot."""
    write_campaign(read_campaign(find_campaign("ryggfonn")), tmp_path / "copy")
    (tmp_path / "copy" / "recordings.csv").write_text(in_km_h(tmp_path / "copy"))
    [problem] = problems_of(tmp_path / "copy")
    assert (problem.file, problem.row, problem.column, problem.found) == (
        "recordings.csv",
        2,
        "value",
        "180.0",
    )
    assert "with 128 m/s, and 3 of 51 speeds" in problem.message and "in km/h?" in problem.message


@pytest.mark.parametrize("status", ["observed", "at_least"])
def test_one_speed_above_a_free_fall(status, texts, folder_with):
    sd = np.hypot(0.1 * LIMIT, 1.0)
    exact = {"events.csv": texts["events.csv"].replace("first,0,5", "first,0,")}

    def with_speed(*given, **more):
        return folder_with({**exact, "recordings.csv": upper(texts, *given, **more)})

    read_campaign(with_speed(LIMIT + 4 * sd, status))
    [problem] = problems_of(with_speed(LIMIT + 5 * sd, status))
    assert "reaches sensor 'upper' with 39.6 m/s; are" in problem.message
    read_campaign(with_speed(LIMIT + 5 * sd, "at_most"))
    read_campaign(with_speed(LIMIT + 5 * sd, status, sd=6))


def test_a_span_falls_to_its_lowest_point(texts, folder_with):
    span = texts["recordings.csv"].replace("span,25,3", "span,50,0.1")
    read_campaign(folder_with({"recordings.csv": span}))  # 53.6 m/s after 146 m


def test_a_release_with_a_speed_adds_to_the_fall(texts, folder_with):
    fast = {"recordings.csv": upper(texts, 75, sd=1)}
    assert problems_of(folder_with(fast))
    for release in ("0,65,", "0,60,2"):
        events = f"event,release_s_m,release_speed_m_s,release_speed_sd_m_s\nfirst,{release}\n"
        read_campaign(folder_with({**fast, "events.csv": events + "second,10,,\nthird,5,,\n"}))
    below = "event,release_s_m,release_speed_m_s\nfirst,100,65\nsecond,10,\nthird,5,\n"
    assert "with 65 m/s" in problems_of(folder_with({**fast, "events.csv": below}))[0].message


def test_a_noted_release_is_not_trusted(texts, folder_with):
    """That it is noted too far down is a fault that a diagnosis finds; it is not refused here."""
    events = texts["events.csv"].replace("first,0,5", "first,95,")
    read_campaign(folder_with({"events.csv": events}))


def test_an_uncertain_release_may_be_above_the_track(texts, folder_with):
    """Its first slope goes on there; an exact one begins on the track."""
    too_fast = {"recordings.csv": upper(texts, LIMIT + 5 * np.hypot(0.1 * LIMIT, 1.0))}
    exact = {**too_fast, "events.csv": texts["events.csv"].replace("first,0,5", "first,0,")}
    wide = {**too_fast, "events.csv": texts["events.csv"].replace("first,0,5", "first,0,20")}
    assert problems_of(folder_with(exact))
    read_campaign(folder_with(wide))
