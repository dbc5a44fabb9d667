"""Words of the prediction page: the law with what was added, how far at least, and return periods."""

import pytest
from page_checks import check_page
from test_report_html import Page

from skred.report.prediction.page import render_prediction
from skred.report.prediction.words import period

ADDED = [
    {"title": "another surface", "place_m": [978.75, 1778.75], "used": True, "why": ""},
    {"title": "a force in no list", "place_m": None, "used": True, "why": ""},
    {"title": "a force in no list", "place_m": None, "used": True, "why": ""},
    {"title": "a dam", "place_m": [1900.0, 1950.0], "used": False, "why": "not on this track"},
]


def document(at_least=False, added=(), n_events=22):
    """A prediction along a track, without named places, and all that its page cannot do without."""
    row = {"share": 0.01, "unit": "m", "value": 2276.4, "low": 2150.0, "high": 2360.0, "at_least": at_least}
    return {
        "valid": True,
        "law": {"id": "pcm", "title": "PCM", "equation": "dU^2/(2 ds) = g sin(phi) - D U^2"},
        "campaign": {"name": "ryggfonn", "n_events": n_events},
        "track": {"name": "ryggfonn", "length_m": 2360.0},
        "smoothing_m": 10.0,
        "added": list(added),
        "at": [],
        "runout": {"exceeded_by": [row]},
        "statement": [],
    }


def text_of(made):
    return Page(render_prediction(made, {})).text


def test_the_law_has_what_was_added_and_acts_here():
    page = render_prediction(document(added=ADDED), {})
    check_page(page)
    told = "- D U^2, with another surface from s = 979 to 1779 m, with a force in no list"
    assert told in Page(page).text and "with a dam" not in Page(page).text
    assert "- D U^2, with" not in text_of(document())


def test_a_runout_to_the_end_of_the_track_is_at_least_that():
    assert "1 % run at least to s = 2276 m" in text_of(document(at_least=True))
    assert "1 % run beyond s = 2276 m" in text_of(document())


def test_one_avalanche_is_one():
    assert "calibrated on 1 avalanche of ryggfonn" in text_of(document(n_events=1))
    assert "calibrated on 22 avalanches of ryggfonn" in text_of(document())


@pytest.mark.parametrize(
    ("band", "told"),
    [
        ((0.04, 0.03, 0.05), "0.040 (0.030 to 0.050)"),
        ((0.5, 0.25, 1.24), "0.50 (0.25 to 1.2)"),
        ((9.96, 4.0, 123.0), "10.0 (4.0 to 120)"),
        ((1234.0, 56.7, None), "1200 (57 or more)"),
        ((None, 55.5, None), "more than 56"),
    ],
)
def test_return_periods_have_two_digits(band, told):
    assert period(dict(zip(("value", "low", "high"), band, strict=True))) == told
