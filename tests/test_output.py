"""Where results may go, and that they are never half written."""

from __future__ import annotations

import json
import resource
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from skred.errors import InputError
from skred.output import left_by, output_folder, plain, results_folder, write_json, write_text


def write(out: Path | None, files: dict[str, str], command: str = "compare", *, force: bool = False) -> Path:
    """A run that writes some files; returns where they are."""
    with results_folder(out, command, force=force) as results:
        for name, text in files.items():
            (results.unfinished / name).parent.mkdir(parents=True, exist_ok=True)
            (results.unfinished / name).write_text(text)
    return results.path


def files_of(folder: Path) -> dict[str, str]:
    """What a person finds there."""
    return {
        str(file.relative_to(folder)): file.read_text()
        for file in folder.rglob("*")
        if file.is_file() and not file.name.startswith(".skred")
    }


def test_a_new_folder_is_made_with_its_parents(tmp_path: Path) -> None:
    out = tmp_path / "a" / "b"
    assert write(out, {"compare.json": "1", "pcm/posterior.nc": "2"}) == out
    assert files_of(tmp_path) == {"a/b/compare.json": "1", "a/b/pcm/posterior.nc": "2"}
    assert output_folder(tmp_path / "c" / "d", "prove").is_dir()


def test_an_empty_folder_is_taken(tmp_path: Path) -> None:
    assert output_folder(tmp_path, "prove") == tmp_path
    assert write(tmp_path, {"compare.json": "1"}) == tmp_path


@pytest.mark.parametrize("name", ["posterior.nc", ".hidden"])
def test_a_folder_with_files_needs_force(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("precious")
    with pytest.raises(InputError, match="--force"):
        write(tmp_path, {"a": "new"})
    with pytest.raises(InputError, match="holds files"):
        output_folder(tmp_path, "prove")
    assert files_of(tmp_path) == {name: "precious"}
    write(tmp_path, {"a": "new"}, force=True)
    assert files_of(tmp_path) == {name: "precious", "a": "new"}


@pytest.mark.parametrize("force", [False, True])
def test_a_file_in_the_way_is_never_replaced(tmp_path: Path, force: bool) -> None:
    file = tmp_path / "out"
    file.write_text("precious")
    with pytest.raises(InputError, match="expected a folder"):
        write(file, {"a": "new"}, force=force)
    assert file.read_text() == "precious"


def test_a_folder_in_the_way_is_never_replaced(tmp_path: Path) -> None:
    (tmp_path / "report.html").mkdir()
    (tmp_path / "report.html" / "notes").write_text("precious")
    with pytest.raises(InputError, match="move it away") as told:
        write(tmp_path, {"a": "new", "report.html": "new"}, force=True)
    assert (tmp_path / "report.html" / "notes").read_text() == "precious" and not (tmp_path / "a").exists()
    left = left_by(told.value)
    assert left is not None and files_of(left) == {"a": "new", "report.html": "new"}


def test_without_a_name_every_run_has_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    folders = [write(None, {"a": "1"}) for _ in range(3)] + [output_folder(None, "compare")]
    assert len(set(folders)) == 4
    for folder in folders:
        assert folder.parent == Path("skred-out") and folder.name.startswith("compare-") and folder.is_dir()


def test_new_results_replace_those_of_the_same_command_only(tmp_path: Path) -> None:
    write(tmp_path, {"compare.json": "1", "pcm/posterior.nc": "1", "coulomb/posterior.nc": "1"})
    write(tmp_path, {"identify.json": "1"}, "identify", force=True)
    (tmp_path / "coulomb" / "notes.txt").write_text("precious")
    (tmp_path / "pcm" / "notes").symlink_to(tmp_path / "coulomb")
    (tmp_path / "voellmy").mkdir()
    write(tmp_path, {"compare.json": "2", "voellmy/posterior.nc": "2"}, force=True)
    assert files_of(tmp_path) == {
        "compare.json": "2",
        "voellmy/posterior.nc": "2",
        "identify.json": "1",
        "coulomb/notes.txt": "precious",
    }
    (tmp_path / "pcm" / "notes").unlink()
    write(tmp_path, {"compare.json": "3"}, force=True)
    assert not (tmp_path / "voellmy").exists(), "an empty folder of ours is left"


@pytest.mark.parametrize("file", ["../precious", "/precious", "link/precious"])
def test_nothing_outside_is_removed(tmp_path: Path, file: str) -> None:
    """Whatever a folder from elsewhere says of its files."""
    out, precious = tmp_path / "out", tmp_path / "precious"
    precious.write_text("precious")
    write(out, {"a": "1"})
    (out / "link").symlink_to(tmp_path)
    listed = str(precious) if file.startswith("/") else file
    write_json(out / ".skred-written.json", {"compare": [listed, "a"]})
    write(out, {"b": "2"}, force=True)
    assert precious.read_text() == "precious" and not (out / "a").exists()


@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError, InputError, ZeroDivisionError])
def test_a_run_that_fails_leaves_earlier_results_whole(tmp_path: Path, error: type[BaseException]) -> None:
    write(tmp_path, {"verdict.json": "old", "figure.png": "old"})
    with pytest.raises(error) as told, results_folder(tmp_path, "compare", force=True) as results:
        (results.unfinished / "verdict.json").write_text("new")
        (results.unfinished / ".figure.png.partial").write_text("ha")
        raise error
    left = left_by(told.value)
    assert left is not None and files_of(left) == {"verdict.json": "new"}
    (left / "verdict.json").unlink()
    assert files_of(tmp_path) == {"verdict.json": "old", "figure.png": "old"}
    write(tmp_path, {"verdict.json": "newer"}, force=True)
    assert files_of(tmp_path) == {"verdict.json": "newer"} and not left.exists()


