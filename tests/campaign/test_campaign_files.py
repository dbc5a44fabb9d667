"""Files from strangers: each ends as a campaign or as a clear problem."""

import os
import pickle

import numpy as np
import pytest

from skred.campaign import CampaignError, Status, find_campaign, read_campaign, write_campaign
from skred.campaign.tables import LARGEST_FILE_BYTES, MOST_ROWS

FILES = ("campaign.toml", "track.csv", "sensors.csv", "events.csv", "recordings.csv")


def only_problem(folder):
    with pytest.raises(CampaignError) as caught:
        read_campaign(folder)
    (problem,) = caught.value.problems
    return problem


def test_reads_what_stands_there(folder_with):
    campaign = read_campaign(folder_with({}))
    assert campaign.event_ids == ("first", "second", "third")
    assert campaign.sensor_ids == ("upper", "span", "lower", "stop")
    assert campaign.reference_s_m == 100
    assert campaign.track.s_m[1] == 100
    assert campaign.track.length_m == campaign.track.s_m[-1]
    assert [sensor.is_span for sensor in campaign.sensors] == [False, True, False, False]
    assert [sensor.is_runout for sensor in campaign.sensors] == [False, False, False, True]
    assert campaign.events[0].covariates == {"snow_temperature_degC": -3.5, "snow_type": "dry"}
    assert campaign.events[1].covariates == {"snow_temperature_degC": None, "snow_type": "wet"}
    assert campaign.events[1].release_sd_m is None
    # third/span and third/lower have no row
    assert campaign.status[2].tolist() == [Status.MISSING] * 4
    assert campaign.status[1].tolist() == [0, 1, 1, 0]
    np.testing.assert_allclose(campaign.reading_sd()[0], [np.sqrt(10), 3, 1, 10])
    assert campaign.reading_sd()[1, 3] == 20
    assert np.isnan(campaign.reading_sd()[2]).all()


def test_arrays_cannot_be_written_to(folder_with):
    campaign = read_campaign(folder_with({}))
    for array in (
        campaign.values,
        campaign.status,
        campaign.stated_sd,
        campaign.track.x_m,
        campaign.track.s_m,
    ):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


def test_a_campaign_pickles(folder_with):
    campaign = read_campaign(folder_with({}))
    assert pickle.loads(pickle.dumps(campaign)).fingerprint() == campaign.fingerprint()


def test_formatting_does_not_change_the_fingerprint(texts, folder_with):
    plain = read_campaign(folder_with({})).fingerprint()
    for change in (
        lambda text: "\ufeff" + text,
        lambda text: text.replace("\n", "\r\n"),
        lambda text: text + "\n \n\n",
    ):
        assert (
            read_campaign(folder_with({file: change(texts[file]) for file in FILES})).fingerprint() == plain
        )
    for spaced in (
        {file: texts[file].replace(",", " , ") for file in FILES[1:]},
        {file: texts[file].replace("first,", '"first", ').replace(",dry", ', "dry"') for file in FILES[1:]},
    ):
        assert read_campaign(folder_with(spaced)).fingerprint() == plain
    header, *rows = texts["recordings.csv"].splitlines()
    reversed_rows = "\n".join([header, *reversed(rows), "third,lower,,,missing"])
    assert read_campaign(folder_with({"recordings.csv": reversed_rows})).fingerprint() == plain
    changed = texts["recordings.csv"].replace("first,upper,30,", "first,upper,30.000000000000004,")
    assert read_campaign(folder_with({"recordings.csv": changed})).fingerprint() != plain


@pytest.mark.parametrize("file", FILES)
@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "missing"),
        (b"", "empty"),
        (b"\xef\xbb\xbf \n\n", "empty"),
        (b"a,b\n\0", "NUL"),
        (b"a,b\n\xff\xfe\n", "UTF-8"),
        ("x_m,z_m\n".encode("utf-16"), "NUL"),
        ("directory", "ordinary file"),
        ("pipe", "ordinary file"),
        ("link out", "leads out of the folder"),
        ("link to itself", "cannot be opened"),
    ],
)
def test_a_file_that_is_none(file, content, words, folder_with, tmp_path):
    folder = folder_with({})
    path = folder / file
    outside = tmp_path / "outside"
    outside.write_bytes(path.read_bytes())
    path.unlink()
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif content == "directory":
        path.mkdir()
    elif content == "pipe":
        os.mkfifo(path)
    elif content == "link out":
        path.symlink_to(outside)
    elif content == "link to itself":
        path.symlink_to(path)
    problem = only_problem(folder)
    assert problem.file == file
    assert words in problem.message


def test_a_link_inside_the_folder_is_fine(folder_with):
    folder = folder_with({})
    (folder / "track.csv").rename(folder / "profile.csv")
    (folder / "track.csv").symlink_to("profile.csv")
    assert read_campaign(folder).n_events == 3


def test_other_files_are_not_looked_at(folder_with):
    assert read_campaign(folder_with({"notes.csv": b"\0\xff"})).n_events == 3


