"""The embedded campaigns are what the raw figures and the documented decisions make them."""

import csv
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from skred.campaign import Status, find_campaign, read_campaign, write_campaign
from studies.ryggfonn.campaigns import SPLICE_X_M, build

ROOT = Path(__file__).resolve().parents[2]
RAW = ROOT / "data" / "ryggfonn" / "raw"
FILES = ("campaign.toml", "track.csv", "sensors.csv", "events.csv", "recordings.csv")


@pytest.fixture(scope="module")
def natural():
    return read_campaign(find_campaign("ryggfonn"))


@pytest.fixture(scope="module")
def with_dam():
    return read_campaign(find_campaign("ryggfonn-with-dam"))


def test_the_script_writes_the_committed_files(tmp_path):
    command = [sys.executable, "-m", "studies.ryggfonn.build_campaigns", "--out", str(tmp_path)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    for name in ("ryggfonn", "ryggfonn-with-dam"):
        for file in FILES:
            assert (tmp_path / name / file).read_bytes() == (ROOT / "data" / name / file).read_bytes(), file


def test_the_recordings_are_table_1(natural, with_dam):
    rows = list(csv.DictReader((RAW / "table1.csv").read_text().splitlines()))
    assert natural.event_ids == with_dam.event_ids == tuple(row["event"] for row in rows)
    for campaign, crown_s_m in ((natural, 1940.0), (with_dam, 1943.5)):
        assert campaign.reference_s_m == crown_s_m
        for i, row in enumerate(rows):
            for j, (column, zero) in enumerate(
                (("U_LC_m_s", 0), ("U_CD_m_s", 0), ("U_b_m_s", 0), ("l_r_m", crown_s_m))
            ):
                text, status, value = row[column], campaign.status[i, j], campaign.values[i, j]
                if text == "-":
                    assert status == Status.NOT_REACHED
                elif text == "":
                    assert status == Status.MISSING
                else:
                    assert (status, value) == (Status.OBSERVED, float(text) + zero)


def test_places_and_errors(natural, with_dam):
    for campaign in (natural, with_dam):
        offsets = [sensor.s_from_m - campaign.reference_s_m for sensor in campaign.sensors]
        np.testing.assert_allclose(offsets[:3], [-290, -130, -30], atol=1e-9)
        assert not any(sensor.is_span for sensor in campaign.sensors)
        runout_m = campaign.values[:, 3] - campaign.reference_s_m
        np.testing.assert_allclose(campaign.reading_sd()[:, 3], np.hypot(0.1 * runout_m, 12), atol=0.005)
        observed = campaign.status[:, :3] == Status.OBSERVED
        expected = np.hypot(0.1 * campaign.values[:, :3], 1)
        np.testing.assert_allclose(campaign.reading_sd()[:, :3][observed], expected[observed])
        before_the_dam = [e.id for e in campaign.events if e.covariates["dam_present"] == "no"]
        assert before_the_dam == ["19750225"]
        assert {event.release_s_m for event in campaign.events} == {0.0}


def test_the_crown_is_the_top_of_the_dam(with_dam):
    track = with_dam.track
    dam = (track.x_m > 1640) & (track.x_m < 1740)
    top_s_m = track.s_m[dam][np.argmax(track.z_m[dam])]
    assert abs(top_s_m - with_dam.reference_s_m) <= 0.05
    assert 644.5 <= track.z_m[dam].max() <= 645.1
    assert 13.5 < track.z_m[dam].max() - track.z_m[(track.x_m > 1600) & (track.x_m < 1676)].min() < 15.5


def test_the_splice_has_neither_jump_nor_kink(natural, with_dam):
    start_m, end_m = SPLICE_X_M
    after = with_dam.track.x_m >= end_m
    np.testing.assert_array_equal(with_dam.track.z_m[after], natural.track.z_m[after])
    near = (with_dam.track.x_m >= start_m - 8) & (with_dam.track.x_m <= end_m + 8)
    assert np.abs(with_dam.track.z_m - natural.track.z_m)[near].max() < 0.1
    slope = np.diff(with_dam.track.z_m[near]) / np.diff(with_dam.track.x_m[near])
    assert (slope < 0).all()
    # 4 m cells rounded to 0.01 m: 0.01 is twice the noise of rounding.
    assert np.abs(np.diff(slope)).max() < 0.021
    assert np.abs(np.diff(slope))[2:-2].max() < 0.01


def test_spans_that_were_not_crossed(natural, tmp_path):
    spans = build(RAW, spans=True)
    assert [sensor.is_span for sensor in spans.sensors] == [True, True, False, False]
    changed = {
        (spans.event_ids[i], spans.sensor_ids[j])
        for i, j in zip(*np.nonzero(spans.status != natural.status), strict=True)
    }
    assert changed == {
        ("19880315", "CD"), ("19890217", "CD"), ("20050416", "CD"), ("20030406", "CD"), ("19920311", "LC"),
    }  # fmt: skip
    write_campaign(spans, tmp_path / "spans")


def test_release_point_can_be_chosen():
    assert {event.release_s_m for event in build(RAW, release_s_m=50.0).events} == {50.0}
