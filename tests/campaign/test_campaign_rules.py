"""Each rule of the format is told with its file, row and column."""

import re

import numpy as np
import pytest

from skred.campaign import CampaignError, read_campaign, write_campaign
from skred.campaign.parts import of_events
from skred.campaign.summary import campaign_summary, place_sentences

# file, text in the good file, what replaces it; row, column and words of the problem
# fmt: off
BROKEN = {
    # campaign.toml
    "format is a later version": ("campaign.toml", "format = 1", "format = 2", 1, "format", "integer 1"),
    "format is a boolean": ("campaign.toml", "format = 1", "format = true", 1, "format", "integer 1"),
    "format is no integer": ("campaign.toml", "format = 1", "format = 1.0", 1, "format", "integer 1"),
    "format is text": ("campaign.toml", "format = 1", 'format = "1"', 1, "format", "integer 1"),
    "format is missing": ("campaign.toml", "format = 1\n", "", None, "format", "missing"),
    "name is missing": ("campaign.toml", 'name = "small"\n', "", None, "name", "missing"),
    "name is empty": ("campaign.toml", '"small"', '""', 2, "name", "empty"),
    "name is a number": ("campaign.toml", '"small"', "3", 2, "name", "text in quotes"),
    "name holds an escape": ("campaign.toml", '"small"', '"\\u001b[31m"', 2, "name", "printable"),
    "source is missing": ("campaign.toml", 'source = "made up"\n', "", None, "source", "missing"),
    "source holds an escape": ("campaign.toml", "made up", "made\\u001bup", 4, "source", "control"),
    "origin is unknown": (
        "campaign.toml", '"simulated"', '"guessed"', 5, "origin", "'measured' or 'simulated'",
    ),
    "unknown key": ("campaign.toml", "reference_s_m", "refrence_s_m", 6, "refrence_s_m", "unknown key"),
    "a table for a value": (
        "campaign.toml", "reference_s_m = 100.0", "[reference_s_m]", 6, "reference_s_m", "number",
    ),
    "reference is text": ("campaign.toml", "100.0", '"100"', 6, "reference_s_m", "number"),
    "reference is a boolean": ("campaign.toml", "100.0", "true", 6, "reference_s_m", "number"),
    "reference is infinite": ("campaign.toml", "100.0", "inf", 6, "reference_s_m", "finite"),
    "reference is nan": ("campaign.toml", "100.0", "nan", 6, "reference_s_m", "finite"),
    "reference is off the track": ("campaign.toml", "100.0", "-1", 6, "reference_s_m", "on the track"),
    "not TOML": ("campaign.toml", '"made up"', "made up", 4, None, "TOML"),
    "nested deeply": ("campaign.toml", "100.0", "[" * 5000, None, None, "nested"),
    "a key twice": ("campaign.toml", "format = 1\n", "format = 1\nformat = 1\n", 2, None, "TOML"),
    "deep key": ("campaign.toml", "format = 1\n", "a." * 45000 + "a = 1\nformat = 1\n", None, None, "nested"),
    "hexadecimal digits": ("campaign.toml", "100.0", "0x" + "f" * 5000, 6, "reference_s_m", "number"),
    "thousands of digits": ("campaign.toml", "100.0", "1" * 5000, None, None, "TOML"),
    # track.csv
    "two track points": ("track.csv", "120,140,15\n180,110,20\n300,100,30\n", "", None, None, "at least 3"),
    "x does not increase": ("track.csv", "120,140", "60,140", 4, "x_m", "greater than in row 3"),
    "points too close to tell apart": (
        "track.csv", "120,140", "60.00000000000001,220", 4, "x_m", "greater than",
    ),
    "uphill order": ("track.csv", "0,300,10", "0,50,10", 6, "z_m", "downhill"),
    "width is zero": ("track.csv", "180,110,20", "180,110,0", 5, "width_m", "greater than 0"),
    "width is empty": ("track.csv", "180,110,20", "180,110,", 5, "width_m", "empty"),
    "x is empty": ("track.csv", "60,220", ",220", 3, "x_m", "empty"),
    "no x column": ("track.csv", "x_m,", "x,", 1, "x", "unknown column"),
    "column twice": ("track.csv", "x_m,z_m,width_m", "x_m,z_m,x_m", 1, "x_m", "twice"),
    "column without a name": ("track.csv", "z_m,width_m", "z_m,", 1, "", "no name"),
    "semicolons": ("track.csv", "x_m,z_m,width_m", "x_m;z_m;width_m", 1, None, "commas"),
    # sensors.csv
    "sensor twice": (
        "sensors.csv", "0,10\n", "0,10\nstop,runout,,,0,10\n", 6, "sensor", "already stands in row 5",
    ),
    "unknown quantity": (
        "sensors.csv", "lower,front_velocity", "lower,speed", 4, "quantity", "'front_velocity'",
    ),
    "unknown sensor column": ("sensors.csv", "relative_sd,", "rel_sd,", 1, "rel_sd", "unknown column"),
    "span upside down": ("sensors.csv", "120,200", "200,120", 3, "s_to_m", "exchange"),
    "velocity without a place": ("sensors.csv", "100,100", ",100", 2, "s_from_m", "needs a place"),
    "velocity with half a place": ("sensors.csv", "100,100", "100,", 2, "s_to_m", "needs a place"),
    "runout with a place": ("sensors.csv", "runout,,", "runout,,5", 5, "s_to_m", "has no place"),
    "sensor above the track": ("sensors.csv", "100,100", "-5,100", 2, "s_from_m", "on the track"),
    "sensor below the track": ("sensors.csv", "250,250", "250,900", 4, "s_to_m", "on the track"),
    "relative sd is negative": ("sensors.csv", "100,0.1,1", "100,-0.1,1", 2, "relative_sd", "0 or a greater"),
    "absolute sd is negative": ("sensors.csv", "100,0.1,1", "100,0.1,-1", 2, "absolute_sd", "0 or a greater"),
    "relative sd is empty": ("sensors.csv", "100,0.1,1", "100,,1", 2, "relative_sd", "empty"),
    # events.csv
    "event twice": ("events.csv", "third,5,2.5,-8,\n", "third,5,2.5,-8,\nfirst,0,,,\n", 5, "event", "row 2"),
    "release above the track": ("events.csv", "first,0", "first,-1", 2, "release_s_m", "on the track"),
    "release below the track": ("events.csv", "first,0", "first,1e4", 2, "release_s_m", "on the track"),
    "release is empty": ("events.csv", "first,0", "first,", 2, "release_s_m", "empty"),
    "release sd is zero": ("events.csv", "first,0,5", "first,0,0", 2, "release_sd_m", "greater than 0"),
    "release speed is negative": (
        "events.csv", "snow_temperature_degC,snow_type\nfirst,0,5,-3.5,dry\nsecond,10,,,wet\nthird,5,2.5,-8,",
        "release_speed_m_s,snow_type\nfirst,0,5,-3.5,dry\nsecond,10,,,wet\nthird,5,2.5,8,", 2,
        "release_speed_m_s", "0 or a greater",
    ),
    "release speed too fast": (
        "events.csv", "snow_temperature_degC,snow_type\nfirst,0,5,-3.5,dry\nsecond,10,,,wet\nthird,5,2.5,-8,",
        "release_speed_m_s,snow_type\nfirst,0,5,,dry\nsecond,10,,,wet\nthird,5,2.5,350,", 4,
        "release_speed_m_s", "at most 200",
    ),
    "sd of no release speed": (
        "events.csv", "snow_temperature_degC,snow_type\nfirst,0,5,-3.5,dry\nsecond,10,,,wet\nthird,5,2.5,-8,",
        "release_speed_sd_m_s,snow_type\nfirst,0,5,,dry\nsecond,10,,,wet\nthird,5,2.5,1,", 4,
        "release_speed_sd_m_s", "not given",
    ),
    "text in a column with a unit": (
        "events.csv", "-3.5", "cold", 2, "snow_temperature_degC", "ends in a unit",
    ),
    "number without a unit": ("events.csv", "wet", "2", 3, "snow_type", "without a unit"),
    "nan without a unit": ("events.csv", "wet", "1_000", 3, "snow_type", "without a unit"),
    "no release column": ("events.csv", "release_s_m", "release_m", 1, "release_s_m", "missing"),
    # recordings.csv
    "unknown event": (
        "recordings.csv", "third,upper", "fourth,upper", 10, "event", "not an id of events.csv",
    ),
    "unknown sensor": (
        "recordings.csv", "third,upper", "third,top", 10, "sensor", "not an id of sensors.csv",
    ),
    "reading twice": ("recordings.csv", "third,stop", "third,upper", 11, "sensor", "row 10"),
    "unknown reading column": ("recordings.csv", ",sd,", ",sds,", 1, "sds", "unknown column"),
    "unknown status": ("recordings.csv", "30,,observed", "30,,Observed", 2, "status", "'observed'"),
    "status is empty": ("recordings.csv", "30,,observed", "30,,", 2, "status", "'observed'"),
    "observed without a value": ("recordings.csv", "30,,observed", ",,observed", 2, "value", "needs a value"),
    "not reached with a value": (
        "recordings.csv", "second,span,,", "second,span,0,", 7, "value", "carries no value",
    ),
    "missing with a value": (
        "recordings.csv", "third,upper,,", "third,upper,3,", 10, "value", "carries no value",
    ),
    "negative velocity": ("recordings.csv", "upper,30", "upper,-30", 2, "value", "not negative"),
    "velocity beyond all physics": (
        "recordings.csv", "upper,30", "upper,38000", 2, "value", "at most 200 m/s",
    ),
    "velocity just beyond": ("recordings.csv", "upper,30", "upper,200.1", 2, "value", "write it in m/s"),
    "sd that nothing measures to": (
        "recordings.csv", "span,25,3", "span,25,1e-12", 3, "sd", "at least 0.03 m/s",
    ),
    "sd of a runout that nothing measures to": (
        "recordings.csv", "stop,180,20", "stop,180,9e-5", 9, "sd", "at least 0.039 m, ",
    ),
    "runout off the track": ("recordings.csv", "stop,320", "stop,900", 5, "value", "on the track"),
    "runout not reached": (
        "recordings.csv", "third,stop,,,missing", "third,stop,,,not_reached", 11, "status", "runout",
    ),
    "sd is zero": ("recordings.csv", "span,25,3", "span,25,0", 3, "sd", "greater than 0"),
    "sd is negative": ("recordings.csv", "span,25,3", "span,25,-3", 3, "sd", "greater than 0"),
    "sd comes out as zero": ("recordings.csv", "lower,10", "lower,0", 4, "sd", "standard deviation is 0"),
    "speed below a sensor not reached": (
        "recordings.csv", "lower,,,not_reached", "lower,4,,observed", 8, "value",
        "did not reach sensor 'span'",
    ),
    "a bound without a value": ("recordings.csv", "upper,30,", "upper,,", 2, "value", "needs a value"),
    "an interval without its end": (
        "recordings.csv", "first,stop,320,,observed", "first,stop,320,,between", 5, "value_to", "both ends",
    ),
    "a bound off the track": (
        "recordings.csv", "stop,320,,observed", "stop,900,,at_most", 5, "value", "on the track",
    ),
    "a bound of speed below nil": (
        "recordings.csv", "upper,30,,observed", "upper,-3,,at_least", 2, "value", "not negative",
    ),
    "a bound that nothing measures to": (
        "recordings.csv", "span,25,3,observed", "span,25,1e-6,at_most", 3, "sd", "at least 0.03 m/s",
    ),
    "at least some speed below a sensor not reached": (
        "recordings.csv", "lower,,,not_reached", "lower,4,,at_least", 8, "value", "did not reach sensor",
    ),
    "place sd is zero": (
        "sensors.csv", "relative_sd,absolute_sd\nupper,front_velocity,100,100,0.1,1\n"
        "span,front_velocity,120,200,0.1,1\nlower,front_velocity,250,250,0.1,0\nstop,runout,,,0,10\n",
        "relative_sd,absolute_sd,place_sd_m\nupper,front_velocity,100,100,0.1,1,0\n"
        "span,front_velocity,120,200,0.1,1,\nlower,front_velocity,250,250,0.1,0,\nstop,runout,,,0,10,\n",
        2, "place_sd_m", "greater than 0",
    ),
    "ragged row": ("recordings.csv", "upper,30,,observed", "upper,30,5,,observed", 2, None, "6 cells"),
    "short row": ("recordings.csv", "upper,30,,observed", "upper,30,observed", 2, None, "4 cells"),
    "open quote": ("recordings.csv", "third,stop", '"third,stop', 11, None, "cannot be read"),
}
# fmt: on