def test_sizes_are_bounded(texts, folder_with):
    problem = only_problem(folder_with({"events.csv": texts["events.csv"] + " " * LARGEST_FILE_BYTES}))
    assert (problem.file, problem.row) == ("events.csv", None)
    further = "".join(f"{i},9,9\n" for i in range(301, 301 + MOST_ROWS))
    problem = only_problem(folder_with({"track.csv": texts["track.csv"] + further}))
    assert (problem.file, problem.row) == ("track.csv", MOST_ROWS + 2)
    header = "event,release_s_m," + ",".join(f"c{i}" for i in range(200))
    assert "columns" in only_problem(folder_with({"events.csv": header})).message
    long_field = texts["events.csv"].replace("dry", "d" * 200_000)
    assert only_problem(folder_with({"events.csv": long_field})).row == 2
    long_word = texts["events.csv"].replace("dry", "d" * 201)
    assert only_problem(folder_with({"events.csv": long_word})).column == "snow_type"


def test_only_headers(texts, folder_with):
    for file in ("track.csv", "sensors.csv", "events.csv"):
        header = texts[file].splitlines()[0]
        with pytest.raises(CampaignError) as caught:
            read_campaign(folder_with({file: header}))
        assert caught.value.problems[0].file == file
    header = texts["recordings.csv"].splitlines()[0]
    assert (read_campaign(folder_with({"recordings.csv": header})).status == Status.MISSING).all()


def test_what_is_shown_cannot_command_a_terminal(texts, folder_with):
    evil = "\x1b]0;owned\x07\u202e"
    folder = folder_with(
        {
            "campaign.toml": texts["campaign.toml"].replace("reference_s_m", '"\\u001b[2J"'),
            "sensors.csv": texts["sensors.csv"].replace("absolute_sd", evil),
            "events.csv": texts["events.csv"].replace("wet", evil),
            "recordings.csv": texts["recordings.csv"].replace("first,upper", f"{evil},upper"),
        }
    )
    with pytest.raises(CampaignError) as caught:
        read_campaign(folder)
    places = {(problem.file, problem.row) for problem in caught.value.problems}
    assert places == {("campaign.toml", None), ("sensors.csv", 1), ("events.csv", 3), ("recordings.csv", 2)}
    assert all(line.isprintable() for line in str(caught.value).splitlines())


def test_no_folder(tmp_path):
    for path in (tmp_path / "nowhere", tmp_path / ("x" * 5000)):
        assert "expected a folder" in only_problem(path).message


def test_write_round_trips_exactly(folder_with, tmp_path):
    campaign = read_campaign(folder_with({}))
    write_campaign(campaign, tmp_path / "copy")
    copy = read_campaign(tmp_path / "copy")
    assert copy.fingerprint() == campaign.fingerprint()
    assert copy.events == campaign.events
    assert sorted(path.name for path in (tmp_path / "copy").iterdir()) == sorted(FILES)
    for name in ("values", "status", "stated_sd"):
        np.testing.assert_array_equal(getattr(copy, name), getattr(campaign, name))
    write_campaign(copy, tmp_path / "copy of copy")
    for file in FILES:
        assert (tmp_path / "copy" / file).read_bytes() == (tmp_path / "copy of copy" / file).read_bytes()


def test_write_replaces_only_a_campaign_and_only_with_force(folder_with, tmp_path):
    folder = folder_with({"notes.txt": b"keep me"})
    campaign = read_campaign(folder)
    with pytest.raises(CampaignError, match="force"):
        write_campaign(campaign, folder)
    write_campaign(campaign, folder, force=True)
    assert (folder / "notes.txt").read_bytes() == b"keep me"
    other = tmp_path / "other"
    other.mkdir()
    (other / "thesis.tex").write_text("...")
    with pytest.raises(CampaignError, match="other than a campaign"):
        write_campaign(campaign, other, force=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["other", "small"], "nothing temporary is left"


def test_what_would_not_be_read_is_not_written(folder_with, tmp_path):
    from dataclasses import replace

    campaign = read_campaign(folder_with({}))
    values = campaign.values.copy()
    values[0, 0] = np.inf
    bad_event = replace(campaign.events[0], id=" first")
    for bad in (
        replace(campaign, values=values),
        replace(campaign, name="\x1b"),
        replace(campaign, events=(bad_event, *campaign.events[1:])),
    ):
        with pytest.raises(CampaignError):
            write_campaign(bad, tmp_path / "bad")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["small"]


def test_embedded_campaigns_are_found_anywhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ryggfonn").mkdir()
    assert read_campaign(find_campaign("ryggfonn")).n_events == 22
    assert find_campaign("./ryggfonn").resolve() == tmp_path / "ryggfonn"
    for name in ("rygfonn", "", "\0", "x" * 5000, "../data"):
        with pytest.raises(CampaignError, match="ryggfonn, ryggfonn-with-dam"):
            find_campaign(name)


def test_another_separator_is_told_once_with_the_way_in(texts, folder_with):
    tables = {file: text.replace(",", ";") for file, text in texts.items() if file.endswith(".csv")}
    with pytest.raises(CampaignError) as caught:
        read_campaign(folder_with(tables))
    [problem] = caught.value.problems
    assert problem.file == "track.csv" and "sensors.csv, events.csv, recordings.csv" in problem.message
    assert "skred import FOLDER --out" in problem.message
    with pytest.raises(CampaignError, match="events.csv, row 1.*: columns are separated by semicolons"):
        read_campaign(folder_with({"events.csv": tables["events.csv"]}))


def test_a_folder_of_results_is_told_in_one_line(tmp_path, folder_with):
    (tmp_path / "summary.json").write_text("{}", encoding="utf-8")
    problem = only_problem(tmp_path)
    assert "holds results of skred calibrate, not a campaign" in str(problem)
    campaign = folder_with({})
    (campaign / "summary.json").write_text("{}", encoding="utf-8")
    assert read_campaign(campaign).n_events == 3