@pytest.mark.parametrize("out", [None, Path("a/b")])
def test_a_run_that_writes_nothing_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, out: Path | None
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError) as told, results_folder(out, "compare"):
        raise InputError("lock more than there are")
    assert list(tmp_path.iterdir()) == [] and left_by(told.value) is None


def test_a_run_that_failed_is_no_reason_for_force(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), results_folder(tmp_path, "compare") as results:
        (results.unfinished / "a").write_text("1")
        raise KeyboardInterrupt
    write(tmp_path, {"a": "2"})
    assert files_of(tmp_path) == {"a": "2"}


KILLED = """
import os, signal, sys
from pathlib import Path
from skred.output import results_folder

real, times = os.replace, int(sys.argv[2])

def replace(*paths):
    global times
    if times == 0:
        os.kill(os.getpid(), signal.SIGKILL)
    times -= 1
    real(*paths)

with results_folder(Path(sys.argv[1]), "compare", force=True) as results:
    for name in ("a", "b", "c"):
        (results.unfinished / name).write_text("new")
    if times < 0:
        os.kill(os.getpid(), signal.SIGKILL)
    os.replace = replace
"""


@pytest.mark.parametrize("times", [-1, 0, 1, 2, 3, 4])
def test_a_killed_run_leaves_old_or_new_results(tmp_path: Path, times: int) -> None:
    """Killed while it writes, or at any move: the old ones stay, or the next run makes the new ones whole."""
    old, new = dict.fromkeys("abx", "old"), dict.fromkeys("abc", "new")
    write(tmp_path, old)
    done = subprocess.run([sys.executable, "-c", KILLED, str(tmp_path), str(times)], check=False, timeout=60)
    assert done.returncode == -9
    if times <= 0:
        assert files_of(tmp_path) == old | {
            name: text for name, text in files_of(tmp_path).items() if name.startswith(".")
        }
    with pytest.raises(InputError, match="--force"):
        write(tmp_path, {"a": "newest"})  # which has made what was whole complete
    shutil.rmtree(tmp_path / ".skred-unfinished", ignore_errors=True)
    assert files_of(tmp_path) == (old if times <= 0 else new)
    write(tmp_path, {"a": "newest"}, force=True)
    assert files_of(tmp_path) == {"a": "newest"}


def test_one_run_at_a_time(tmp_path: Path) -> None:
    with (
        results_folder(tmp_path, "compare") as results,
        pytest.raises(InputError, match="another run"),
    ):
        (results.unfinished / "a").write_text("1")
        write(tmp_path, {"a": "2"}, force=True)
    assert files_of(tmp_path) == {"a": "1"}


def test_text_is_whole_or_not_there(tmp_path: Path) -> None:
    file = tmp_path / "summary.json"
    write_text(file, "first")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))  # as a full disk does
    try:
        with pytest.raises(OSError, match="large"):
            write_text(file, 2000 * "2")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert file.read_text() == "first"
    assert [path.name for path in tmp_path.iterdir()] == ["summary.json"]
    write_text(file, "second")
    assert file.read_text() == "second"


def test_json_knows_no_nan(tmp_path: Path) -> None:
    document = {
        "nan": float("nan"),
        "infinite": [np.inf, -np.inf, 1.0],
        "array": np.array([[1.5, np.nan]]),
        "numbers": (np.float64(2.5), np.int64(3), np.bool_(True)),
        "none": None,
        7: "seven",
    }
    write_json(tmp_path / "a.json", document)

    def refuse(word: str) -> None:
        raise AssertionError(word)

    assert json.loads((tmp_path / "a.json").read_text(), parse_constant=refuse) == {
        "nan": None,
        "infinite": [None, None, 1.0],
        "array": [[1.5, None]],
        "numbers": [2.5, 3, True],
        "none": None,
        "7": "seven",
    }


def test_what_json_cannot_hold_is_an_error_and_writes_nothing(tmp_path: Path) -> None:
    with pytest.raises(TypeError):
        write_json(tmp_path / "a.json", {"a": object()})
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("value", [1, 1.5, "a", None, True])
def test_plain_values_stay(value: Any) -> None:
    assert plain(value) is value
