"""`skred validate` as a person calls it."""

import json
import subprocess
import sys
import time

import pytest


def skred(*arguments, **options):
    started = time.monotonic()
    done = subprocess.run(
        [sys.executable, "-m", "skred.cli", *arguments],
        capture_output=True,
        text=True,
        timeout=60,
        **options,
    )
    assert "Traceback" not in done.stdout + done.stderr
    return done, time.monotonic() - started


def test_a_good_campaign():
    done, _ = skred("validate", "ryggfonn")
    assert done.returncode == 0
    assert "22" in done.stdout
    assert "78 observed, 7 not reached, 3 missing" in done.stdout
    assert "no problems" in done.stdout and "3 of front speed, and the runout" in done.stdout
    assert done.stderr == ""


def test_json_and_quiet():
    done, _ = skred("validate", "ryggfonn-with-dam", "--json")
    document = json.loads(done.stdout)
    assert done.returncode == 0
    assert document["valid"] is True
    assert document["reference_s_m"] == 1943.5
    done, _ = skred("validate", "ryggfonn", "--quiet")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_warnings_are_counted_and_unknown_covariates_too(texts, folder_with):
    """What only looks odd is told below the table, which does not say that there is nothing."""
    track = texts["track.csv"].replace("x_m,z_m\n0,", "x_m,z_m\n1,")
    events = texts["events.csv"].splitlines()
    events = [events[0] + ",size_1", *(f"{line},{'' if k else 3}" for k, line in enumerate(events[1:]))]
    folder = folder_with({"track.csv": track, "events.csv": "\n".join(events)})
    done, _ = skred("validate", str(folder))
    assert done.returncode == 0 and "no problems" not in done.stdout
    assert "can be read; 1 warning below" in done.stdout and done.stdout.count("warning: ") == 1
    assert "size_1 (known for 1)" in done.stdout


def test_a_bad_campaign(texts, folder_with):
    broken = (
        texts["recordings.csv"].replace("upper,30", "upper,-30").replace("third,stop", "\x1b[31m[bold],stop")
    )
    folder = folder_with({"recordings.csv": broken})
    done, _ = skred("validate", str(folder))
    assert done.returncode == 2
    assert "recordings.csv, row 2, column value" in done.stderr
    assert "2 problems" in done.stderr
    assert "\x1b" not in done.stderr
    done, _ = skred("validate", str(folder), "--json")
    document = json.loads(done.stdout)
    assert done.returncode == 2
    assert document["valid"] is False
    assert [problem["row"] for problem in document["problems"]] == [2, 11]


@pytest.mark.parametrize(
    "arguments",
    [
        ("validate",),
        ("validate", "nowhere"),
        ("validate", ""),
        ("validate", "ryggfonn", "more"),
        ("validate", "ryggfonn", "--wrong"),
        ("validte",),
        ("--wrong",),
    ],
)
def test_bad_use_ends_with_2(arguments):
    done, _ = skred(*arguments)
    assert done.returncode == 2
    assert done.stderr


@pytest.mark.parametrize(
    "arguments",
    [("--help",), ("validate", "--help"), ("import", "--help"), ("init", "--help"), ("--version",), ()],
)
def test_help_needs_no_heavy_imports(arguments):
    code = (
        "import sys; from skred.cli.main import run; code = run(sys.argv[1:]); "
        "heavy = {'numpy', 'pandas', 'pydantic', 'pymc', 'numba', 'scipy'} & set(sys.modules); "
        "sys.exit(f'imported {heavy}' if heavy else code)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr


def test_output_that_cannot_be_written():
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "skred.cli", "validate", "ryggfonn"],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
        )
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
