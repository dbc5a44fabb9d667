"""Words of a comparison agree with how many there are."""

from report_cases import comparison
from test_report_html import Page

from skred.report.comparison.lay import lay_words
from skred.report.comparison.page import render_comparison


def one_of_each():
    document = comparison()
    document["models"] = document["models"][:1]
    document["campaign"] |= {
        "n_events": 1,
        "n_sensors": 1,
        "readings": {"observed": 1, "not_reached": 1, "missing": 1, "at_least": 1},
    }
    return document


def test_the_first_paragraph():
    several, one = lay_words(comparison())[0], lay_words(one_of_each())[0]
    assert several.startswith(
        "Three simple models of how avalanches slow down were fitted to the 4 avalanches"
    )
    assert one.startswith(
        "One simple model of how avalanches slow down was fitted to the 1 avalanche recorded"
    )


def test_the_recordings():
    text = Page(render_comparison(one_of_each(), {})).text
    assert "1 avalanche at 1 sensor:" in text and "1 reading observed," in text
    assert "1 reading missing" in text and "Of 1 reading only bounds are known" in text
    assert "4 avalanches at 4 sensors:" in Page(render_comparison(comparison(), {})).text


def test_scores_that_put_another_law_first_are_told_before_its_weight():
    document = comparison()
    best, other = (model["id"] for model in document["models"][:2])
    agreed = {name: [best, other] for name in ("exact", "loo", "waic", "evidence")}
    document["ranking"] = {"best": best, "orders": agreed}
    assert "do not rely" not in " ".join(lay_words(document))
    document["ranking"]["orders"] = agreed | {"evidence": [other, best], "waic": [other, best]}
    document["models"][1]["difference"]["practical"] = False  # not decided between the two anyway
    assert "do not rely" not in " ".join(lay_words(document))
    document["models"][1]["difference"]["practical"] = True
    told = lay_words(document)
    assert told[1] == f"Answer: {best}."
    doubt = f"other scores put another one first ({other} by WAIC and {other} by evidence)."
    assert any(one.startswith("But do not rely on that") and one.endswith(doubt) for one in told[2:-1])
