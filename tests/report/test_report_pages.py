"""Whole pages: what is in the file, and what a browser makes of it."""

from __future__ import annotations

from contextlib import nullcontext
from xml.etree import ElementTree

import numpy as np
import pytest
from diagnosis_report_cases import documents
from hierarchical_cases import hierarchical_comparison
from page_checks import check_page, texts, without_scripts
from report_cases import comparison, entry, gate, picture, ranked_comparison
from test_report_html import hostile, nulls

from skred.model_selection.ranking import ranking
from skred.report.calibration.page import render_calibration
from skred.report.comparison.page import render_comparison
from skred.report.diagnosis.report import render_diagnosis
from skred.report.shared.colours import DARK_PAPER, PAPER, contrast, dark
from skred.report.shared.drawing import Picture
from skred.report.shared.inline import inline_svg
from skred.report.shared.marks import mark
from skred.report.shared.style import INK, PALETTE, legend_below, narrow, new_figure, side_by_side

KINDS = ("cannot", "nothing", "unexplained", "sensor", "tie", "two")


@pytest.fixture(autouse=True)
def coarse_figures(monkeypatch):
    monkeypatch.setattr("skred.report.shared.style.DPI", 40)


@pytest.mark.parametrize("kind", KINDS)
def test_a_diagnosis_is_a_page_for_everyone(kind):
    document, tree = documents(kind)
    page = check_page(render_diagnosis(document, tree, {}))
    lay = next(one for one in page.all("p") if one.has("lay")).text
    said = {
        "cannot": "cannot tell", "nothing": "Answer: no", "unexplained": "no cause on the list",
        "sensor": "something in the recordings is off", "tie": "cannot tell it from", "two": "Answer",
    }  # fmt: skip
    assert said[kind] in lay
    assert (f"({document['sensor']}, which reads " in lay) == bool(document["sensor"])
    carried = document["influence"]["carried_by"] if document["influence"] else []
    assert ("Take it with care" in lay) == ("Answer, which only" in lay) == bool(carried)


def test_every_avalanche_and_reading_of_a_diagnosis_stands_in_a_table():
    document, tree = documents("two")
    page = check_page(render_diagnosis(document, tree, {}))
    rows = [row for row in page.all("tr") if "data-event" in row.attributes]
    events = {row.attributes["data-event"] for row in rows}
    assert events == set(map(str, tree["held_out"]["event"].values))
    recorded = int((tree["constant_data"]["status"] == 0).sum())
    table = next(one for one in page.all("table") if "From the others" in one.text)
    assert len(table.all("tbody")[0].all("tr")) == recorded
    before = tree["held_out"]["log_score"].sel(when="before").values
    assert f"{float(before[0]):.1f}" in next(row.text for row in rows)


@pytest.mark.parametrize("made", [comparison, hierarchical_comparison, ranked_comparison])
def test_a_comparison_is_a_page_for_everyone(made):
    check_page(render_comparison(made(), {}))


def test_what_would_change_the_ranking():
    text = without_scripts(render_comparison(ranked_comparison(), {}))
    assert "voellmy would be before pcm without e8, e1, e2, e3, e4, e5, e6." not in text
    assert "No set of avalanches puts constant before pcm." in text
    assert "leave-one-event-out (decides) pcm" in text and "Would another score give another order?" in text
    assert "nothing against it" in text and "mean place" in text


def test_an_order_that_hangs_on_one_avalanche_is_told_first():
    document = ranked_comparison()
    best, other = (model["exact"]["pointwise"] for model in document["models"][:2])
    other[:] = [value + 0.1 for value in best[:-1]] + [best[-1] - 5.0]
    document["ranking"] = ranking(document["models"], document["event_ids"])
    text = without_scripts(render_comparison(document, {}))
    assert "Take that with care: without 1 avalanche (e8) voellmy would be ahead of pcm." in text
    assert "voellmy would be before pcm without e8." in text and "1 of 8" in text


def test_older_documents_have_no_such_sections():
    text = without_scripts(render_comparison(comparison(), {}))
    assert "What would change the ranking" not in text and "as sure as they should be" not in text


def calibrated():
    """What ``summary.json`` says of a law."""
    law = entry("pcm", [-14.0] * 4, [-14.0] * 4)
    fit = {
        "sensor": "sensor 0", "unit": "m/s", "n_recorded": 21, "recorded_mean": 32.1, "recorded_sd": 12.4,
        "predicted_mean": 33.3, "predicted_sd": 12.2, "predicted_mean_se": 3.8, "p_mean": 0.99, "p_sd": 1.0,
        "inside": 0.95, "fits": True,
    }  # fmt: skip
    keys = ("id", "title", "equation", "gate", "parameters", "response")
    interval = {"kind": "equal-tailed", "probability": 0.9}
    return {
        "format": 1, "campaign": "ryggfonn", "likelihood": "pooled", "interval": interval, "fits": True,
        "fit": [fit], "fit_level": 0.01, "fit_caution": "That says little: of the scatter.",
        "settings": {"draws": 1000}, "versions": {"skred": "0.1.0"},
        **{key: law[key] for key in keys},
    }  # fmt: skip


