"""Any campaign, saved in any dialect, is imported as itself."""

from __future__ import annotations

import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from import_cases import TRACK, in_dialect, written

from skred.campaign import Campaign, Event, Sensor, Status, Track, read_campaign, write_campaign
from skred.errors import InputError
from skred.importing import Files, Mapping, Unclear, import_tables, write_imported

WORDS = st.text(
    st.characters(codec="latin-1", categories=["L", "N", "P", "S"]), min_size=1, max_size=12
).filter(lambda text: not text.startswith(('"', "=")))
METRES = st.decimals(0, 200, places=3).map(float)
SPEEDS = st.one_of(st.integers(1, 60).map(float), st.floats(0.5, 60))


@st.composite
def campaigns(draw: Any) -> Campaign:
    """Campaigns of every kind of reading on a straight slope, no speed above a free fall."""
    x_m = np.array([0.0, *np.cumsum(draw(st.lists(st.floats(200, 500), min_size=5, max_size=8)))])
    track = Track(x_m, 4000.0 - 0.75 * x_m)
    length = track.length_m
    ids = draw(st.lists(WORDS, min_size=2, max_size=4, unique=True))
    places = [draw(st.floats(0.35 * length, 0.4 * length)) for _ in ids[1:]]
    sensors = [
        Sensor(one, "front_velocity", at, at, 0.1, 1.0) for one, at in zip(ids[1:], places, strict=True)
    ]
    sensors.append(Sensor(ids[0], "runout", np.nan, np.nan, 0.0, draw(st.floats(1, 30))))
    names = draw(st.lists(WORDS, min_size=1, max_size=4, unique=True))
    events = [
        Event(
            name,
            0.0,
            draw(st.one_of(st.none(), st.floats(1, 20))),
            {"volume_m3": draw(SPEEDS), "kind": "dry"},
        )
        for name in names
    ]
    shape = len(events), len(sensors)
    status = np.array([[draw(st.sampled_from((0, 2))) for _ in sensors] for _ in events]).reshape(shape)
    values = np.array([[draw(SPEEDS) for _ in sensors] for _ in events]).reshape(shape)
    values[:, -1] = [draw(st.floats(0.5 * length, length)) for _ in events]
    values = np.where(status == Status.OBSERVED, values, np.nan)
    stated = np.full(shape, np.nan)
    return Campaign(
        "any", "", "", "measured", None, track, tuple(sensors), tuple(events), values, status, stated
    )


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    campaign=campaigns(),
    separator=st.sampled_from([";", ",", "\t", "|"]),
    decimal=st.sampled_from([",", "."]),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "latin-1"]),
    newline=st.sampled_from(["\n", "\r\n"]),
)
def test_any_campaign_in_any_dialect(
    campaign: Campaign, separator: str, decimal: str, encoding: str, newline: str
) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_campaign(campaign, folder / "plain")
        texts = {file.name: file.read_text(encoding="utf-8") for file in (folder / "plain").iterdir()}
        assume(encoding != "latin-1" or not any(map(is_utf_8_too, texts.values())))
        how = {"separator": separator, "decimal": decimal, "encoding": encoding, "newline": newline}
        other = in_dialect(texts, folder / "other", **how)
        imported = answered(Files([other]), {"encoding": encoding, "decimal": decimal})
        write_imported(imported, folder / "out")
        assert read_campaign(folder / "out").fingerprint() == campaign.fingerprint()


def is_utf_8_too(text: str) -> bool:
    """Whether a text's bytes in Latin-1 are another text in UTF-8: nothing in such a file tells which."""
    with suppress(UnicodeError):
        return text.encode("latin-1").decode("utf-8") != text
    return False


def answered(files: Files, answers: dict[str, str]) -> Any:
    """Import, with nothing declared but what is asked about."""
    declared = Mapping()
    for _ in range(6):
        try:
            return import_tables(files, declared)
        except Unclear as unclear:
            asked = {question.key: answers[question.key[1]] for question in unclear.questions}
            declared = declared.with_values(asked)
    raise AssertionError("asked for ever")


CELLS = st.one_of(
    st.sampled_from(
        ["", "-", "30,5", "30.5", "1,234", ">= 3", "5 ± 2", "n/a", "1e999", "NaN", "\u0661", "2\n3", "=1"]
    ),
    st.text(max_size=8),
)


@settings(max_examples=150, deadline=None)
@given(
    rows=st.lists(st.lists(CELLS, min_size=1, max_size=4), min_size=1, max_size=5),
    separator=st.sampled_from([";", ",", "\t"]),
    prefix=st.sampled_from([b"", b"\xef\xbb\xbf", b"\xff\xfe", b"PK\x03\x04", b"\xe4"]),
)
def test_any_table_is_read_or_told(rows: list[list[str]], separator: str, prefix: bytes) -> None:
    header = ["event", "v [m/s]", "runout", "volume"]
    with tempfile.TemporaryDirectory() as name:
        file, track = Path(name) / "table.csv", Path(name) / "track.csv"
        file.write_bytes(prefix + written([header, *rows], separator).encode("utf-8", "replace"))
        track.write_text(TRACK)
        declared = Mapping.model_validate(
            {
                "columns": {
                    "v [m/s]": {"is": "front_velocity", "at": 100, "relative_sd": 0.1, "absolute_sd": 1},
                    "volume": {"is": "covariate", "name": "volume_m3"},
                },
                "velocity": {"unit": "m/s"},
                "runout": {"place": "altitude", "absolute_sd": 10},
                "release": {"s_m": 0},
                "cells": {"blank": "missing", "dash": "not_reached", "words": {"n/a": "missing"}},
            }
        )
        try:
            imported = import_tables(Files([file], track=track), declared)
        except InputError as error:
            assert str(error).isprintable() or "\n" in str(error)
            assert str(error)
        else:
            assert imported.campaign.n_events == len(imported.draft.events.rows)
