"""The report's section on avalanches that the diagnosis has not seen."""

import io
import re

from diagnosis_report_cases import documents
from rich.console import Console
from test_report_html import Page

from skred.report.diagnosis.report import diagnosis_table, render_diagnosis

HOSTILE = "<script>alert(1)</script>[red]"
LOCKED = {
    "events": ["e03", HOSTILE],
    "log_score_before": [-20.25, -14.0],
    "log_score_after": [-17.0, -13.5],
    "elpd_diff": 3.75,
    "elpd_se": 1.375,
    "rmse_velocity_before": 5.0,
    "rmse_velocity_after": 3.0,
    "rmse_runout_before": None,
    "rmse_runout_after": None,
    "coverage_90_before": 0.75,
    "coverage_90_after": 1.0,
}
FOLDS = {
    "k": 2,
    "folds": [
        {"events": ["a", "b"], "mechanism": "segment_drag", "mechanisms": ["segment_drag"], "elpd_diff": 8.0},
        {"events": [HOSTILE], "mechanism": None, "mechanisms": [], "elpd_diff": 0.0},
    ],
    "elpd_diff": 8.0,
    "elpd_se": 2.5,
}


def text_of(**more):
    document, tree = documents("sensor")
    html = render_diagnosis(document | more, tree, {})
    headings = re.findall(r'<h2 id="([^"]+)">(\d+)\.', html)
    assert [int(number) for _, number in headings] == list(range(1, len(headings) + 1))
    page = Page(html)
    assert page.tags.count("script") == 1 and "None" not in page.text
    return " ".join(page.text.split()), [anchor for anchor, _ in headings]


def test_without_them_there_is_no_section():
    text, anchors = text_of()
    assert "unseen" not in anchors and "locked" not in text


def test_locked_avalanches():
    text, anchors = text_of(locked=LOCKED)
    assert anchors[anchors.index("unseen") - 1] == "before-after"
    assert "+3.8 nats (2 se 2.8), no practical difference" in text
    for words in ("log score of e03 [nats] −20.2 −17.0", HOSTILE, "[m/s] 5.0 3.0"):
        assert words.replace("−", "-") in text.replace("−", "-")
    assert "runouts, root mean square [m] n/a" not in text


def test_locked_avalanches_and_nothing_to_compare():
    nothing = {key: None if key.endswith(("after", "diff", "se")) else value for key, value in LOCKED.items()}
    assert "nothing to compare" in text_of(locked=nothing)[0]
    unopened = dict.fromkeys(LOCKED) | {"events": ["e03"]}
    assert "nothing was predicted of them" in text_of(locked=unopened)[0]


def test_outer_folds():
    text, _ = text_of(outer_folds=FOLDS)
    assert "repeated 2 times" in text and "+8.0 nats (2 se 5.0)" in text
    assert "a, b segment drag +8.0" in text
    console = Console(file=io.StringIO(), width=100)
    console.print(diagnosis_table(documents("sensor")[0] | {"outer_folds": FOLDS, "locked": LOCKED}))
    told = console.file.getvalue()
    assert re.search(r"outer folds +\+8\.0 nats \(2 se 5\.0\)", told) and re.search(
        r"locked avalanches +\+3\.8", told
    )