@pytest.mark.parametrize("change", [{}, {"fits": False}, {"gate": gate(passed=False)}, {"fit": None}])
def test_a_calibration_is_a_page_for_everyone(change):
    page = check_page(render_calibration(calibrated() | change, {}))
    lay = next(one for one in page.all("p") if one.has("lay")).text
    assert ("Do not use these numbers" in lay) == ("gate" in change)
    assert "0.287" in page.text and "A simple model (pcm)" in lay
    assert ("found no disagreement. That says little" in lay) == (change in ({}, {"fit": None}))
    assert "That says little: of the scatter." in page.text


def test_anything_may_be_null_in_a_calibration():
    for one in ({}, nulls(calibrated()), dict.fromkeys(calibrated())):
        text = check_page(render_calibration(one, {})).text
        assert "None" not in text and "nan" not in text.split()


def test_names_of_a_calibration_are_escaped():
    html = render_calibration(hostile(calibrated()), {})
    assert "<script>alert" not in html and "<script>alert" in check_page(html).text


def test_a_page_that_would_be_too_large_leaves_out_the_largest_figures(tmp_path):
    one = picture(tmp_path / "figure.png")
    large = Picture(one.file, one.wide + " " * 1_500_000, one.narrow)
    figures = {f"pcm/{name}": large for name in ("trace", "joint", "predictive")} | {"pareto_k": one}
    html = render_comparison(comparison(), figures)
    page = check_page(html)
    assert len(page.all("figure")) == 3 and "the files are beside it: pcm/predictive.png." in page.text
    assert "beside it: pcm" not in render_comparison(comparison(), {"pareto_k": one})


def test_a_figure_for_a_telephone_has_its_panels_below_each_other():
    def made():
        figure = new_figure(
            3.0, "A title that is much too long for the narrow screen of a telephone, and folded"
        )
        panels = side_by_side(figure, 2, sharey=True)
        panels[0].plot(
            [1.0, 2.0], [1.0, 2.0], label="a label that is so long that it has to be folded as well"
        )
        panels[0].set_ylabel("said once")
        mark(
            panels[1],
            [1.0, 9.0, np.nan],
            [1.5, 1.5, 1.0],
            ["here <&>", "outside", "nowhere"],
            ["e1", "e2", "e3"],
        )
        panels[1].set_xlim(0.0, 2.0)
        legend_below(figure, panels, columns=2)
        return figure

    sizes, words = {}, {}
    for name, around in (("wide", nullcontext()), ("narrow", narrow())):
        with around:
            root = ElementTree.fromstring(inline_svg(made(), name))
        sizes[name] = [float(number) for number in root.get("viewBox").split()[2:]]
        words[name] = [text.text for text in root.iter("text")]
        marks = [one for one in root.iter("g") if one.get("class") == "mark"]
        assert [one.get("data-event") for one in marks] == ["e1"], "what cannot be seen cannot be pointed at"
        assert marks[0].find("title").text == "here <&>"
    assert sizes["narrow"][0] < 0.5 * sizes["wide"][0] and sizes["narrow"][1] > 1.4 * sizes["wide"][1]
    assert words["wide"].count("said once") == 1 and words["narrow"].count("said once") == 2
    assert max(map(len, filter(None, words["narrow"]))) < 50 < max(map(len, filter(None, words["wide"])))


def test_colours_in_the_dark_lose_no_contrast():
    """What is read has 4.5, what is only seen has as much as on white."""
    for colour in (*PALETTE, INK, "#767676", "#000000", "#5c5c5c"):
        wanted = min(contrast(colour, PAPER), 4.5)
        assert contrast(dark(colour), DARK_PAPER) >= 0.999 * wanted, colour
    assert dark(PAPER) == DARK_PAPER and contrast(dark(INK), DARK_PAPER) > 7.0
    assert len({dark(colour) for colour in PALETTE}) == len(PALETTE)
    assert contrast("#ffffff", "#000000") == pytest.approx(21.0)
    assert contrast("#767676", "#ffffff") == pytest.approx(4.54, abs=0.01)


# In a browser: Debian's Chromium, driven by playwright; see conftest.py.

NAMES = ("diagnosis", "comparison")


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 1200])
def test_nothing_overflows_and_one_drawing_of_each_is_shown(opened, name, scheme, width):
    page = opened(name, viewport={"width": width, "height": 800}, color_scheme=scheme)
    assert page.evaluate("document.scrollingElement.scrollWidth") <= width
    shown = page.evaluate(
        "Array.from(document.querySelectorAll('figure')).map(f =>"
        " Array.from(f.querySelectorAll('svg')).filter(s => s.getBoundingClientRect().width > 0).length)"
    )
    assert set(shown) == {1}
    least = page.evaluate(
        "Math.min(...Array.from(document.querySelectorAll('figure svg'))"
        ".filter(s => s.getBoundingClientRect().width > 0).flatMap(s => "
        "Array.from(s.querySelectorAll('text[font-size]'))"
        ".map(t => parseFloat(t.getAttribute('font-size')) * s.getScreenCTM().a)))"
    )
    assert least > 7.0, "letters can be read"


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_letters_stand_out_in_the_dark(opened, name):
    page = opened(name, color_scheme="dark")
    colours = page.evaluate(
        "Array.from(new Set(Array.from("
        "document.querySelectorAll('p, td, th, li, h1, h2, figcaption, caption, svg text'))"
        ".map(e => e.closest('svg') ? getComputedStyle(e).fill : getComputedStyle(e).color)))"
    )
    paper = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert hexed(paper) == DARK_PAPER
    for colour in colours:
        assert contrast(hexed(colour), DARK_PAPER) >= 4.5, colour


