"""Rules that hold a track, and the readings of one event, together; and what is only told."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest

from skred.campaign import CampaignError, read_campaign
from skred.campaign.hints import campaign_hints
from skred.errors import InputError
from skred.physics.terrain import build_terrain
from skred.physics.terrain_hints import campaign_places, terrain_hints
from skred.prediction.track import read_track


def problems_of(folder):
    with pytest.raises(CampaignError) as caught:
        read_campaign(folder)
    return caught.value.problems


def hints_of(campaign, smoothing_m=None):
    track = campaign.track
    terrain = build_terrain(track.x_m, track.z_m, smoothing_m=smoothing_m)
    return [
        str(h) for h in campaign_hints(campaign) + terrain_hints(track, terrain, campaign_places(campaign))
    ]


# The front of 'first' has 10 m/s at s = 250 m, and its runout an error of 10 m.
@pytest.mark.parametrize("status", ["observed", "at_least", "at_most"])
def test_a_stop_above_a_place_where_the_front_moved(status, texts, folder_with):
    stops_at = texts["recordings.csv"].replace
    (problem,) = problems_of(
        folder_with({"recordings.csv": stops_at("stop,320,,observed", f"stop,209,,{status}")})
    )
    assert (problem.file, problem.row, problem.column) == ("recordings.csv", 5, "value")
    for word in ("'first'", "10 m/s", "s = 250 m", "'lower'", "row 4", "41 m below", "elevation"):
        assert word in problem.message
    within = stops_at("stop,320,,observed", f"stop,211,,{status}")
    assert read_campaign(folder_with({"recordings.csv": within})).n_events == 3


def test_the_upper_end_of_an_interval_is_where_it_may_have_stopped(texts, folder_with):
    text = "event,sensor,value,value_to,status\nfirst,lower,10,,observed\nfirst,stop,100,{},between\n"
    (problem,) = problems_of(folder_with({"recordings.csv": text.format(150)}))
    assert (problem.row, problem.column) == (3, "value_to")
    assert read_campaign(folder_with({"recordings.csv": text.format(260)})).n_events == 3


def test_a_stop_above_the_release(texts, folder_with):
    events = texts["events.csv"].replace("second,10,", "second,260,")
    text = "event,sensor,value,sd,status\nsecond,stop,200,10,observed\nfirst,upper,20,,observed\n"
    (problem,) = problems_of(folder_with({"events.csv": events, "recordings.csv": text}))
    assert (problem.row, problem.column) == (
        2,
        "value",
    ) and "above its release at s = 260 m" in problem.message
    near = text.replace("200,10", "225,10")
    assert read_campaign(folder_with({"events.csv": events, "recordings.csv": near})).n_events == 3


def test_a_speed_above_the_release(texts, folder_with):
    events = texts["events.csv"].replace("second,10,", "second,130,")
    (problem,) = problems_of(folder_with({"events.csv": events}))
    assert (problem.file, problem.row, problem.column) == ("recordings.csv", 6, "value")
    assert "starts further down, at s = 130 m (events.csv, row 3)" in problem.message
    nothing = texts["recordings.csv"].replace("second,upper,20,,observed", "second,upper,0,1,observed")
    assert read_campaign(folder_with({"events.csv": events, "recordings.csv": nothing})).n_events == 3
    uncertain = events.replace("second,130,,", "second,130,8,")
    assert read_campaign(folder_with({"events.csv": uncertain})).n_events == 3


@pytest.mark.parametrize("number", ["-9999", "-999.0", "-32768", "-9999.00"])
@pytest.mark.parametrize(
    ("file", "good", "row", "column"),
    [
        ("track.csv", "120,140", 4, "z_m"),
        ("events.csv", "first,0,5,-3.5", 2, "snow_temperature_degC"),
        ("recordings.csv", "stop,320", 5, "value"),
    ],
)
def test_numbers_that_stand_for_no_value(number, file, good, row, column, texts, folder_with):
    bad = ",".join([*good.split(",")[:-1], number])
    problems = problems_of(folder_with({file: texts[file].replace(good, bad)}))
    assert [(p.file, p.row, p.column) for p in problems] == [(file, row, column)]
    assert "no value" in problems[0].message


TRACK = "x_m,z_m\n0,300\n60,220\n120,140\n180,110\n300,100\n"


@pytest.mark.parametrize(
    ("old", "new", "row", "words"),
    [
        ("120,140", "120,-700", 4, "-500 to 9000 m"),
        ("120,140", "120,14000", 4, "write it in metres"),
        ("60,220", "60,740", 3, "rises 440 m over 60 m from row 2, at 82.2 degrees"),
        ("180,110", "120.5,110", 5, "falls 30 m over 0.5 m from row 4, at 89.0 degrees"),
    ],
)
def test_ground_that_there_is_not(old, new, row, words, folder_with, tmp_path):
    bad = TRACK.replace(old, new)
    problems = problems_of(folder_with({"track.csv": bad}))
    assert (problems[0].file, problems[0].row, problems[0].column) == ("track.csv", row, "z_m")
    assert words in problems[0].message
    (tmp_path / "other.csv").write_text(bad)
    with pytest.raises(InputError) as caught:
        read_track(tmp_path / "other.csv")
    assert words in str(caught.value) and "other.csv, row" in str(caught.value)


def test_empty_rows_are_skipped_and_a_nan_is_named_once(texts, folder_with):
    rows = texts["recordings.csv"] + ",,,,\n , ,,,\n"
    events = texts["events.csv"] + ",,,,\n"
    whole = folder_with({"recordings.csv": rows, "events.csv": events})
    assert read_campaign(whole).fingerprint() == read_campaign(folder_with({})).fingerprint()
    nan = rows.replace("upper,30", "upper,NaN")
    (problem,) = problems_of(folder_with({"recordings.csv": nan, "events.csv": events}))
    assert (problem.row, problem.column, problem.found) == (2, "value", "NaN")


def test_a_column_that_is_wrong_is_named_once(texts, folder_with):
    events = "event,release_s_m,volume\nfirst,0,1200\nsecond,10,\nthird,5,800\n"
    assert len(problems_of(folder_with({"events.csv": events}))) == 2  # of so few it may be chance
    (problem,) = problems_of(folder_with({"events.csv": events.replace("second,10,", "second,10,950")}))
    assert (problem.row, problem.column, problem.found) == (1, "volume", "1200")
    assert problem.message.startswith(
        "in each of 3 rows, first in row 2: a number in a column without a unit"
    )
    mixed = "event,release_s_m,volume\nfirst,0,1200\nsecond,10,950\nthird,5,large\nfourth,5,3\n"
    assert [p.row for p in problems_of(folder_with({"events.csv": mixed}))][:3] == [2, 3, 5]


def long_track(z_of, step=10.0, length=900.0):
    x = np.arange(0.0, length + 0.5 * step, step)
    return "x_m,z_m\n" + "".join(f"{a:.3f},{z_of(a):.3f}\n" for a in x)


def parabola(x):
    return 4e-4 * (1000.0 - x) ** 2


def test_a_usual_campaign_has_no_hints(folder_with):
    assert hints_of(read_campaign(folder_with({"track.csv": long_track(parabola)}))) == []
    assert (
        hints_of(
            read_campaign(
                folder_with(
                    {
                        "track.csv": "x_m,z_m\n"
                        + "".join(line + "\n" for line in long_track(parabola).splitlines()[1:])
                    }
                )
            )
        )
        == []
    )


def test_a_track_that_does_not_begin_at_0(folder_with):
    shifted = long_track(parabola).replace("\n0.000,", "\n-5.000,")
    [hint] = hints_of(read_campaign(folder_with({"track.csv": shifted})))
    assert hint.startswith("track.csv, row 2, column x_m: found '-5': x_m does not begin at 0")


def test_a_track_that_ends_near_the_farthest_runout(texts, folder_with):
    track = long_track(parabola, length=270.0)
    length = read_campaign(
        folder_with(
            {"track.csv": track, "recordings.csv": "event,sensor,value,status\nfirst,upper,20,observed\n"}
        )
    ).track.length_m
    text = f"event,sensor,value,status\nfirst,upper,20,observed\nsecond,stop,{length - 4.0:.2f},at_least\n"
    hints = hints_of(read_campaign(folder_with({"track.csv": track, "recordings.csv": text})), 1.0)
    assert len(hints) == 1 and "m below the farthest runout (event 'second'" in hints[0]
    safe = text.replace(f"{length - 4.0:.2f}", f"{length - 12.0:.2f}")
    assert hints_of(read_campaign(folder_with({"track.csv": track, "recordings.csv": safe})), 1.0) == []


def test_a_survey_that_zigzags(folder_with):
    noisy = long_track(lambda x: parabola(x) + (1.2 if round(x / 5.0) % 2 else -1.2), step=5.0)
    hints = hints_of(read_campaign(folder_with({"track.csv": noisy})))
    assert any("% longer than the track smoothed over 10 m" in hint for hint in hints)


def test_a_ramp_that_smoothing_takes_away(texts, folder_with):
    """A ramp of 80 degrees, and level ground; the place just below has less than its fall above."""
    ramp = "".join(f"{0.35 * k:.3f},{340.0 - 1.985 * k:.3f}\n" for k in range(20))
    level = "".join(f"{7.0 + 5.0 * k:.3f},{300.3 - 1e-3 * k:.3f}\n" for k in range(80))
    folder = folder_with(
        {
            "track.csv": "x_m,z_m\n" + ramp + level,
            "sensors.csv": texts["sensors.csv"].replace(
                "upper,front_velocity,100,100", "upper,front_velocity,42,42"
            ),
            "recordings.csv": "event,sensor,value,status\nfirst,upper,20,observed\n",
        }
    )
    campaign = read_campaign(folder)
    assert any("the track falls" in h and "take a smaller --smoothing" in h for h in hints_of(campaign))
    done = subprocess.run(
        [sys.executable, "-m", "skred.cli", "validate", str(folder), "--json"], capture_output=True, text=True
    )
    document = json.loads(done.stdout)
    assert done.returncode == 0 and document["valid"]
    assert any("the track falls" in hint["message"] for hint in document["warnings"])
    cost = document["smoothing"]
    assert cost["change_of_fall_m"] > 0.02 * 38 and cost["steepest_smoothed_deg"] < cost["steepest_deg"]
    shown = subprocess.run(
        [sys.executable, "-m", "skred.cli", "validate", str(folder)], capture_output=True, text=True
    )
    assert "warning: track.csv: between s = " in shown.stdout
    assert "changes the fall between releases and" in " ".join(shown.stdout.split())


def test_an_event_with_two_unknowns_of_its_release(folder_with):
    events = "event,release_s_m,release_sd_m,release_speed_m_s,release_speed_sd_m_s\n"
    events += "first,0,5,3,1\nsecond,10,,3,1\nthird,5,2,,\n"
    hints = hints_of(read_campaign(folder_with({"events.csv": events, "track.csv": long_track(parabola)})))
    assert len(hints) == 1 and hints[0].startswith("events.csv, column release_speed_sd_m_s: events that")


def test_a_span_read_over_by_fronts_that_did_not_reach_a_sensor_within_it(folder_with):
    sensors = "sensor,quantity,s_from_m,s_to_m,relative_sd,absolute_sd\n"
    sensors += "span,front_velocity,100,250,0.1,1\npoint,front_velocity,200,200,0.1,1\n"
    files = {"sensors.csv": sensors, "track.csv": long_track(parabola)}
    header, stopped = "event,sensor,value,status\n", "first,span,20,observed\nfirst,point,,not_reached\n"
    others = "second,span,,not_reached\nsecond,point,8,observed\n"
    others += "third,span,12,observed\nthird,point,9,observed\n"
    (hint,) = hints_of(read_campaign(folder_with(files | {"recordings.csv": header + stopped + others})))
    assert hint.startswith(
        "sensors.csv, column s_to_m: 'span' has a speed, down to s = 250 m, of fronts that "
    )
    assert "or at it: 1 (first event 'first', 'point' at s = 200 m)" in hint
    assert not hints_of(read_campaign(folder_with(files | {"recordings.csv": header + others})))


@pytest.mark.parametrize("row", ["180,12,observed", "200,12,observed", "260,12,at_least"])
def test_a_runout_below_a_sensor_that_was_not_reached(row, folder_with):
    sensors = "sensor,quantity,s_from_m,s_to_m,relative_sd,absolute_sd\n"
    sensors += "point,front_velocity,150,150,0.1,1\nstop,runout,,,0,10\n"
    readings = "event,sensor,value,sd,status\nfirst,point,,,not_reached\n"
    readings += f"first,stop,{row}\nsecond,point,9,,observed\nsecond,stop,290,,observed\n"
    files = {"sensors.csv": sensors, "track.csv": long_track(parabola), "recordings.csv": readings}
    hints = hints_of(read_campaign(folder_with(files)))
    assert bool(hints) == (row != "180,12,observed")
    if hints:
        assert hints[0].startswith("recordings.csv, column status: runouts more than 4 sd")
        assert "(first event 'first', 'point' at s = 150 m)" in hints[0]
