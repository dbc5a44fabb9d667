import io
import re
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from diagnosis_report_cases import documents
from page_checks import check_page
from report_cases import picture
from rich.console import Console
from test_report_html import Page, nulls

from skred.campaign import Sensor
from skred.report.diagnosis.conditional import conditional_rows, styles_of
from skred.report.diagnosis.equation import equations, formula
from skred.report.diagnosis.events import reading_rows
from skred.report.diagnosis.report import FIGURES, diagnosis_table, render_diagnosis, save_diagnosis_figures

KINDS = ("cannot", "gate", "nothing", "silent", "unexplained", "sensor", "tie", "two")
HOSTILE = "<script>alert(1)</script>$\\frac{[red]&'\""


@pytest.fixture(autouse=True)
def coarse_figures(monkeypatch):
    monkeypatch.setattr("skred.report.shared.style.DPI", 40)


def rendered(kind, figures=None):
    document, tree = documents(kind)
    return render_diagnosis(document, tree, figures or {})


def shown(document):
    console = Console(file=io.StringIO(), width=80)
    console.print(diagnosis_table(document))
    return console.file.getvalue()


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_has_a_page_that_needs_nothing_else(kind, tmp_path):
    html = rendered(kind, {"where": picture(tmp_path / "figure.png")})
    page = Page(html)
    headings = re.findall(r'<h2 id="([^"]+)">(\d+)\. ([^<]+)</h2>', html)
    assert [int(number) for _, number, _ in headings] == list(range(1, 9))
    assert [link[1:] for link in page.links if link.startswith("#")] == [anchor for anchor, _, _ in headings]
    assert page.tags.count("svg") == 2 and page.tags.count("script") == 1
    assert not re.search(r"https?://|@import|url\(", html)
    assert documents(kind)[0]["statement"] in page.text
    assert "None" not in page.text and "nan" not in page.text.split()


def test_what_is_left_and_not_added_is_on_the_page():
    document, tree = documents("two")
    left = {"most_probable": "covariate_friction", "covariate": "heading", "sensor": None}
    document["left"] = left | {"probability": 0.54, "nothing": 0.001, "reason": "no more than 2 are added"}
    document["report"]["checks"][-1]["fired"] = True
    text = " ".join(Page(render_diagnosis(document, tree, {})).text.split())
    assert "Everything was compared once more, and nothing more was added: no more than 2 are added." in text
    assert re.search(r"Most probable: [^.;]*\(heading\), 0\.54; nothing more: <0\.01\.", text)


@pytest.mark.parametrize(
    ("kind", "names"),
    [
        ("cannot", {"where"}),
        ("silent", {"check", "where", "probabilities", "strength", "places", "left_out"}),
        (
            "two",
            {"check", "where", "probabilities", "strength", "places", "left_out", "scores", "influence"}
            | {"probabilities_2", "strength_2", "places_2", "conditional_speeds", "conditional_runouts"},
        ),
    ],
)
def test_figures_that_apply_are_written(kind, names, tmp_path):
    figures = save_diagnosis_figures(*documents(kind), tmp_path)
    files = {name: one.file for name, one in figures.items()}
    assert set(files) == names and names <= set(FIGURES)
    assert all(
        file.read_bytes().startswith(b"\x89PNG") and file.parent == tmp_path for file in files.values()
    )
    page = Page(rendered(kind, figures))
    assert page.tags.count("svg") == 2 * len(names)


@pytest.mark.parametrize(("n", "said"), [(0, "0 cases"), (1, "1 case"), (2, "2 cases")])
def test_how_many_readings_are_not_there(n, said):
    document, tree = documents("nothing")
    campaign = document["report"]["campaign"]
    counts = campaign["readings"] | {"not_reached": n, "missing": n}
    report = document["report"] | {"campaign": campaign | {"readings": counts}}
    text = Page(render_diagnosis(document | {"report": report}, tree, {})).text
    assert f"In {said} the front stopped above" in text and f"In {said} the reading is missing" in text