BAD_NUMBERS = {
    "nan": "finite",
    "-inf": "finite",
    "1e400": "at most",
    "2e12": "at most",
    "1e-400": "too small",
    '"1,000"': "thousands",
    "1 000": "thousands",
    "1'000": "thousands",
    '"12,5"': "decimal point",
    "1_0": "thousands",
    "true": "digits",
    "0x10": "digits",
    "1e": "digits",
    "1.2.3": "digits",
    "--1": "digits",
    "12 m": "digits",
    "١٢": "digits",
    "1\u202f000": "thousands",
    "\x1b[31m1": "digits",
}


@pytest.mark.parametrize("case", BROKEN)
def test_each_rule_names_file_row_and_column(case, texts, folder_with):
    file, good, bad, row, column, words = BROKEN[case]
    assert good in texts[file]
    with pytest.raises(CampaignError) as caught:
        read_campaign(folder_with({file: texts[file].replace(good, bad, 1)}))
    found = [
        problem
        for problem in caught.value.problems
        if (problem.file, problem.row, problem.column) == (file, row, column) and words in problem.message
    ]
    assert len(found) == 1, str(caught.value)
    if "column" not in case:
        assert len(caught.value.problems) == 1, "one mistake is told once"


@pytest.mark.parametrize("bad", BAD_NUMBERS)
def test_what_is_no_number_is_refused_with_advice(bad, texts, folder_with):
    broken = texts["recordings.csv"].replace("upper,30,", f"upper,{bad},", 1)
    with pytest.raises(CampaignError) as caught:
        read_campaign(folder_with({"recordings.csv": broken}))
    (problem,) = caught.value.problems
    assert (problem.file, problem.row, problem.column) == ("recordings.csv", 2, "value")
    assert BAD_NUMBERS[bad] in problem.message
    assert str(problem).isprintable()


