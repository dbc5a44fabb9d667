"""Each figure holds the numbers of the files, or what ArviZ computes of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import arviz as az
import numpy as np
import pytest
import xarray as xr
from dashboard_cases import named
from numpy.testing import assert_allclose, assert_array_equal

from skred.dashboard.answer import answer, entries
from skred.dashboard.catalogue import VIEWS
from skred.dashboard.fronts import event_speeds
from skred.dashboard.view import Asked
from skred.inference.added_terms import AddedTerm, added_group
from skred.physics.laws import load_law
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.placed import direction_of
from skred.physics.mechanisms.spec import BoundTo, Setting, Shape
from skred.physics.terrain import Terrain
from skred.report.explore.panel import Panel


def panels(given: Any, view: str, run: str | None = None, **asked: Any) -> list[Panel]:
    (kind,) = [one for one in VIEWS if one.id == view]
    of = None if run is None else named(given, run)
    return kind.make(of, given, Asked(**asked))


def sources(figure: Any, *columns: str) -> list[dict[str, Any]]:
    """Data of the renderers of a figure that have such columns."""
    from bokeh.models import GlyphRenderer

    renderers = sorted(figure.select({"type": GlyphRenderer}), key=lambda one: int(one.id.lstrip("p")))
    found = [one.data_source.data for one in renderers]
    return [data for data in found if set(columns) <= set(data)]


@pytest.fixture(scope="module")
def pcm(results: Path) -> xr.DataTree:
    with xr.open_datatree(results / "pcm" / "posterior.nc", engine="h5netcdf") as tree:
        return tree.load()


@pytest.mark.slow
def test_every_view_of_every_run_can_be_made(given: Any) -> None:
    made = {entry.key: answer(entry, given) for entry in entries(given)}
    assert {entry.view.id for entry in entries(given)} == {view.id for view in VIEWS}
    for key, one in made.items():
        assert "could not be made" not in one["html"], (key, one["html"][:300])
        one_parameter = key.startswith("pair")
        assert one["items"] or one_parameter or key in ("overview", "events"), key


def test_pareto_k_is_that_of_arviz_event_by_event(given: Any, pcm: xr.DataTree) -> None:
    (panel,) = panels(given, "pareto_k", "pcm")
    (data,) = sources(panel.figure, "event", "y")
    loo = az.loo(pcm, pointwise=True)
    assert list(data["event"]) == pcm["constant_data"]["event"].values.tolist()
    assert_allclose(data["y"], loo.pareto_k.values, rtol=1e-6)
    assert f"{loo.good_k:.2f}" in panel.note


def test_the_comparison_is_that_of_arviz(given: Any, results: Path, pcm: xr.DataTree) -> None:
    with xr.open_datatree(results / "coulomb" / "posterior.nc", engine="h5netcdf") as opened:
        coulomb = opened.load()
    table = az.compare({"pcm": pcm, "coulomb": coulomb}, round_to="none")
    text, figure, by_event = panels(given, "comparison")[:3]
    for name in table.index:
        assert (
            f"{table.loc[name, 'elpd']:.1f}" in text.html and f"{table.loc[name, 'weight']:.2f}" in text.html
        )
    (data,) = sources(by_event.figure, "event", "y")
    best, other = (az.loo(one, pointwise=True).elpd_i.values for one in (pcm, coulomb))
    sign = 1.0 if table.index[0] == "pcm" else -1.0
    assert_allclose(data["y"], sign * (other - best), rtol=1e-5, atol=1e-5)
    assert figure.figure is not None


def test_a_pooled_and_a_hierarchical_run_are_not_compared(given: Any) -> None:
    titles = " ".join(panel.title for panel in panels(given, "comparison"))
    assert "2 runs, pooled" in titles and "hierarchical" not in titles


def test_a_trace_holds_the_draws(given: Any, pcm: xr.DataTree) -> None:
    found = panels(given, "trace", "pcm")
    assert [panel.title for panel in found] == ["dry friction μ [-]", "turbulent drag D [1/m]"]
    lines = [data["y"] for data in sources(found[0].figure, "x", "y") if len(data["y"]) == 200]
    for line, chain in zip(lines, pcm["posterior"]["dry_friction"].values, strict=True):
        assert_allclose(line, chain, rtol=1e-6)


def test_pairs_hold_the_draws_of_both(given: Any, pcm: xr.DataTree) -> None:
    (panel,) = panels(given, "pair", "pcm")
    data = sources(panel.figure, "x", "y")
    posterior = pcm["posterior"]
    x, y = (np.sort(np.concatenate([np.ravel(one[key]) for one in data])) for key in ("x", "y"))
    assert_allclose(x, np.sort(posterior["dry_friction"].values.ravel()), rtol=1e-6)
    assert_allclose(y, np.sort(posterior["turbulent_drag"].values.ravel()), rtol=1e-6)


def test_the_forest_has_a_line_for_each_run(given: Any, pcm: xr.DataTree) -> None:
    friction = next(panel for panel in panels(given, "forest") if panel.title == "dry friction μ [-]")
    (data,) = sources(friction.figure, "median", "run")[:1]
    assert data["run"] == [str(run.number) for run in given.runs if run.names]
    low, median = np.quantile(pcm["posterior"]["dry_friction"].values, [0.05, 0.5])
    assert_allclose([data["twig0"][0], data["median"][0]], [low, median])


def test_predictions_hold_every_recording(given: Any, pcm: xr.DataTree) -> None:
    found = {panel.title: panel.figure for panel in panels(given, "predictive", "pcm")}
    observed = pcm["observed_data"]["LC"]
    (data,) = sources(found["LC [m/s]: by event"], "event", "y")
    assert_allclose(data["y"], observed.values)
    assert list(data["event"]) == observed["event_LC"].values.tolist()
    assert {"runout [m]: by event", "runout [m]: all events"} <= set(found)


def test_loo_pit_is_that_of_arviz(given: Any, pcm: xr.DataTree) -> None:
    found = {panel.title: panel.figure for panel in panels(given, "loo_pit", "pcm")}
    (data,) = sources(found["b [m/s]"], "event", "x")
    assert_allclose(data["x"], az.loo_pit(pcm, var_names=["b"])["b"].values, atol=1e-6)


@pytest.mark.parametrize("run", ["pcm", "hierarchical"])
def test_fronts_are_those_of_the_calibration(run: str, given: Any) -> None:
    """Another route to the same numbers: the readings of the fronts that the file holds."""
    of = named(given, run)
    found, recordings = event_speeds(of), of.recordings
    group, name = ("event_posterior", "front") if found.own else ("mean_response", "response")
    stored = of.group(group)[name].transpose("chain", "draw", ..., "sensor").values
    stored = stored.reshape(-1, *stored.shape[2:])
    n = len(found.speed)
    stored = stored[np.unique(np.linspace(0, len(stored) - 1, n).astype(int))]
    column, _, place = recordings.placed()[0]
    squared = np.apply_along_axis(lambda v: np.interp(place, found.s_m, v**2), -1, found.speed)
    assert_allclose(np.sqrt(squared), np.broadcast_to(stored[..., column], squared.shape), atol=0.3)
    assert np.median(np.abs(np.sqrt(squared) - stored[..., column])) < 1e-3


def test_what_was_added_acts_as_in_a_law_that_has_it(given: Any) -> None:
    """Coulomb friction with turbulent drag added is the PCM model; friction and drag are the two routes."""
    run = named(given, "hierarchical")
    drag, groups = 0.003, {str(name): node.to_dataset() for name, node in run.tree.children.items()}
    events, posterior = groups["event_posterior"], groups["posterior"]
    constant = groups["constant_data"]
    slope = constant["slope"].values
    terrain = Terrain(
        constant["cell_edge"].values, np.sin(slope), np.cos(slope), constant["curvature"].values, 0.0
    )
    empty = np.zeros(terrain.n_cells + 1)
    setting = Setting(terrain, ("coulomb_friction",), (0.0, terrain.length_m), (), (), {}, 0, empty)
    mechanism = mechanisms()["turbulent_drag"]
    direction = direction_of(mechanism, setting, Shape())
    term = AddedTerm(
        "turbulent_drag", mechanism.id, mechanism.title, mechanism.group, BoundTo.TRACK, Shape(), direction
    )
    added = replace(
        run,
        tree=with_groups(
            run,
            posterior=posterior.assign(turbulent_drag=xr.full_like(posterior["dry_friction"], drag)),
            event_posterior=events.assign(turbulent_drag=xr.full_like(events["release"], drag)),
            added=added_group([term]),
        ),
    )
    of_law = replace(
        run,
        tree=with_groups(
            run, event_posterior=events.assign(turbulent_drag=xr.full_like(events["release"], drag))
        ),
    )
    of_law.tree.attrs.update(law="pcm", equation=load_law("pcm").equation)
    slower, alike = event_speeds(added).speed, event_speeds(of_law).speed
    assert_allclose(slower, alike, atol=1e-9)
    assert slower.max() < 0.8 * event_speeds(run).speed.max()


def with_groups(run: Any, **changed: xr.Dataset) -> xr.DataTree:
    groups = {str(name): node.to_dataset() for name, node in run.tree.children.items()}
    tree = xr.DataTree.from_dict({**groups, **changed})
    tree.attrs = dict(run.tree.attrs)
    return tree


def test_recordings_lie_on_the_speeds(given: Any) -> None:
    (panel,) = panels(given, "speed", "hierarchical")
    run = named(given, "hierarchical")
    recordings = run.recordings
    (dots,) = sources(panel.figure, "event", "told")
    at = [
        k
        for k, (e, s) in enumerate(zip(dots["event"], dots["sensor"], strict=True))
        if (e, s) == ("19750225", "LC")
    ]
    assert_allclose(dots["y"][at[0]], recordings.values[0, 0])
    (medians,) = sources(panel.figure, "xs", "ys", "event")
    assert list(medians["event"]) == list(recordings.event_ids)
    (draws,) = sources(panel.figure, "of", "draw")
    assert len(draws["ys"]) == len(event_speeds(run).speed) * len(recordings.event_ids)


def test_the_force_is_that_of_the_diagnosis(given: Any) -> None:
    run = named(given, "diagnosis")
    (panel,) = panels(given, "force", "diagnosis")
    force = run.group("force")
    lines = [data for data in sources(panel.figure, "x", "y") if len(data["y"]) == force.sizes["s"]]
    assert any(np.allclose(data["y"], force["mean"].values, atol=1e-6) for data in lines)


def test_candidates_have_the_probabilities_of_the_verdict(given: Any) -> None:
    run = named(given, "diagnosis")
    found = {panel.title: panel for panel in panels(given, "candidates", "diagnosis")}
    (bars,) = sources(found["Probability of each candidate"].figure, "name", "value")[:1]
    assert_allclose(
        bars["value"], sorted(run.document["probability"].values(), reverse=True)[: len(bars["value"])]
    )
    (without,) = sources(found["The leading answer without each event"].figure, "event", "y")
    told = {one["event"]: one["log_bayes_factor"] for one in run.document["influence"]["events"]}
    assert_allclose(without["y"], [told[event] for event in without["event"]], rtol=1e-6)


def test_left_out_avalanches_are_those_of_the_diagnosis(given: Any) -> None:
    run = named(given, "diagnosis")
    found = panels(given, "held_out", "diagnosis")
    assert [panel.title for panel in found][:2] == [
        "Front speed: base law",
        "Front speed: with what was added",
    ]
    (data,) = sources(found[1].figure, "event", "sensor")
    held = run.group("held_out").sel(when="after")["mean"]
    expected = [
        float(held.sel(event=e, sensor=s)) for e, s in zip(data["event"], data["sensor"], strict=True)
    ]
    assert_allclose(data["y"], expected, rtol=1e-6)


def test_chosen_parameters_are_shown(given: Any) -> None:
    found = panels(given, "trace", "pcm", parameters=["turbulent drag D [1/m]"])
    assert [panel.title for panel in found] == ["turbulent drag D [1/m]"]


def test_events_are_the_same_in_all_views(given: Any, pcm: xr.DataTree) -> None:
    events = pcm["constant_data"]["event"].values.tolist()
    for run in given.runs:
        assert_array_equal(run.event_ids, events)