def test_a_tie_says_that_it_is_one():
    text = Page(rendered("tie")).text
    assert "cannot tell segment drag from entrainment" in text
    assert "Entrainment is the same term on a stretch" in text
    assert "D f U 2 for s 1 < s < s 2" in text and "here" in text
    assert "doi 10." in text
    assert "predicted better" in text and "difference below 4 nats is no practical difference" in text
    assert "student errors" in text and "61 12 5.1" in text


def test_how_well_the_place_is_known_and_what_is_gained_is_told():
    document, tree = documents("tie")
    place = document["location"] | {"s_from_interval_m": [900.0, 1100.0], "s_to_interval_m": [1500.0, 1700.0]}
    sensors = [{"sensor": "LC", "gain": "no clear gain"}]
    known = document | {"location": place, "conditional": {"sensors": sensors, "statement": "none"}}
    text = Page(render_diagnosis(known, tree, {})).text
    assert "it begins between 900 and 1100 m and ends between 1500 and 1700 m" in text
    assert "no reading is clearly predicted better" in text
    better = known | {"conditional": {"sensors": [*sensors, {"sensor": "LD", "gain": "better"}]}}
    assert "no reading is clearly" not in Page(render_diagnosis(better, tree, {})).text


def test_two_mechanisms_and_a_covariate():
    text = Page(rendered("two")).text
    assert "A second mechanism, given the first" in text
    assert "Associated with, not necessarily caused by" in text
    assert text.count("the middle of the place where it acts, here") == 1
    assert len(equations(documents("two")[0])["terms"]) == 2


def test_an_instrument_changes_no_equation_of_motion():
    text = Page(rendered("sensor")).text
    assert "keeps its terms; what changes is how the recordings are read" in text
    assert "reads 1" in text and "% too high" in text and equations(documents("sensor")[0])["terms"] == []


def test_what_is_silent_says_so():
    text = Page(rendered("silent")).text
    assert "silence means little here" in text and "no place is named" in text
    assert "Nothing is added to it" in text and "no alarm" in text
    text = Page(rendered("gate")).text
    assert "The diagnosis ended before this step" in text and "r-hat 1.300 exceeds 1.01" in text


@pytest.mark.parametrize("kind", ["sensor", "two", "unexplained"])
def test_hostile_names_are_shown_and_not_interpreted(kind, tmp_path):
    document, tree = documents(kind, HOSTILE)
    files = save_diagnosis_figures(document, tree, tmp_path) if kind == "sensor" else {}
    html = render_diagnosis(document, tree, files)
    page = Page(html)
    check_page(html)
    assert "<script>alert" not in html
    assert HOSTILE in page.text
    table = shown(document)
    assert "<script>" in table and "\x1b" not in table and "[red]" in table


def attacked(value):
    """A document in which every text attacks."""
    if isinstance(value, dict):
        return {key: attacked(item) for key, item in value.items()}
    if isinstance(value, list):
        return [attacked(item) for item in value]
    return f"{value}{HOSTILE}" if isinstance(value, str) else value


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["gate", "two", "sensor", "unexplained"])
def test_every_text_of_a_document_is_escaped(kind, tmp_path):
    document, tree = attacked(documents(kind)[0]), documents(kind)[1]
    html = render_diagnosis(document, tree, save_diagnosis_figures(document, tree, tmp_path))
    check_page(html)
    assert "<script>alert" not in html


@pytest.mark.parametrize("kind", KINDS)
def test_anything_may_be_null_on_the_page(kind):
    document, tree = documents(kind)
    report = document["report"]
    without = [document | {"report": report | {key: None}} for key in report]
    for one in (nulls(document), dict.fromkeys(document), {}, *without):
        page = Page(render_diagnosis(one, tree, {}))
        assert "None" not in page.text and "nan" not in page.text.split()


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["gate", "two", "unexplained"])
def test_anything_may_be_null_in_figures(kind, tmp_path):
    document, tree = documents(kind)
    for one in (nulls(document), {}):
        assert "where" in save_diagnosis_figures(one, tree, tmp_path)


def test_the_terminal_says_what_was_found():
    table = shown(documents("tie")[0])
    for words in ("missing physics", "entrainment", "tied with", "segment_drag", "1/m", "p-value", "s = "):
        assert words in table
    assert re.search(r"elpd difference +\+\d+\.\d nats \(2 se", table)
    assert max(len(line) for line in table.splitlines()) <= 80