def test_a_sensor_s_own_sd_is_told_at_each_reading(texts, folder_with):
    broken = texts["sensors.csv"].replace("100,0.1,1\n", "100,1e-9,1e-12\n")
    with pytest.raises(CampaignError) as caught:
        read_campaign(folder_with({"sensors.csv": broken}))
    assert [(problem.row, problem.column) for problem in caught.value.problems] == [(2, "sd"), (6, "sd")]
    assert all("sensor 'upper' an absolute_sd" in problem.message for problem in caught.value.problems)


def test_bounds_are_read(texts, folder_with):
    text = texts["recordings.csv"].replace("upper,30", "upper,40").replace("span,25,3", "span,25,0.04")
    campaign = read_campaign(folder_with({"recordings.csv": text}))
    assert campaign.values[0, 0] == 40 and campaign.stated_sd[0, 1] == 0.04
    with pytest.raises(CampaignError, match="0.039, expected at least 0.04 m/s, 1/1000 of the largest"):
        read_campaign(folder_with({"recordings.csv": text.replace("25,0.04", "25,0.039")}))


@pytest.mark.parametrize("cell", [">30", "at least 30", "<= 30"])
def test_a_bound_in_a_value_is_told_its_column(cell, texts, folder_with):
    text = texts["recordings.csv"].replace("first,upper,30", f"first,upper,{cell}")
    with pytest.raises(CampaignError, match="number alone, with the status at_least or at_most"):
        read_campaign(folder_with({"recordings.csv": text}))


