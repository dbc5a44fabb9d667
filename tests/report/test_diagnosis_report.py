import io
import json
import re

import pytest
from diagnosis_report_cases import diagnosis
from rich.console import Console
from test_report_html import Page, nulls

from skred.diagnosis.verdict.document import verdict
from skred.report.diagnosis.equation import equations, formula
from skred.report.diagnosis.flat import flat
from skred.report.diagnosis.report import FIGURES, diagnosis_table, render_diagnosis, save_diagnosis_figures

KINDS = ("cannot", "gate", "nothing", "silent", "unexplained", "sensor", "tie", "two")
HOSTILE = "<script>alert(1)</script>$\\frac{[red]&'\""


@pytest.fixture(autouse=True)
def coarse_figures(monkeypatch):
    monkeypatch.setattr("skred.report.shared.style.DPI", 40)


def document_of(found):
    return verdict(found) | {"settings": {"draws": 1000, "replicas": 50}}


@pytest.fixture
def picture(tmp_path):
    file = tmp_path / "figure.png"
    file.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))
    return file


def shown(document):
    console = Console(file=io.StringIO(), width=80)
    console.print(diagnosis_table(document))
    return console.file.getvalue()


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_has_a_page_that_needs_nothing_else(kind, picture):
    found = diagnosis(kind)
    html = render_diagnosis(found, document_of(found), {"where": picture})
    page = Page(html)
    headings = re.findall(r'<h2 id="([^"]+)">(\d+)\. ([^<]+)</h2>', html)
    assert [int(number) for _, number, _ in headings] == list(range(1, 9))
    assert [link[1:] for link in page.links if link.startswith("#")] == [anchor for anchor, _, _ in headings]
    assert page.tags.count("img") == 1 and "script" not in page.tags
    assert not re.search(r"https?://|@import|url\(", html)
    assert document_of(found)["statement"] in page.text
    assert "None" not in page.text and "nan" not in page.text.split()


@pytest.mark.parametrize(
    ("kind", "names"),
    [
        ("cannot", {"where"}),
        ("silent", {"check", "where", "probabilities", "strength", "places", "left_out"}),
        (
            "two",
            {"check", "where", "probabilities", "strength", "places", "left_out", "scores"}
            | {"probabilities_2", "strength_2", "places_2"},
        ),
    ],
)
def test_figures_that_apply_are_written(kind, names, tmp_path):
    found = diagnosis(kind)
    files = save_diagnosis_figures(found, tmp_path)
    assert set(files) == names and names <= set(FIGURES)
    assert all(
        file.read_bytes().startswith(b"\x89PNG") and file.parent == tmp_path for file in files.values()
    )
    page = Page(render_diagnosis(found, document_of(found), files))
    assert page.tags.count("img") == len(names)


def test_a_tie_says_that_it_is_one():
    found = diagnosis("tie")
    text = Page(render_diagnosis(found, document_of(found), {})).text
    assert "cannot tell entrainment from segment drag" in text
    assert "Segment drag is the same term on a stretch" in text
    assert "e for s 1 < s < s 2" in text and "here" in text
    assert "doi 10." in text
    assert "predicted better" in text and "difference under 4 is no practical difference" in text
    assert "student errors" in text and "61 12 5.1" in text


def test_two_mechanisms_and_a_covariate():
    found = diagnosis("two")
    text = Page(render_diagnosis(found, document_of(found), {})).text
    assert "A second mechanism, given the first" in text
    assert "Associated with, not necessarily caused by" in text
    assert text.count("its crown, here") == 1
    assert len(equations(flat(found))["terms"]) == 2


def test_an_instrument_changes_no_equation_of_motion():
    found = diagnosis("sensor")
    text = Page(render_diagnosis(found, document_of(found), {})).text
    assert "keeps its terms; what changes is how the recordings are read" in text
    assert "reads 1" in text and "% too high" in text and equations(flat(found))["terms"] == []


def test_what_is_silent_says_so():
    found = diagnosis("silent")
    text = Page(render_diagnosis(found, document_of(found), {})).text
    assert "silence means little here" in text and "no place is named" in text
    assert "Nothing is added to it" in text and "no alarm" in text
    text = Page(render_diagnosis(diagnosis("gate"), document_of(diagnosis("gate")), {})).text
    assert "The diagnosis ended before this step" in text and "r-hat 1.300 exceeds 1.01" in text


@pytest.mark.parametrize("kind", ["sensor", "two", "unexplained"])
def test_hostile_names_are_shown_and_not_interpreted(kind, tmp_path):
    found = diagnosis(kind, HOSTILE)
    document = document_of(found)
    files = save_diagnosis_figures(found, tmp_path) if kind == "sensor" else {}
    html = render_diagnosis(found, document, files)
    page = Page(html)
    assert "script" not in page.tags and "<script" not in html
    assert HOSTILE in page.text
    table = shown(document)
    assert "<script>" in table and "\x1b" not in table and "[red]" in table


def test_the_terminal_says_what_was_found():
    table = shown(document_of(diagnosis("tie")))
    for words in ("missing physics", "entrainment", "tied with", "segment_drag", "m⁻¹", "p-value", "s = "):
        assert words in table
    assert re.search(r"elpd difference +\+\d+\.\d \(2 se", table)
    assert max(len(line) for line in table.splitlines()) <= 80


def test_anything_may_be_null_at_the_terminal():
    for kind in KINDS:
        document = json.loads(json.dumps(document_of(diagnosis(kind))))
        for one in (document, nulls(document), dict.fromkeys(document), {}):
            table = shown(one)
            assert "p-value" in table and "nan" not in table.split()


def test_a_formula_keeps_what_it_says():
    assert formula("-D_f U^2 for s_1 < s < s_2") == (
        "-D<sub>f</sub> U<sup>2</sup> for s<sub>1</sub> &lt; s &lt; s<sub>2</sub>"
    )
    assert formula("mu g cos(phi)") == "μ g cos(φ)"
