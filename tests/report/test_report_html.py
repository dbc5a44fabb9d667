import json
import re
from html.parser import HTMLParser

import pytest
from report_cases import HOSTILE, comparison, picture

from skred.report.comparison.page import render_comparison
from skred.report.shared.numbers import decimals_for, fixed, floats, rounded, share


class Page(HTMLParser):
    """Collects text, tags and what the page refers to; fails on tags that do not close."""

    VOID = {"meta", "img", "br"}

    def __init__(self, html):
        super().__init__()
        self.tags, self.links, self.words, self.open = [], [], [], []
        self.feed(html)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.links += [value for name, value in attrs if name in ("src", "href", "srcset", "data", "action")]
        assert not any(name.startswith("on") for name, _ in attrs)
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if not {"script", "style"} & set(self.open):
            self.words.append(data)

    @property
    def text(self):
        return " ".join(" ".join(self.words).split())


@pytest.fixture
def figures(tmp_path):
    one = picture(tmp_path / "figure.png")
    return {name: one for name in ("comparison_elpd", "pareto_k", "pcm/trace", "pcm/joint")}


def test_the_page_needs_nothing_else(figures):
    html = render_comparison(comparison(), figures)
    page = Page(html)
    assert page.tags.count("svg") == 2 * 4, "each wide and narrow"
    assert all(link.startswith("#") for link in page.links)
    assert not re.search(r"https?://|//[a-z]|@import|url\(", html)
    assert page.tags.count("script") == 1 and "link" not in page.tags
    ids = set(re.findall(r'id="([^"]+)"', html))
    assert {link[1:] for link in page.links if link.startswith("#")} <= ids


def test_it_says_what_was_found(figures):
    text = Page(render_comparison(comparison(), figures)).text
    assert "The recordings prefer PCM. The difference to the next law is 4.90." in text
    assert "constant -64.60 ± 13.50 -4.90 " in text
    assert "equal-tailed" in text and "90 %" in text
    assert "optimistic with fewer than 100 events (here 4)" in text
    assert "posterior is that of the mean response" in text
    assert "+333 m" in text and "0.21" in text
    assert "m/s" in text and "63" in text, "runout relative to the reference"


@pytest.mark.parametrize(("n", "said"), [(0, "0 times"), (1, "once"), (2, "2 times")])
def test_how_often_fronts_stopped_above(n, said):
    document = comparison()
    document["campaign"]["readings"]["not_reached"] = n
    text = Page(render_comparison(document, {})).text
    assert f"14 readings observed, {said} the front stopped above the sensor" in text


def test_no_false_decimals_in_parameters(figures):
    text = Page(render_comparison(comparison(), figures)).text
    assert "0.287 0.027 0.243 to 0.333 0.0005 3240 3425 1.0020" in text


def test_a_failed_law_is_shown_and_not_ranked(figures):
    html = render_comparison(comparison(), figures)
    text = Page(html).text
    assert "1 of 3 laws did not converge and is not ranked: coulomb." in text
    assert "coulomb: did not converge, not ranked. r-hat 1.312 exceeds 1.01: more --tune" in text
    ranking = html[html.index("exact elpd") : html.index('id="trust"')]
    assert ">coulomb</th>" not in ranking and ">pcm</th>" in ranking


def test_nothing_passed_and_nothing_known():
    document = comparison()
    document["models"] = document["models"][2:]
    text = Page(render_comparison(document, {})).text
    assert "No law's chains converged, so nothing is compared." in text
    assert "n/a" in Page(render_comparison({"format": 1, "models": []}, {})).text


def nulls(value):
    """The document with every number null."""
    if isinstance(value, dict):
        return {key: nulls(item) for key, item in value.items()}
    if isinstance(value, list):
        return [nulls(item) for item in value]
    return None if isinstance(value, (int, float)) and not isinstance(value, bool) else value


def test_every_number_may_be_null(figures):
    text = Page(render_comparison(nulls(comparison()), figures)).text
    assert "None" not in text and "nan" not in text.lower().split()


def test_without_alpha_beta_and_reference(figures):
    document = {
        **comparison(),
        "alpha_beta": None,
        "alpha_beta_reason": "the slope never falls to 10 degrees",
    }
    document["campaign"]["reference_s_m"] = None
    text = Page(render_comparison(document, figures)).text
    assert "Not available: the slope never falls to 10 degrees" in text
    assert "There is no reference" in text and "2003" in text


def hostile(value, key=""):
    """The document with every text replaced by one that attacks."""
    if isinstance(value, dict):
        return {k: hostile(item, k) for k, item in value.items()}
    if isinstance(value, list):
        return [hostile(item) for item in value]
    return f'"><img src=x onerror=alert(1)>{HOSTILE}' if isinstance(value, str) else value


def test_names_are_escaped(figures):
    document = hostile(comparison())
    html = render_comparison(document, {f"{document['models'][0]['id']}/trace": figures["pareto_k"]})
    page = Page(html)
    assert page.tags.count("script") == 1
    assert all(link.startswith("#") for link in page.links)
    assert "<script>alert(" in page.text


def test_the_document_is_plain_json():
    json.dumps(comparison(), allow_nan=False)


@pytest.mark.parametrize(
    ("value", "sd", "mcse", "shown"),
    [
        (0.28651, 0.0271, 0.0005, "0.287"),
        (0.28651, 0.0271, 0.004, "0.287"),
        (0.28651, 0.0271, 0.02, "0.29"),
        (4512.3, 571.0, 9.0, "4510"),
        (0.00226, 0.00026, None, "0.00226"),
        (3.14159, None, None, "3.14"),
        (2.5e-10, 1.2e-11, None, "2.50e-10"),
        (0.0, 0.1, None, "0"),
        (None, 0.1, None, "n/a"),
    ],
)
def test_decimals_follow_the_spread(value, sd, mcse, shown):
    assert rounded(value, decimals_for(sd, mcse)) == shown


def test_numbers():
    assert fixed(-0.001) == "0.00" and fixed(3, 1, signed=True) == "+3.0" and fixed(True) == "n/a"
    assert fixed(float("nan")) == "n/a" and fixed(float("inf")) == "n/a"
    assert [share(v) for v in (0.0, 0.001, 0.5, 0.999, 1.0, None)] == [
        "0.00",
        "<0.01",
        "0.50",
        ">0.99",
        "1.00",
        "n/a",
    ]
    assert str(floats([1, None, "x"])) == "[ 1. nan nan]"
