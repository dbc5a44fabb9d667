"""Figures of ArviZ beside the drawings: what they hold, and what a browser makes of them."""

from __future__ import annotations

import base64
import gzip
import json
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from diagnosis_report_cases import documents
from hierarchical_cases import hierarchical_calibration, hierarchical_ryggfonn
from page_checks import check_page, explorations
from report_cases import as_saved, comparison, picture, ranked_comparison
from test_report_pages import calibrated, hexed

from skred.inference.calibrate import calibrate, write_calibration
from skred.inference.sampling import SamplerSettings
from skred.physics.laws import load_law
from skred.report.calibration.figures import save_model_figures
from skred.report.calibration.page import render_calibration
from skred.report.comparison.laws import save_comparison_figures
from skred.report.comparison.page import render_comparison
from skred.report.diagnosis.report import render_diagnosis, save_diagnosis_figures
from skred.report.explore.exploration import Plot, exploration
from skred.report.explore.panel import NotShownError
from skred.report.shared.colours import DARK_PAPER, PAPER, contrast

EVIL = "</script><script>document.body.dataset.attacked=1</script>"


@pytest.fixture(autouse=True)
def coarse_figures(monkeypatch):
    monkeypatch.setattr("skred.report.shared.style.DPI", 40)


@pytest.fixture(scope="module")
def tree(tmp_path_factory, problem):
    """A short pooled calibration, as it is saved."""
    folder = tmp_path_factory.mktemp("pcm")
    settings = SamplerSettings(draws=60, tune=60, chains=2, seed=1)
    write_calibration(calibrate(problem, load_law("pcm"), settings), folder)
    with xr.open_datatree(folder / "posterior.nc", engine="h5netcdf") as opened:
        return opened.load()


def changed(tree, change):
    """The tree with each of its groups changed by a function of its name and content."""
    groups = {name: change(name, node.to_dataset()) for name, node in tree.children.items()}
    made = xr.DataTree.from_dict(groups)
    made.attrs = tree.attrs
    return made


def of_calibration(tree, folder):
    """Plots by figure, and the page."""
    drawn = save_model_figures(tree, folder)
    html = render_calibration(calibrated(), drawn)
    return {name: one.exploration for name, one in drawn.items()}, html


