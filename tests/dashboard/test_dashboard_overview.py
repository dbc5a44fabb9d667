"""The overview: what converged, and nothing of a damaged file that takes the rest of the page."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import dashboard_cases  # noqa: F401  (skips where the extra is not installed)
import pytest

from skred.dashboard.answer import answer, entries
from skred.dashboard.reading import Given, read_given


def made(found: Given, key: str = "overview") -> str:
    """Markup of a view."""
    (entry,) = [one for one in entries(found) if one.key == key]
    return str(answer(entry, found)["html"])


def changed(folder: Path, to: Path, **entries_: Any) -> Path:
    """A copy of a diagnosis with other entries in its verdict."""
    shutil.copytree(folder, to)
    verdict = json.loads((to / "verdict.json").read_text()) | entries_
    (to / "verdict.json").write_text(json.dumps(verdict))
    return to


@pytest.mark.parametrize(("converged", "told"), [(True, "yes"), (False, "NO"), (None, "not said")])
def test_converged_of_a_diagnosis_is_whether_its_chains_did(
    converged: bool | None, told: str, results: Path, tmp_path: Path
) -> None:
    diagnostics = {"r_hat_max": 1.0049, "ess_min": 715.8}
    folder = changed(results / "diagnosis", tmp_path / "copy", converged=converged, diagnostics=diagnostics)
    html = made(read_given([folder]))
    numbers = " (r-hat 1.005, ess 716)" if converged is not None else ""
    assert f'<td class="text">{told}{numbers}</td>' in html
    assert "probability 0." not in html.partition("<table>")[2]


def test_a_number_beyond_all_floats_is_no_number(
    results: Path, older: Path, tree_copy: Any, tmp_path: Path
) -> None:
    """JSON takes a whole number of any length; no format and no figure does."""
    huge = 10**400
    diagnostics = {"r_hat_max": huge, "ess_min": huge}
    folder = changed(
        results / "diagnosis",
        tmp_path / "copy",
        diagnostics=diagnostics,
        probability={"nothing": huge, "x": 0.4},
    )
    file = tree_copy(
        results / "pcm" / "posterior.nc",
        gate=json.dumps({"passed": True, "r_hat_max": huge, "ess_bulk_min": huge}),
    )
    found = read_given([folder, file, older])
    html = made(found)
    assert "could not be made" not in html and "another version" in html
    assert html.count('<td class="text">yes</td>') == 2
    assert "could not be made" not in made(found, "candidates-r1")
