import json
import re

import pytest
from hierarchical_cases import hierarchical_comparison, hierarchical_entry, population_parameters
from report_cases import HOSTILE, comparison, gate, picture
from test_report_html import Page, hostile, nulls
from test_report_tables import shown

from skred.report.comparison.page import render_comparison
from skred.report.shared.document import is_hierarchical, side_by_side
from skred.report.shared.relative import relative_new_avalanche
from skred.report.shared.tables import comparison_table, summary_table

NAMES = (
    "comparison_elpd", "likelihoods", "predictions", "pcm/new_avalanche", "pcm/population", "pcm/events",
    "pcm/along_track", "constant/new_avalanche",
)  # fmt: skip


@pytest.fixture
def figures(tmp_path):
    return dict.fromkeys(NAMES, picture(tmp_path / "figure.png"))


def test_sections_are_numbered_and_linked(figures):
    html = render_comparison(hierarchical_comparison(), figures)
    page = Page(html)
    headings = re.findall(r'<h2 id="([^"]+)">(\d+)\. ([^<]+)</h2>', html)
    assert [int(number) for _, number, _ in headings] == list(range(1, 11))
    assert [link[1:] for link in page.links if link.startswith("#")] == [anchor for anchor, _, _ in headings]
    titles = [title for _, _, title in headings]
    assert titles[3:6] == [
        "Every avalanche its own friction",
        "Pooled and hierarchical side by side",
        "Error models, compared",
    ]
    assert page.tags.count("svg") == 2 * len(NAMES)
    assert not re.search(r"https?://|@import|url\(", html)


def test_pooled_reports_have_none_of_it(figures):
    for document in (comparison(), {**comparison(), "likelihood": "pooled", "pooled": None}):
        html = render_comparison(document, {})
        text = Page(html).text
        assert "7. How the numbers were made" in text and "exact elpd" in text
        for words in ("own friction", "side by side", "Error models", "population", "integral", "refitted"):
            assert words not in text
    assert not is_hierarchical({}) and is_hierarchical(hierarchical_comparison())


def test_the_population_has_units_and_no_false_decimals(figures):
    text = Page(render_comparison(hierarchical_comparison(), figures)).text
    assert "median turbulent drag D 1/m 0.00311 0.00091 0.00166 to 0.00466" in text
    assert "spread sd(log μ) - 0.210 0.053 0.125 to 0.301 1.41" in text
    assert "correlation corr(log μ, log D) - -0.19 0.22" in text
    assert "coulomb (failed) median dry friction" in text
    assert "constant 0.0026 0.0003 4" in text and "limit is 0.0091 nats per avalanche" in text


def test_new_avalanches_stand_beside_the_recorded(figures):
    text = Page(render_comparison(hierarchical_comparison(), figures)).text
    assert "b m/s pcm 0.63 26 6 to 56 0.71 22 1 to 43 20" in text
    assert "runout m from the reference pcm - -140 -1300 to 340 - 30 -150 to 220 22" in text
    assert "mean response" not in text.split("Pooled calibration One parameter vector")[0]


def test_both_calibrations_side_by_side(figures):
    document = hierarchical_comparison()
    text = Page(render_comparison(document, figures)).text
    assert "pcm -55.70 best -58.70 (0.20) -59.70 best -62.70 (0.20)" in text
    assert "coulomb did not converge not calibrated" in text
    assert "PCM stays first. The spread of D now explains what Sigma did." in text
    assert [row["id"] for row in side_by_side(document)] == ["pcm", "constant", "coulomb"]


def test_without_the_pooled_one_and_error_models(figures):
    document = {**hierarchical_comparison(), "pooled": {"reason": "one reading only.", "models": []}}
    text = Page(render_comparison(document, figures)).text
    assert "There is no pooled calibration of these recordings: one reading only." in text
    document = {**document, "pooled": None, "error_models": None, "changes": []}
    text = Page(render_comparison(document, figures)).text
    assert "side by side" not in text and "Error models" not in text and "8. How the numbers" in text


def test_error_models(figures):
    document = hierarchical_comparison()
    text = Page(render_comparison(document, figures)).text
    assert "The best law (pcm) was calibrated with each of these models." in text
    assert "Differences are to the model robust, paired" in text
    assert "robust robust, in words -52.40 ± 11.20 - - -55.30 (0.12) 2 passed" in text
    assert "normal normal, in words -58.01 ± 11.20 -5.61 ± 0.83 yes -60.91 (0.12) 2 passed" in text
    assert "student student, in words did not converge, not compared : r-hat 1.312 exceeds 1.01" in text


def test_every_number_may_be_null_and_every_name_hostile(figures):
    text = Page(render_comparison(nulls(hierarchical_comparison()), figures)).text
    assert "None" not in text and "nan" not in text.lower().split()
    document = hostile(hierarchical_comparison())
    document["likelihood"] = "hierarchical"
    page = Page(render_comparison(document, {}))
    assert page.tags.count("script") == 1 and "img" not in page.tags
    assert all(link.startswith("#") for link in page.links)


def test_nothing_passed():
    document = hierarchical_comparison()
    document["models"] = document["models"][2:]
    text = Page(render_comparison(document, {})).text
    assert "No law's chains converged" in text and "One law was calibrated" in text
    assert "n/a" in Page(render_comparison({"likelihood": "hierarchical", "models": []}, {})).text


def test_the_document_is_plain_json():
    json.dumps(hierarchical_comparison(), allow_nan=False)


def test_new_avalanches_without_numbers():
    row = relative_new_avalanche({}, {"sensor": "a", "unit": "m/s"})
    assert row["interval"] == "-" and row["mean"] == "n/a" and row["reached"] == "n/a"


def test_comparison_fits_a_narrow_terminal():
    text = shown(comparison_table(hierarchical_comparison()))
    assert "…" not in text and "with every avalanche its own friction" in text
    assert "refitted where that cannot be trusted" in " ".join(text.split())
    assert "Differences of the pooled calibration: pcm 0.00, constant -4.90." in " ".join(text.split())
    assert max(map(len, text.splitlines())) <= 80


def test_summary_has_the_population_and_new_avalanches():
    text = shown(summary_table(hierarchical_entry("pcm", [-1.0] * 4, [-1.0] * 4)))
    words = " ".join(text.split())
    assert "…" not in text and "mean response" not in text
    assert "correlation corr(log mu, 1 -0.19 0.22" in words
    assert "b m/s 0.63 6 to 56 26 0.71 1 to 43 22 20" in words
    assert "runout m - 640 to 2280 1800 - 1790 to 2160 1970 22" in words
    assert "Errors: normal, with a few outliers." in words and "Converged." in words


def test_names_are_not_markup():
    model = hierarchical_entry(HOSTILE, [-1.0] * 4, [-1.0] * 4)
    model.update(title=HOSTILE, gate=gate(passed=False), error_model={"title": HOSTILE})
    model["parameters"] = [{**population_parameters()[0], "name": HOSTILE}]
    model["new_avalanche"][0]["sensor"] = HOSTILE
    text = shown(summary_table(model), 200)
    assert "[red]" in text.replace("\n", "") and "\x1b" not in text
