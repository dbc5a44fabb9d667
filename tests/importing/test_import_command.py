"""`skred import` as a person uses it: shows before it writes, asks at a terminal, writes all or nothing."""

from __future__ import annotations

import json
import os
import pty
import select
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from import_cases import COLUMNS, in_dialect, options, skred, wide_file, without_bounds
from small_campaign import TEXTS, write_texts

from skred.campaign import read_campaign
from skred.campaign.writing import write_files

ANSWERS = (
    *("front_velocity at=here", "front_velocity at=100 unit=m/s", "front_velocity at=250 unit=m/s"),
    *("0.1", "1", "10", "0", "not_reached", "missing"),
)
"""In the order of the questions; the first cannot be used."""


class Terminal:
    """A command at a terminal of its own."""

    def __init__(self, *arguments: object) -> None:
        self.end, inner = pty.openpty()
        environment = {**os.environ, "COLUMNS": "200", "TERM": "dumb", "NO_COLOR": "1"}
        command = [sys.executable, "-m", "skred.cli", *map(str, arguments)]
        self.process = subprocess.Popen(
            command, stdin=inner, stdout=inner, stderr=inner, env=environment, start_new_session=True,
            # As in a terminal, however the tests were started: what runs in the background has it ignored.
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        )  # fmt: skip
        os.close(inner)
        self.said = ""

    def wait_for(self, text: str, seconds: float = 60) -> None:
        """Read until a text was said since the last call."""
        start, until = len(self.said), time.monotonic() + seconds
        while text not in self.said[start:]:
            assert time.monotonic() < until, self.said
            if select.select([self.end], [], [], 0.2)[0]:
                try:
                    self.said += os.read(self.end, 65536).decode(errors="replace")
                except OSError:
                    break
        assert text in self.said[start:], self.said

    def answer(self, text: str) -> None:
        os.write(self.end, f"{text}\n".encode())

    def close(self, seconds: float = 60, sending: signal.Signals | None = None) -> int:
        """Its exit code, once it has said everything; a signal is repeated, as a person repeats it.

        One that comes between a prompt and the reading of its answer is seen only after that reading.
        """
        until = time.monotonic() + seconds
        again = time.monotonic()
        while time.monotonic() < until:
            if sending is not None and time.monotonic() >= again and self.process.poll() is None:
                self.process.send_signal(sending)
                again += 5
            if select.select([self.end], [], [], 0.5)[0]:
                try:
                    content = os.read(self.end, 65536)
                except OSError:
                    break
                if not content:
                    break
                self.said += content.decode(errors="replace")
        if time.monotonic() >= until:
            self.process.kill()
        code = self.process.wait(seconds)
        os.close(self.end)
        return code


def test_everything_is_asked_at_a_terminal(tmp_path: Path, track: Path) -> None:
    out = tmp_path / "out"
    terminal = Terminal("import", wide_file(tmp_path, without_bounds()), "--track", track, "--out", out)
    for text in ANSWERS:
        terminal.wait_for("answer")
        terminal.answer(text)
    terminal.wait_for("Is this right?")
    assert not out.exists()
    terminal.answer("y")
    assert terminal.close() == 0, terminal.said
    assert "found 'here'" in terminal.said
    campaign = read_campaign(out)
    assert campaign.sensor_ids == ("v upper", "v lower", "runout")
    assert [sensor.s_from_m for sensor in campaign.sensors[:2]] == [100.0, 250.0]


@pytest.mark.parametrize("how", ["no", "ctrl-c", "end"])
def test_without_a_yes_nothing_is_written(how: str, tmp_path: Path, track: Path) -> None:
    before = sorted(tmp_path.iterdir())
    file = wide_file(tmp_path, without_bounds())
    rest = [one for one in options() if one not in ("--yes", "--quiet")]
    terminal = Terminal("import", file, "--track", track, *rest, "--out", tmp_path / "deep" / "out")
    terminal.wait_for("Is this right?")
    if how != "ctrl-c":
        terminal.answer("n" if how == "no" else "\x04")
    assert terminal.close(sending=signal.SIGINT if how == "ctrl-c" else None) == (
        130 if how == "ctrl-c" else 2
    ), terminal.said
    assert "Traceback" not in terminal.said
    assert sorted(tmp_path.iterdir()) == sorted([*before, file])


def test_shows_and_writes_nothing_without_out(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "160")
    before = wide_file(tmp_path, without_bounds()), track
    rest = [one for one in options() if one not in ("--yes", "--quiet")]
    code, out, err = skred(capsys, "import", before[0], "--track", track, *rest)
    assert (code, err) == (0, "")
    assert "UTF-8, comma, decimal point, 3 rows" in out
    assert "front velocity, sensor upper at s = 100 m, sd 10 % and 1 m/s" in out
    assert "covariate volume_m3" in out and "taken from its name" in out
    assert "1999-02-03" in out and "320.5" in out and "not reached" in out
    assert "nothing was written; add --out FOLDER" in out
    assert sorted(tmp_path.iterdir()) == sorted(before)