def test_a_unit_in_a_header_is_told_once(texts, folder_with):
    text = texts["recordings.csv"].replace("value,", "value [km/h],", 1)
    with pytest.raises(CampaignError) as caught:
        read_campaign(folder_with({"recordings.csv": text}))
    [problem] = caught.value.problems
    assert problem.column == "value [km/h]" and "skred import FOLDER --out" in problem.message


def test_a_track_may_be_level_where_fronts_are_released_with_a_speed(texts, folder_with):
    level = "x_m,z_m\n0,300\n60,300\n120,300\n500,300\n"
    with pytest.raises(CampaignError, match="ends no lower than it starts"):
        read_campaign(folder_with({"track.csv": level}))
    events = (
        "event,release_s_m,release_speed_m_s,release_speed_sd_m_s\nfirst,5,35,1\nsecond,10,22,\nthird,5,,\n"
    )
    campaign = read_campaign(folder_with({"track.csv": level, "events.csv": events}))
    assert [event.release_speed_m_s for event in campaign.events] == [35.0, 22.0, None]
    assert [event.release_speed_sd_m_s for event in campaign.events] == [1.0, None, None]
    assert campaign.events[0].covariates == {}


BOUNDS = (
    "event,sensor,value,value_to,status\n"
    "first,upper,30,,observed\nfirst,stop,320,,at_least\n"
    "second,upper,20,25,between\nsecond,stop,180,230,between\n"
    "third,upper,28,,at_most\nthird,stop,330,,at_most\n"
)