@pytest.fixture(scope="module")
def made(tree, tmp_path_factory):
    """The short calibration's figures and page, made once for all tests that only look at them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("skred.report.shared.style.DPI", 40)
        drawn = save_model_figures(tree, tmp_path_factory.mktemp("made"))
        return drawn, render_calibration(calibrated(), drawn)


def plots(page):
    return [[one["plot"] for one in found] for found in explorations(page)]


def sources(found, column):
    """Columns of all sources of what can be explored."""
    columns = []

    def look(part):
        if isinstance(part, dict):
            if part.get("name") == "ColumnDataSource":
                entries = dict(part["attributes"]["data"]["entries"])
                columns.extend([entries[column]] if column in entries else [])
            for one in part.values():
                look(one)
        elif isinstance(part, list):
            for one in part:
                look(one)

    look(found)
    return columns


def numbers(packed):
    """A column of numbers, as bokeh packs it."""
    raw = gzip.decompress(base64.b64decode(packed["array"]["data"]))
    return np.frombuffer(raw, dtype=packed["dtype"]).reshape(packed["shape"])


def test_a_calibration_has_its_draws_to_explore(made):
    drawn, html = made
    assert {name for name, one in drawn.items() if one.exploration is not None} == {
        "trace", "joint", "marginals", "predictive"
    }  # fmt: skip
    page = check_page(html)
    assert sorted(plots(page)) == [
        ["plot_pair"], ["plot_ppc_dist and plot_ppc_interval"], ["plot_prior_posterior"],
        ["plot_trace", "plot_rank"],
    ]  # fmt: skip
    assert html.count('id="bokeh"') == 1


@pytest.mark.slow
def test_a_hierarchical_one_has_a_forest_of_avalanches(tmp_path):
    problem, law = hierarchical_ryggfonn(), load_law("coulomb")
    tree = as_saved(hierarchical_calibration(problem, law), law, problem)
    found, html = of_calibration(tree, tmp_path)
    assert found["population"] is None and found["along_track"] is None
    page = check_page(html)
    forest = next(one for one in explorations(page) if one[0]["plot"] == "plot_forest")
    (events,) = sources(forest, "event")
    assert events == list(problem.campaign.event_ids)
    own = tree["event_posterior"]["dry_friction"]
    medians = own.median(("chain", "draw")).transpose("event").values
    drawn = [numbers(one) for one in sources(forest, "x") if not isinstance(one, list)]
    assert any(len(one) == len(medians) and np.allclose(one, medians, rtol=1e-5) for one in drawn)


@pytest.mark.slow
def test_the_same_draws_make_the_same_page(tree, tmp_path):
    (_, first), (_, second) = of_calibration(tree, tmp_path), of_calibration(tree, tmp_path)
    assert first == second


@pytest.mark.slow
def test_what_else_is_imported_is_not_in_the_page(tree, tmp_path):
    pytest.importorskip("panel", reason="the extra dashboard is not installed")  # before the page is made
    _, html = of_calibration(tree, tmp_path)
    assert '"defs"' not in json.dumps(explorations(check_page(html)))


def test_a_page_without_such_figures_carries_no_bokeh(tmp_path):
    one = picture(tmp_path / "figure.png")
    html = render_comparison(comparison(), {"pareto_k": one})
    assert "bokeh" not in html.lower() and "unsafe" not in html
    check_page(html)


@pytest.mark.slow
def test_thinned_draws_are_told(tree, tmp_path):
    many = changed(
        tree, lambda name, data: data.isel(draw=np.arange(500) % 60) if name == "posterior" else data
    )
    bare = changed(many, lambda name, data: data.drop_vars("draw", errors="ignore"))
    _, html = of_calibration(bare, tmp_path)
    found = {one["plot"]: one for block in explorations(check_page(html)) for one in block}
    assert found["plot_trace"]["panels"][0]["note"] == "400 of the 500 draws of each chain."
    assert found["plot_pair"]["panels"][0]["note"] == "250 of the 500 draws of each chain."


@pytest.mark.parametrize("n_draws", [1, *(pytest.param(n, marks=pytest.mark.slow) for n in (2, 4))])
def test_few_draws_are_no_reason_to_fail(tree, tmp_path, n_draws):
    few = changed(tree, lambda name, data: data.isel(draw=slice(n_draws)) if "draw" in data.sizes else data)
    found, html = of_calibration(few, tmp_path)
    check_page(html)
    assert found["predictive"] is not None


@pytest.mark.slow
def test_one_chain_has_no_ranks_to_compare(tree, tmp_path):
    one = changed(tree, lambda name, data: data.isel(chain=slice(1)) if "chain" in data.sizes else data)
    _, html = of_calibration(one, tmp_path)
    assert ["plot_trace"] in plots(check_page(html))


@pytest.mark.slow
def test_a_parameter_that_is_always_the_same_has_no_density(tree, tmp_path):
    def constant(name, data):
        return data.assign(dry_friction=0.0 * data["dry_friction"] + 0.3) if name == "posterior" else data

    _, html = of_calibration(changed(tree, constant), tmp_path)
    check_page(html)


def test_what_cannot_be_drawn_leaves_the_drawing_alone():
    def nothing():
        raise NotShownError("nothing to see")

    assert exploration(Plot("plot_dist", "", nothing)) is None


def test_numbers_of_a_comparison_are_those_of_its_document(tmp_path):
    document = ranked_comparison()
    figures = save_comparison_figures(document, tmp_path)
    page = check_page(render_comparison(document, figures))
    found = {one["plot"]: one for block in explorations(page) for one in block}
    assert set(found) == {"plot_compare", "plot_khat", "plot_ecdf_pit"}
    laws = document["models"]
    k = [numbers(one) for one in sources(found["plot_khat"], "y")]
    assert [one.tolist() for one in k] == pytest.approx(
        [pytest.approx(law["loo"]["pareto_k"], rel=1e-5) for law in laws]
    )
    assert all(one == document["event_ids"] for one in sources(found["plot_khat"], "event"))
    assert len(found["plot_ecdf_pit"]["panels"]) == 6
    differences = [numbers(one) for one in sources(found["plot_compare"], "x")]
    wanted = [law["difference"]["elpd"] for law in laws]
    assert any(np.allclose(one, wanted, atol=1e-4) for one in differences if len(one) == len(wanted))


def test_a_diagnosis_has_its_check_and_its_coefficient_to_explore(tmp_path):
    document, tree = documents("two")
    page = check_page(render_diagnosis(document, tree, save_diagnosis_figures(document, tree, tmp_path)))
    assert ["plot_ppc_tstat"] in plots(page)


def test_colours_are_those_of_the_page_in_the_light_and_in_the_dark(made):
    drawn, html = made
    for one in drawn.values():
        for colour in one.exploration.colours if one.exploration is not None else ():
            assert html.count(f"--c{colour[1:]}:") == 2
    text = json.dumps(explorations(check_page(html)))
    assert "var(--c" in text and '"#' not in text


def test_ids_of_events_that_attack_are_data(tmp_path):
    document = ranked_comparison()
    evil = [f"{EVIL}{k}" for k in range(8)]
    document["event_ids"] = evil
    for law in document["models"]:
        for one in law["loo"]["pit"]:
            one["events"] = evil[: len(one["events"])]
    html = render_comparison(document, save_comparison_figures(document, tmp_path))
    page = check_page(html)
    assert EVIL not in html
    told = [text for block in explorations(page) for one in sources(block, "event") for text in one]
    assert told and all(text.startswith("</script>") for text in told)


def test_what_a_page_has_no_room_for_is_told(made, monkeypatch):
    drawn, _ = made
    bare = {name: replace(one, exploration=None) for name, one in drawn.items()}
    size = len(render_calibration(calibrated(), bare))
    monkeypatch.setattr("skred.report.shared.html.MOST_BYTES", size + 30_000)
    html = render_calibration(calibrated(), drawn)
    page = check_page(html)
    assert not explorations(page) and "bokeh" not in html
    assert "not to be explored here" in page.text and len(page.all("figure")) == len(drawn)


# In a browser

EXPLORING = "f => f.classList.contains('exploring')"
SELECTED = """event => window.skred.sources().filter(s => Array.from(s.data.event).includes(event))
    .map(s => s.selected.indices.length > 0 && s.selected.indices.every(k => s.data.event[k] === event))"""
POINT = """() => { for (const view of Object.values(Bokeh.index.roots ?? Bokeh.index))
    for (const one of view.model.renderers ?? []) if (one.data_source?.data.event) {
        const k = 5, data = one.data_source.data, box = view.canvas_view.el.getBoundingClientRect();
        const x = view.frame.x_scale.compute(data.x[k]), y = view.frame.y_scale.compute(data.y[k]);
        return [box.x + x, box.y + y, Array.from(data.event)[k]]; } }"""


def explored(page, caption):
    """Press the button of a figure by keyboard; the figure and its button."""
    figure = page.locator("figure").filter(has=page.locator("figcaption", has_text=caption)).first
    button = figure.locator("button.explore")
    button.focus()
    page.keyboard.press("Enter")
    page.wait_for_function(EXPLORING, arg=figure.element_handle(), timeout=60_000)
    return figure, button


PARETO, TRACE = "Pareto k of each event", "Traces of all chains"


@pytest.mark.slow
@pytest.mark.parametrize("width", [390, 1200])
def test_a_figure_is_explored_and_left_by_keyboard(opened, width):
    page = opened("comparison", viewport={"width": width, "height": 800})
    assert page.evaluate("typeof window.Bokeh") == "undefined", "nothing is started before one asks"
    figure, button = explored(page, TRACE)
    assert button.inner_text() == "Back to the drawing"
    assert page.evaluate("document.activeElement.className") == "explore"
    assert figure.locator("svg:visible").count() == 0
    assert figure.locator(".exploration canvas").first.bounding_box()["width"] > 200
    assert page.evaluate("document.scrollingElement.scrollWidth") <= width
    page.keyboard.press("Space")
    assert figure.locator(".exploration:visible").count() == 0
    assert figure.locator("svg:visible").count() == 1 and button.inner_text() == "Explore with ArviZ"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["diagnosis", "comparison"])
def test_every_figure_that_can_be_explored_fits(opened, name):
    page = opened(name, viewport={"width": 390, "height": 800})
    buttons = page.locator("button.explore")
    assert buttons.count() >= 1
    for number in range(buttons.count()):
        buttons.nth(number).click()
        figure = buttons.nth(number).locator("xpath=ancestor::figure")
        page.wait_for_function(EXPLORING, arg=figure.element_handle(), timeout=60_000)
    page.wait_for_timeout(500)
    assert page.evaluate("document.scrollingElement.scrollWidth") <= 390


@pytest.mark.slow
def test_on_paper_stand_the_drawings(opened):
    page = opened("comparison")
    figure, _ = explored(page, PARETO)
    page.emulate_media(media="print")
    assert figure.locator("svg:visible").count() == 1
    assert page.locator(".exploration:visible, .explore:visible").count() == 0
    page.emulate_media(media="screen")
    assert figure.locator("svg:visible").count() == 0


@pytest.mark.slow
def test_one_avalanche_is_highlighted_in_what_is_explored(opened):
    page = opened("comparison")
    page.locator(".chooser select").select_option("e3")
    explored(page, PARETO)  # drawn after the choice
    marked = page.evaluate(SELECTED, "e3")
    assert len(marked) == 3 and all(marked)
    page.locator(".chooser select").select_option("e4")
    assert all(page.evaluate(SELECTED, "e4")) and not any(page.evaluate(SELECTED, "e3"))
    page.locator("figure.exploring .bk-Figure").first.scroll_into_view_if_needed()
    page.wait_for_timeout(300)
    x, y, event = page.evaluate(POINT)
    page.mouse.click(x, y)
    page.wait_for_function("e => window.skred.chosen() === e", arg=event, timeout=5000)
    assert page.locator(".chooser select").input_value() == event
    assert page.locator("tr.chosen").get_attribute("data-event") == event
    page.keyboard.press("Escape")
    assert not any(page.evaluate(SELECTED, event))


@pytest.mark.slow
def test_what_is_explored_follows_light_and_dark(opened):
    colour = """() => { for (const view of Object.values(Bokeh.index.roots ?? Bokeh.index))
        return view.model.xaxis?.[0]?.axis_label_text_color ?? view.model.below[0].axis_label_text_color; }"""
    page = opened("comparison", color_scheme="dark")
    explored(page, PARETO)
    shown = [page.evaluate(colour)]
    page.emulate_media(color_scheme="light")
    # Between both there is no figure for a moment.
    other = "c => { const found = (" + colour + ")(); return found && found !== c ? found : null; }"
    shown.append(page.wait_for_function(other, arg=shown[0], timeout=20_000).json_value())
    papers = (DARK_PAPER, PAPER)
    assert all(contrast(one, paper) > 7.0 for one, paper in zip(shown, papers, strict=True))
    assert hexed(page.evaluate("getComputedStyle(document.body).backgroundColor")) == PAPER


@pytest.mark.slow
def test_names_that_attack_do_nothing_in_what_is_explored(opened, pages, tmp_path):
    document = ranked_comparison()
    evil = [f"{EVIL}<img src=x onerror=document.body.dataset.attacked=1>{k}" for k in range(8)]
    document["event_ids"] = evil
    html = render_comparison(document, save_comparison_figures(document, tmp_path))
    (pages / "evil.html").write_text(html, encoding="utf-8")
    page = opened("evil")
    figure, _ = explored(page, PARETO)
    figure.locator(".bk-Figure").first.scroll_into_view_if_needed()
    page.wait_for_timeout(300)
    x, y, event = page.evaluate(POINT)
    page.mouse.move(x, y)
    page.wait_for_timeout(500)
    assert page.locator(".bk-tooltip-row-value").first.inner_text().strip() == event
    assert page.locator("img").count() == 0
    assert page.evaluate("document.body.dataset.attacked") is None