def test_anything_may_be_null_at_the_terminal():
    for kind in KINDS:
        document = documents(kind)[0]
        for one in (document, nulls(document), dict.fromkeys(document), {}):
            table = shown(one)
            assert "p-value" in table and "nan" not in table.split()


def test_a_formula_keeps_what_it_says():
    assert formula("-D_f U^2 for s_1 < s < s_2") == (
        "-D<sub>f</sub> U<sup>2</sup> for s<sub>1</sub> &lt; s &lt; s<sub>2</sub>"
    )
    assert formula("mu g cos(phi)") == "μ g cos(φ)"


def test_predictions_by_few_draws_have_a_star():
    tree = documents("unexplained")[1].copy(deep=True)
    given = tree["conditional"].to_dataset()
    event, sensor = np.argwhere(given["n_above"].sel(when="after").transpose("event", "sensor").values > 0)[0]
    given["effective"].loc[{"when": "after"}][{"event": event, "sensor": sensor}] = 12.0
    tree["conditional"] = xr.DataTree(given)
    stars = [band for row in reading_rows(tree) for band in row["above"] if band.endswith("*")]
    assert len(stars) == 1
    assert not any(band.endswith("*") for row in reading_rows(tree) for band in row["others"])


@pytest.mark.parametrize("kind", [pytest.param("tie", marks=pytest.mark.slow), "unexplained"])
def test_the_improvement_is_on_the_first_screen(kind, tmp_path):
    """Readings given those above: figure and sentence before the contents, the table in its section."""
    document, tree = documents(kind)
    files = save_diagnosis_figures(document, tree, tmp_path)
    assert all(files[f"conditional_{one}"].file.stat().st_size > 5_000 for one in ("speeds", "runouts"))
    html = render_diagnosis(document, tree, files)
    first, rest = html.split("<nav>")
    assert first.count("<svg") == 2 * 3 and "predicted from all speeds of the same avalanche" in first
    assert ("A ring marks" in first) == bool(document["influence"]["carried_by"])
    sentence = document["conditional"]["statement"]
    assert sentence.startswith("Given the readings") and sentence in first
    table = rest[rest.index("Given the readings above") :]
    row = document["conditional"]["sensors"][0]["all"]
    assert f"{row['rmse_before']:.1f} → {row['rmse_after']:.1f}" in table and "CD [m/s]" in table


def test_nothing_is_given_above_where_nothing_was_added(tmp_path):
    document, tree = documents("nothing")
    assert document["conditional"] is None and "conditional" not in tree.children
    assert not any(
        name.startswith("conditional") for name in save_diagnosis_figures(document, tree, tmp_path)
    )
    assert "Given the readings" not in render_diagnosis(document, tree, {})


def test_many_sensors_share_a_style():
    """Forty sensors are put together by where they are, each in one part only."""
    sensors = tuple(Sensor(f"g{k}", "front_velocity", 10.0 * k, 10.0 * k, 0.1, 1.0) for k in range(40))
    styles = styles_of(SimpleNamespace(sensors=sensors), np.full(40, True), 0)
    assert len(styles) == 6 and styles[0].label == "s = 0 to 60 m"
    assert np.sum([style.columns for style in styles], axis=0).tolist() == [1] * 40


def test_avalanches_that_carry_the_answer_have_rows_of_their_own():
    document, _ = documents("unexplained")
    rows = [row["name"] for row in conditional_rows(document)]
    assert rows[:3] == ["CD [m/s]", "those that carry the answer", "the others"]
    assert rows[-3] == "all speeds [m/s]"
    assert ". Without them, " in document["conditional"]["statement"]
    # Where no few avalanches carry it, there are no others either.
    document, _ = documents("tie")
    assert [row["name"] for row in conditional_rows(document)] == [
        "CD [m/s]", "b [m/s]", "runout [m]", "all speeds [m/s]"
    ]  # fmt: skip
    assert "that carry the answer" not in document["conditional"]["statement"]