def hexed(colour):
    """A colour as browsers compute it, in hexadecimal."""
    red, green, blue = (int(part) for part in colour.strip("rgba()").split(",")[:3])
    return f"#{red:02x}{green:02x}{blue:02x}"


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_pointing_at_a_place_says_what_it_is(opened, name):
    page = opened(name)
    mark = page.locator(".wide-figure .mark[data-event]").first
    mark.scroll_into_view_if_needed()
    mark.hover()
    assert page.locator(".tip").is_visible()
    told = page.locator(".tip").text_content()
    assert mark.get_attribute("data-event") in told and "\ufffd" not in told
    page.mouse.move(1, 1)
    assert not page.locator(".tip").is_visible()


@pytest.mark.slow
@pytest.mark.parametrize(("name", "figures"), [("diagnosis", 3), ("comparison", 4)])
def test_a_click_highlights_an_avalanche_everywhere(opened, name, figures):
    page = opened(name)
    mark = page.locator(".wide-figure .mark[data-event]").first
    event = mark.get_attribute("data-event")
    mark.scroll_into_view_if_needed()
    mark.click()
    counts = (
        "[new Set(Array.from(document.querySelectorAll('.mark.chosen')).map(m => m.closest('figure'))).size,"
        " document.querySelectorAll('tr.chosen').length]"
    )
    in_figures, in_tables = page.evaluate(counts)
    assert in_figures >= figures and in_tables >= 1
    chosen = page.evaluate("Array.from(document.querySelectorAll('.chosen')).map(e => e.dataset.event)")
    assert set(chosen) == {event}
    assert page.locator(".chooser").get_by_role("status").text_content().startswith("highlighted in")
    page.keyboard.press("Escape")
    assert page.evaluate("document.querySelectorAll('.chosen').length") == 0


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_an_avalanche_is_chosen_by_keyboard(opened, name):
    page = opened(name)
    button = page.locator("tr[data-event] th button").first
    button.focus()
    page.keyboard.press("Enter")
    assert button.get_attribute("aria-pressed") == "true"
    event = page.locator("tr.chosen").first.get_attribute("data-event")
    assert page.locator(".chooser select").input_value() == event
    page.locator(".chooser select").select_option("")
    assert page.evaluate("document.querySelectorAll('.chosen').length") == 0


@pytest.mark.slow
def test_tables_are_sorted_by_keyboard(opened):
    page = opened("comparison")
    table = page.locator("table.sortable").filter(has=page.locator("tr[data-event]"))
    column = 1
    rows = "Array.from(document.querySelectorAll('tr[data-event]'))"
    values = f"{rows}.map(r => parseFloat(r.cells[{column}].textContent))"
    head = table.locator("thead th").nth(column)
    head.locator("button").focus()
    assert page.evaluate("document.activeElement.matches(':focus-visible')")
    page.keyboard.press("Enter")
    rising = page.evaluate(values)
    assert rising == sorted(rising) and head.get_attribute("aria-sort") == "ascending"
    page.keyboard.press("Enter")
    falling = page.evaluate(values)
    assert falling == rising[::-1] and head.get_attribute("aria-sort") == "descending"


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_everything_is_there_without_scripts(opened, name):
    """The words and numbers are the same; only what helps to find them is missing."""
    plain = opened(name, java_script_enabled=False)
    assert plain.locator(".chooser").count() == 0 and plain.locator("button").count() == 0
    live = opened(name)
    assert live.locator(".chooser").count() == 1 and live.locator("button").count() > 10
    assert live.locator("svg:visible").count() == plain.locator("svg:visible").count() > 5
    for tags in (("td", "th"), ("p", "li", "figcaption", "caption")):
        assert texts(live.content(), *tags) == texts(plain.content(), *tags)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_on_paper_it_is_light_and_wide(opened, name, tmp_path):
    page = opened(name, color_scheme="dark", viewport={"width": 390, "height": 800})
    printed = page.pdf(path=tmp_path / "page.pdf", format="A4")
    assert printed.startswith(b"%PDF") and len(printed) < 5_000_000
    page.emulate_media(media="print", color_scheme="dark")
    assert hexed(page.evaluate("getComputedStyle(document.body).backgroundColor")) == PAPER
    assert page.locator(".wide-figure svg:visible").count() == page.locator("figure").count()
    assert page.locator("nav:visible, .chooser:visible").count() == 0
