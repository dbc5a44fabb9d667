"""The table of events: all of them, with the readings of their own campaign."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import dashboard_cases  # noqa: F401  (skips where the extra is not installed)
import numpy as np
import xarray as xr
from markupsafe import escape

from skred.dashboard.answer import answer, entries
from skred.dashboard.page import body
from skred.dashboard.reading import Given, read_given

Groups = dict[str, xr.Dataset]


def made(found: Given) -> str:
    (entry,) = [one for one in entries(found) if one.key == "events"]
    return str(answer(entry, found)["html"])


def rows_of(table: str) -> list[str]:
    return re.findall(r"<tr data-event=\"[^\"]*\"><th>.*?</tr>", table)


def many_events(n: int) -> Groups:
    rng = np.random.default_rng(2)
    of_events = (("chain", "draw", "event"), rng.normal(size=(2, 20, n)))
    return {
        "posterior": xr.Dataset({"mu": (("chain", "draw"), rng.normal(size=(2, 20)))}),
        "log_likelihood": xr.Dataset({"y": of_events}),
        "observed_data": xr.Dataset({"y": ("event", rng.normal(size=n))}),
    }


def test_what_is_left_out_of_the_table_is_told(tree_file: Callable[..., Path]) -> None:
    found = read_given([tree_file("few", **many_events(450))])
    assert len(rows_of(made(found))) == 450 and "Only the first" not in made(found)
    found = read_given([tree_file("many", **many_events(1450))])
    html = made(found)
    assert len(rows_of(html)) == 1000 and "Only the first 1000 of 1450 events are in this table" in html
    assert "450 more cannot be chosen here" in body(found, entries(found))


def raised(groups: Groups) -> Groups:
    """The same ids, with other readings."""
    constant, observed = groups["constant_data"], groups["observed_data"]
    return {
        **groups,
        "constant_data": constant.assign(reading=constant["reading"] + 100.0),
        "observed_data": observed + 100.0,
    }


def test_two_campaigns_of_equal_ids_have_tables_of_their_own(results: Path, tree_copy: Any) -> None:
    other = tree_copy(
        results / "coulomb" / "posterior.nc", "other", raised, campaign="elsewhere", campaign_fingerprint="2"
    )
    found = read_given([results / "pcm", results / "hierarchical", other])
    html = made(found)
    _, first, second, *_ = html.split("<h3>")
    assert first.startswith("Events of runs 1, 2 (") and second.startswith("Events of run 3 (elsewhere)")
    assert "22 of these ids are in other tables too" in first
    readings = found.runs[0].recordings.values
    k = int(np.flatnonzero(found.runs[0].recordings.status[:, 0] == 0)[0])
    for table, value in ((first, readings[k, 0]), (second, readings[k, 0] + 100.0)):
        assert f'<td class="n">{value:.1f}</td>' in rows_of(table)[k]
    assert "k, run 3" not in first and "k, run 1" not in second


def test_files_of_one_campaign_share_a_table(given: Given) -> None:
    html = made(given)
    assert "<h3>All events</h3>" in html and "Events of run" not in html
    assert html.count("k, run") == 3


def test_a_status_that_nobody_knows_takes_no_other_reading(results: Path, tree_copy: Any) -> None:
    def damaged(groups: Groups) -> Groups:
        status = groups["constant_data"]["status"].copy()
        status[0, 0] = 9
        return {**groups, "constant_data": groups["constant_data"].assign(status=status)}

    file = tree_copy(results / "pcm" / "posterior.nc", "damaged", damaged)
    html = made(read_given([file]))
    assert "could not be made" not in html and "unknown status 9" in html
    assert len(rows_of(html)) == 22


def test_a_run_that_cannot_be_shown_leaves_the_others(results: Path, monkeypatch: Any) -> None:
    from skred.report.explore.run import Run

    fails = Run.observations.func  # type: ignore[attr-defined]

    def observations(run: Run) -> str:
        if run.number == 2:
            raise KeyError("<gone>")
        return str(fails(run))

    monkeypatch.setattr(Run, "observations", property(observations))
    monkeypatch.setattr(Run, "can_leave_out", property(observations))
    found = read_given([results / "pcm", results / "coulomb"])
    html = made(found)
    assert len(rows_of(html)) == 22 and "Could not be shown of these runs" in html
    assert str(escape("run 2, coulomb (coulomb, pooled): KeyError: '<gone>'")) in html