def test_what_was_only_recognised_needs_a_yes(
    tmp_path: Path, track: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rest = [one for one in options() if one != "--yes"]
    arguments = [
        "import",
        wide_file(tmp_path, without_bounds()),
        "--track",
        track,
        *rest,
        "--out",
        tmp_path / "out",
    ]
    code, _, err = skred(capsys, *arguments)
    assert code == 2 and "'Date', 'Runout s [m]'" in err and "add --yes" in err
    assert not (tmp_path / "out").exists()
    said = (
        "Date=event",
        "Runout s [m]=runout place=s",
        "Volume [m3]=covariate name=volume_m3",
        "Snow=ignore",
    )
    declared = [word for column in (*said, *COLUMNS) for word in ("--column", column)]
    code, _, err = skred(capsys, *arguments, *declared)
    assert (code, err) == (0, "")


def test_what_is_there_is_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = in_dialect(TEXTS, tmp_path / "in")
    out = tmp_path / "out"
    assert skred(capsys, "import", folder, "--out", out)[0] == 0
    (out / "notes.txt").write_text("mine")
    before = {file.name: file.read_bytes() for file in out.iterdir()}
    code, _, err = skred(capsys, "import", folder, "--out", out)
    assert code == 2 and "--force" in err
    (folder / "recordings.csv").write_text("nonsense")
    assert skred(capsys, "import", folder, "--out", out, "--force")[0] == 2
    assert {file.name: file.read_bytes() for file in out.iterdir()} == before
    in_dialect(TEXTS, folder)
    assert skred(capsys, "import", folder, "--out", out, "--force")[0] == 0
    assert (out / "notes.txt").read_text() == "mine"
    other = tmp_path / "other"
    other.mkdir()
    (other / "thesis.doc").write_text("mine")
    code, _, err = skred(capsys, "import", folder, "--out", other, "--force")
    assert code == 2 and [file.name for file in other.iterdir()] == ["thesis.doc"]


def test_an_interruption_while_writing_leaves_nothing(tmp_path: Path) -> None:
    def interrupted(folder: Path) -> None:
        assert (folder / "campaign.toml").is_file()
        raise KeyboardInterrupt

    write_texts(tmp_path / "old", TEXTS)
    for target in (tmp_path / "deep" / "new", tmp_path / "old"):
        with pytest.raises(KeyboardInterrupt):
            write_files({"campaign.toml": "new"}, target, force=True, check=interrupted)
    assert [file.name for file in tmp_path.iterdir()] == ["old"]
    assert (tmp_path / "old" / "campaign.toml").read_text() == TEXTS["campaign.toml"]


def test_json_tells_the_same(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = in_dialect(TEXTS, tmp_path / "in")
    code, out, _ = skred(capsys, "import", folder, "--json")
    document = json.loads(out)
    assert code == 0 and document["out"] is None and document["campaign"]["events"] == 3
    assert {"column": "value", "cells": 6}.items() <= next(
        column for column in document["columns"] if column["column"] == "value"
    ).items()


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ([], "no files"),
        (["nowhere.csv"], "there is no such file"),
        (["{folder}"], "the folder holds none of"),
        (["{table}", "{table}"], "given twice"),
        (["{table}"], "add --track FILE"),
        (["{table}", "--track", "{folder}"], "empty: expected an ordinary file"),
        (["{table}", "--track", "."], "  .: expected an ordinary file"),
        (["{table}", "--mapping", "."], "  .: expected an ordinary file"),
        (["{campaign}", "{table}"], "a wide table beside events or recordings"),
        (["{campaign}", "{campaign}"], "given twice"),
        (["{campaign}/events.csv"], "was not given"),
    ],
)
def test_bad_use_is_told(
    arguments: list[str], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    places = {"folder": empty, "table": wide_file(tmp_path), "campaign": write_texts(tmp_path / "in", TEXTS)}
    code, _, err = skred(capsys, "import", *(one.format(**places) for one in arguments))
    assert code == 2 and told in err, err


def test_a_link_out_of_the_folder_is_not_followed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = write_texts(tmp_path / "in", TEXTS)
    (folder / "events.csv").rename(tmp_path / "events.csv")
    (folder / "events.csv").symlink_to(tmp_path / "events.csv")
    code, _, err = skred(capsys, "import", folder)
    assert code == 2 and "events.csv: the file lies outside the folder" in err