def test_bounds_are_read_and_written(folder_with, tmp_path):
    campaign = read_campaign(folder_with({"recordings.csv": BOUNDS}))
    least, most = campaign.bounds
    np.testing.assert_array_equal(least[:, 0], [-np.inf, 20.0, -np.inf])
    np.testing.assert_array_equal(most[:, 0], [np.inf, 25.0, 28.0])
    np.testing.assert_array_equal(least[:, 3], [320.0, 180.0, -np.inf])
    np.testing.assert_array_equal(most[:, 3], [np.inf, 230.0, 330.0])
    write_campaign(campaign, tmp_path / "copy")
    copy = read_campaign(tmp_path / "copy")
    assert copy.fingerprint() == campaign.fingerprint()
    assert of_events(copy, [1]).bounds[1][0, 3] == 230.0
    other = read_campaign(folder_with({"recordings.csv": BOUNDS.replace("180,230", "180,231")}))
    assert other.fingerprint() != campaign.fingerprint()


@pytest.mark.parametrize(
    ("old", "new", "row", "words"),
    [
        ("180,230,between", "230,180,between", 5, "greater than value"),
        ("320,,at_least", "320,330,at_least", 3, "remove value_to"),
        ("180,230,between", "180,900,between", 5, "on the track"),
        ("20,25,between", "20,300,between", 4, "at most 200"),
    ],
)
def test_both_ends_of_an_interval_are_checked(old, new, row, words, folder_with):
    with pytest.raises(CampaignError) as caught:
        read_campaign(folder_with({"recordings.csv": BOUNDS.replace(old, new)}))
    (problem,) = caught.value.problems
    assert (problem.row, problem.column) == (row, "value_to") and words in problem.message


def test_how_well_places_are_known_is_kept(texts, folder_with, tmp_path):
    lines = texts["sensors.csv"].splitlines()
    ends = ["place_sd_m", "40", "", "12.5", ""]
    text = "\n".join(f"{line},{end}" for line, end in zip(lines, ends, strict=True))
    campaign = read_campaign(folder_with({"sensors.csv": text}))
    assert [sensor.place_sd_m for sensor in campaign.sensors] == [40.0, None, 12.5, None]
    write_campaign(campaign, tmp_path / "copy")
    assert read_campaign(tmp_path / "copy").sensors == campaign.sensors
    assert campaign.fingerprint() != read_campaign(folder_with({})).fingerprint()
    summary = campaign_summary(campaign)
    assert summary["places_known_to"] == {"upper": 40.0, "lower": 12.5}
    assert place_sentences(summary["places_known_to"])[0] == (
        "upper: place known to ± 40 m; odds of a diagnosis allow for it, calibrations do not"
    )


