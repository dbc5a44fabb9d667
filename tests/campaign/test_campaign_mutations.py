"""Whatever is done to the files: a campaign that round-trips or a `CampaignError`, nothing taken silently."""

import csv
import io
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from skred.campaign import CampaignError, Status, read_campaign, write_campaign
from skred.campaign.rules import FASTEST_M_S

TABLES = ("track.csv", "sensors.csv", "events.csv", "recordings.csv")
FILES = ("campaign.toml", *TABLES)
FREE_FALL_M_S = 39.6  # to the uppermost sensor
QUICK = settings(
    derandomize=True,
    deadline=None,
    max_examples=120,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
CELLS = st.one_of(
    st.sampled_from(
        [
            "",
            " ",
            "nan",
            "inf",
            "1e400",
            "-1",
            "0",
            "1,5",
            "1_000",
            "1 000",
            "True",
            "None",
            "observed",
            "missing",
        ]
        + [
            "not_reached",
            "runout",
            "first",
            "upper",
            "'",
            '"',
            "\x1b[0m",
            "\r",
            "\n",
            ";",
            "１２",
            "=1+1",
            "-0.0",
        ]
    ),
    st.floats(allow_nan=False, allow_infinity=False).map(repr),
    st.floats(min_value=-50, max_value=400).map(repr),
    st.text(max_size=12),
)


def outcome(texts, write_files):
    """Read the files; return the campaign, which then must round-trip, or None after a CampaignError."""
    with tempfile.TemporaryDirectory() as place:
        folder = write_files(Path(place) / "mutated", texts)
        try:
            campaign = read_campaign(folder)
        except CampaignError as error:
            assert error.problems
            assert all(problem.file in FILES and problem.message for problem in error.problems)
            assert all(line.isprintable() for line in str(error).splitlines())
            return None
        write_campaign(campaign, Path(place) / "copy")
        assert read_campaign(Path(place) / "copy").fingerprint() == campaign.fingerprint()
        return campaign


def as_rows(text):
    return list(csv.reader(io.StringIO(text, newline="")))


def as_text(rows):
    text = io.StringIO(newline="")
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


@QUICK
@given(data=st.data())
def test_random_cells(data, texts, write_files):
    changed = dict(texts)
    for _ in range(data.draw(st.integers(1, 3))):
        file = data.draw(st.sampled_from(TABLES))
        rows = as_rows(changed[file])
        row = data.draw(st.integers(0, len(rows) - 1))
        column = data.draw(st.integers(0, len(rows[row]) - 1))
        rows[row][column] = data.draw(CELLS)
        changed[file] = as_text(rows)
    outcome(changed, write_files)


@QUICK
@given(data=st.data())
def test_dropped_doubled_and_moved_rows_and_columns(data, texts, write_files):
    file = data.draw(st.sampled_from(TABLES))
    rows = as_rows(texts[file])
    by_column = data.draw(st.booleans())
    if by_column:
        rows = [list(column) for column in zip(*rows, strict=True)]
    first = data.draw(st.integers(0, len(rows) - 1))
    second = data.draw(st.integers(0, len(rows) - 1))
    action = data.draw(st.sampled_from(["drop", "double", "swap", "shorten"]))
    if action == "drop":
        del rows[first]
    elif action == "double":
        rows.insert(second, list(rows[first]))
    elif action == "swap":
        rows[first], rows[second] = rows[second], rows[first]
    elif not by_column:
        rows[first].pop()
    if by_column:
        rows = [list(row) for row in zip(*rows, strict=True)]
    campaign = outcome({**texts, file: as_text(rows)}, write_files)
    if action == "double":
        assert campaign is None, "a row or column that appears twice is never taken silently"


@QUICK
@given(data=st.data())
def test_random_bytes(data, texts, write_files):
    file = data.draw(st.sampled_from(FILES))
    raw = texts[file].encode()
    start = data.draw(st.integers(0, len(raw)))
    end = data.draw(st.integers(start, min(len(raw), start + 20)))
    new = data.draw(
        st.one_of(st.binary(max_size=20), st.sampled_from([b"\0", b"\xff", b"\r", b"\xef\xbb\xbf", b'"']))
    )
    outcome({**texts, file: raw[:start] + new + raw[end:]}, write_files)


@QUICK
@given(raw=st.dictionaries(st.sampled_from(FILES), st.binary(max_size=200), max_size=5))
def test_files_of_nothing_but_bytes(raw, texts, write_files):
    outcome({**texts, **raw}, write_files)


@QUICK
@given(
    value=st.one_of(st.floats(allow_nan=False, allow_infinity=False), st.floats(0, 60)),
    form=st.sampled_from("regf"),
)
def test_a_value_that_is_taken_shows_in_the_result(value, form, texts, write_files):
    cell = repr(value) if form == "r" else format(value, f".17{form}")
    recordings = texts["recordings.csv"].replace("first,upper,30,", f"first,upper,{cell},")
    campaign = outcome({**texts, "recordings.csv": recordings}, write_files)
    if 0 <= value <= FREE_FALL_M_S and float(cell) >= 1e-300:
        assert campaign is not None
        assert campaign.values[0, 0] == float(cell)
        assert campaign.status[0, 0] == Status.OBSERVED
    elif value < 0 and float(cell) < 0 or value > FASTEST_M_S:
        assert campaign is None


@QUICK
@given(cell=CELLS)
def test_a_cell_that_is_no_plain_number_is_never_a_reading(cell, texts, write_files):
    recordings = as_rows(texts["recordings.csv"])
    recordings[1][2] = cell
    campaign = outcome({**texts, "recordings.csv": as_text(recordings)}, write_files)
    if campaign is not None:
        assert np.isfinite(campaign.values[0, 0])
        assert set(cell.strip()) <= set("0123456789+-.eE")


@pytest.mark.parametrize("file", FILES)
def test_a_file_cut_short_anywhere(file, texts, write_files):
    for end in range(0, len(texts[file]), 7):
        outcome({**texts, file: texts[file][:end]}, write_files)
