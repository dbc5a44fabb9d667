"""What the dashboard is given: other versions, hostile files, nothing at all, and no packages."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5netcdf
import numpy as np
import pytest
from dashboard_cases import EVIL

from skred.cli.main import run
from skred.dashboard.answer import answer, entries
from skred.dashboard.page import body, in_script
from skred.dashboard.reading import read_given
from skred.errors import InputError


def test_titles_say_law_and_likelihood(given: Any) -> None:
    titles = [one.title for one in given.runs]
    assert titles == [
        "pcm (pcm, pooled)", "coulomb (coulomb, pooled)", "hierarchical (coulomb, hierarchical)",
        "diagnosis: diagnosis",
    ]  # fmt: skip
    assert not given.troubles


def test_another_version_is_told_and_the_others_are_shown(results: Path, older: Path) -> None:
    found = read_given([older, results / "coulomb"])
    assert [one.title for one in found.runs] == ["coulomb (coulomb, pooled)"]
    (trouble,) = found.troubles
    assert "another version" in trouble.message and "run the command" in trouble.message
    page = body(found, entries(found)) + answer(entries(found)[0], found)["html"]
    assert "summary.json" in page and "another version" in page


def test_a_tree_of_another_version_is_told(results: Path, tmp_path: Path) -> None:
    shutil.copytree(results / "diagnosis", tmp_path / "old")
    verdict = json.loads((tmp_path / "old" / "verdict.json").read_text())
    (tmp_path / "old" / "verdict.json").write_text(json.dumps({**verdict, "format": None}))
    found = read_given([tmp_path / "old"])
    assert not found.runs and "None instead of 1" in found.troubles[0].message


def test_a_comparison_shows_its_laws_and_is_checked(results: Path, tmp_path: Path) -> None:
    for law in ("pcm", "coulomb"):
        shutil.copytree(results / law, tmp_path / "both" / law)
    for number, n_runs in ((1, 2), (7, 0)):
        (tmp_path / "both" / "compare.json").write_text(json.dumps({"format": number}))
        found = read_given([tmp_path / "both"])
        assert len(found.runs) == n_runs and len(found.troubles) == (n_runs == 0)
    assert "format 7 instead of 1" in found.troubles[0].message


@pytest.mark.parametrize("content", [b"", b"no netCDF", b"\x89HDF\r\n\x1a\n" + bytes(200)])
def test_what_is_no_netcdf_is_told(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "x.nc").write_bytes(content)
    found = read_given([tmp_path])
    assert not found.runs and "not a netCDF file" in found.troubles[0].message
    (overview,) = entries(found)
    assert "x.nc" in answer(overview, found)["html"]


@pytest.mark.parametrize("text", ["[" * 100_000, "[]", '{"format": 1e999}', "\x00"])
def test_a_broken_document_is_told(text: str, results: Path, tmp_path: Path) -> None:
    shutil.copytree(results / "pcm", tmp_path / "broken")
    (tmp_path / "broken" / "summary.json").write_text(text)
    found = read_given([tmp_path / "broken"])
    assert not found.runs and "summary.json" in found.troubles[0].message


def test_nothing_at_all_is_bad_input(tmp_path: Path, capsys: Any) -> None:
    (tmp_path / "notes.txt").write_text("no result")
    for place in (tmp_path, tmp_path / "nowhere", tmp_path / "notes.txt"):
        assert run(["dashboard", str(place), "--export", str(tmp_path / "page.html")]) == 2
        told = capsys.readouterr().err
        assert str(place) in told and "Traceback" not in told
    assert run(["dashboard"]) == 2
    assert not (tmp_path / "page.html").exists()


def test_a_file_that_would_fill_the_memory_is_refused(tmp_path: Path) -> None:
    """A small file may hold a large tree."""
    with h5netcdf.File(tmp_path / "large.nc", "w") as file:
        group = file.create_group("posterior")
        group.dimensions = {"chain": 4, "draw": 10**9}
        group.create_variable("mu", ("chain", "draw"), np.float64, chunks=(1, 100_000), compression="gzip")
    assert (tmp_path / "large.nc").stat().st_size < 1_000_000
    found = read_given([tmp_path / "large.nc"])
    assert not found.runs and "more than 4 GB" in found.troubles[0].message


def test_names_from_a_file_are_shown_and_never_run(arviz_file: Callable[..., Path]) -> None:
    path = arviz_file("evil", f"{EVIL}{{{{7*7}}}}$$x$$", n_parameters=30)
    found = read_given([path])
    pages = [body(found, entries(found))]
    for entry in entries(found):
        made = answer(entry, found)
        assert "could not be made" not in made["html"], made["html"]
        pages += [made["html"], in_script(made["items"])]
    for page in pages:
        assert "<img" not in page
    # A page that takes a name for a part of its template would say 49; bokeh takes $$ for a formula.
    assert "&lt;img" in pages[0] and "{{7*7}}" in pages[0]
    assert "$$" not in "".join(pages)


@pytest.mark.parametrize("kind", ["cannot", "tie", "unexplained", "nothing"])
def test_every_kind_of_verdict_is_shown_whatever_its_names(kind: str, results: Path, tmp_path: Path) -> None:
    from diagnosis_report_cases import write_documents  # found once `results` is made

    text = "" if kind == "cannot" else f"{EVIL}$$x$$"
    write_documents(kind, tmp_path, text)
    found = read_given([tmp_path])
    assert not found.troubles
    for entry in entries(found):
        made = answer(entry, found)
        assert "could not be made" not in made["html"], made["html"]
        assert "<img" not in made["html"] and "$$" not in in_script(made["items"])


def test_many_parameters_are_shown_twelve_at_a_time(arviz_file: Callable[..., Path]) -> None:
    found = read_given([arviz_file("many", n_parameters=3000)])
    (run_,) = found.runs
    assert len(run_.all_labels) == 500 and len(run_.parameters().data_vars) == 12
    trace = next(entry for entry in entries(found) if entry.key == "trace-r1")
    assert len(answer(trace, found)["items"]) == 12


def test_a_missing_package_is_told_with_the_command(monkeypatch: Any, results: Path, capsys: Any) -> None:
    monkeypatch.setitem(sys.modules, "panel", None)  # what import takes for a package that is not there
    assert run(["dashboard", str(results / "pcm")]) == 2
    told = capsys.readouterr().err
    assert '\n  python -m pip install "panel>=1.10"\n' in told
    assert "\n  python -m uv sync --extra dashboard\n" in told


def test_a_page_needs_a_name_and_a_folder(results: Path, tmp_path: Path) -> None:
    from skred.dashboard.export import check_target

    for file in (tmp_path / "page.txt", tmp_path / "nowhere" / "page.html", tmp_path):
        with pytest.raises(InputError, match="--export"):
            check_target(file)


def test_a_page_that_is_there_is_replaced_by_force_only(results: Path, tmp_path: Path, capsys: Any) -> None:
    page = tmp_path / "page.html"
    page.write_text("mine", encoding="utf-8")
    asked = ["dashboard", str(results / "pcm"), "--export", str(page), "--quiet"]
    assert run(asked) == 2
    assert "is there already; choose another, or --force to replace it" in capsys.readouterr().err
    assert page.read_text(encoding="utf-8") == "mine"
    assert run([*asked, "--force"]) == 0
    assert page.stat().st_size > 100_000