def test_the_span_rule_looks_at_the_span_s_upper_end(texts, folder_with):
    # Not reached at 250 m; the span 120-200 m lies above, so its speed stands.
    text = texts["recordings.csv"].replace("second,span,,,not_reached", "second,span,5,,observed")
    assert read_campaign(folder_with({"recordings.csv": text})).values[1, 1] == 5
    # A span that starts above the sensor not reached may hold a speed, one that starts at it may not.
    at_sensor = texts["sensors.csv"].replace("250,250", "200,250")
    text = texts["recordings.csv"].replace("second,lower,,,not_reached", "second,lower,5,,observed")
    with pytest.raises(CampaignError, match="row 8, column value"):
        read_campaign(folder_with({"sensors.csv": at_sensor, "recordings.csv": text}))
    overlapping = texts["sensors.csv"].replace("250,250", "199,250")
    assert read_campaign(folder_with({"sensors.csv": overlapping, "recordings.csv": text})).n_events == 3


def test_a_speed_of_zero_below_a_sensor_not_reached_is_consistent(texts, folder_with):
    text = texts["recordings.csv"].replace("second,lower,,,not_reached", "second,lower,0,1,observed")
    assert read_campaign(folder_with({"recordings.csv": text})).values[1, 2] == 0


def test_all_problems_of_all_files_are_told_at_once(texts, folder_with):
    folder = folder_with(
        {
            "campaign.toml": texts["campaign.toml"].replace("format = 1", "format = 3"),
            "track.csv": texts["track.csv"].replace("60,220", "sixty,220"),
            "sensors.csv": texts["sensors.csv"].replace("120,200", "200,120"),
            "events.csv": texts["events.csv"].replace("first,0", "first,zero"),
            "recordings.csv": texts["recordings.csv"]
            .replace("upper,30", "upper,-30")
            .replace("stop,180", "stop,x"),
        }
    )
    with pytest.raises(CampaignError) as caught:
        read_campaign(folder)
    places = [(problem.file, problem.row) for problem in caught.value.problems]
    assert places == [
        ("campaign.toml", 1),
        ("track.csv", 3),
        ("sensors.csv", 3),
        ("events.csv", 2),
        ("recordings.csv", 2),
        ("recordings.csv", 9),
    ]


def test_a_bad_row_does_not_make_its_id_unknown(texts, folder_with):
    folder = folder_with({"sensors.csv": texts["sensors.csv"].replace("100,0.1,1", "100,0.1")})
    with pytest.raises(CampaignError) as caught:
        read_campaign(folder)
    assert [problem.file for problem in caught.value.problems] == ["sensors.csv"]


def test_long_lists_are_cut_when_shown_and_bounded_when_collected(texts, folder_with):
    lines = "".join(f"e{i},upper,1,,observed\n" for i in range(50))
    with pytest.raises(CampaignError) as caught:
        read_campaign(folder_with({"recordings.csv": texts["recordings.csv"] + lines}))
    assert len(caught.value.problems) == 50
    assert str(caught.value).endswith("(so in 50 rows: 12, 13 'e1', 14 'e2', 15 'e3', 16 'e4' and 45 more)")
    steps = "".join(f"{300 - i},{100 - i}\n" for i in range(51))
    with pytest.raises(CampaignError, match="track.csv: … and 30 more problems"):
        read_campaign(folder_with({"track.csv": f"x_m,z_m\n{steps}"}))
    lines = "".join(f"first,upper,x{i},,observed\n" for i in range(3000))
    with pytest.raises(CampaignError) as caught:
        read_campaign(folder_with({"recordings.csv": texts["recordings.csv"] + lines}))
    assert len(caught.value.problems) == 1001
    assert "list ends here" in caught.value.problems[-1].message


def test_every_message_says_what_to_do(texts, folder_with):
    advice = re.compile(r"[;:,] (?:\w|')|correct|write|remove")
    for file, good, bad, *_ in BROKEN.values():
        with pytest.raises(CampaignError) as caught:
            read_campaign(folder_with({file: texts[file].replace(good, bad, 1)}))
        assert all(advice.search(problem.message) for problem in caught.value.problems)
