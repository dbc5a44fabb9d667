"""The scorecard as a whole: data, page and figures, for many trials, few, and bad ones."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from page_checks import check_page
from scorecard_cases import CRASH, QUIET, drawn, effect, named, truth

from skred.prove.scorecard import scorecard, write_scorecard
from skred.report.folders import write_reports

FIGURES = {
    "false_alarms",
    "power",
    "confusion",
    "confusion_classes",
    "places",
    "reliability",
    "gain",
    "baselines",
}


def written(folder: Path) -> tuple[dict[str, Any], str]:
    """The scorecard's data, no NaN allowed, and its page."""

    def refuse(word: str) -> None:
        raise ValueError(word)

    text = (folder / "scorecard.json").read_text(encoding="utf-8")
    return json.loads(text, parse_constant=refuse), (folder / "scorecard.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def card(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    folder = tmp_path_factory.mktemp("card") / "new"
    trials, answers = drawn(70, seed=1)
    trials[0]["truth"]["base_model"] = "<b>law</b>"
    _, other = drawn(70, seed=9)
    scored = {name: {**one, "score": 0.5} for name, one in other.items()}
    ledger = {"seed": 7, "version": "<script>alert(1)</script>", "hashes": {"trial-0001": "ab"}}
    methods = {
        "skred": answers,
        "always <i>nothing</i>": {name: QUIET for name in answers},
        "$other_$": scored,
    }
    document = write_scorecard(folder, ledger, trials, methods)
    write_reports(folder)
    return folder, document


def test_files_are_written_and_the_data_are_returned(card: tuple[Path, dict[str, Any]]) -> None:
    folder, document = card
    data, _ = written(folder)
    assert data == document
    assert {file.stem for file in folder.glob("*.png")} == FIGURES
    assert not list(folder.glob(".*"))


def test_every_part_has_every_kind(card: tuple[Path, dict[str, Any]]) -> None:
    _, document = card
    for parts in document["methods"].values():
        for part in ("open", "masked"):
            assert set(parts[part]) == {"all", "sparse", "dense"}
            assert parts[part]["all"]["n"] == parts[part]["sparse"]["n"] + parts[part]["dense"]["n"]
    own = document["methods"]["skred"]
    assert own["open"]["all"]["n"] + own["masked"]["all"]["n"] == document["n_trials"] == 70
    assert {bar["goal"] for bar in document["bars"]} >= {
        "false alarms", "detection", "naming", "selectivity", "probabilities", "unlisted truth", "place",
        "improvement", "strength", "time", "baselines",
    }  # fmt: skip
    assert len(document["trials"]) == 70


def test_the_page_is_self_contained_and_names_are_escaped(card: tuple[Path, dict[str, Any]]) -> None:
    _, page = written(card[0])
    check_page(page)
    assert (
        page.count("<script>") == 1
        and "<script>alert" not in page
        and "<i>nothing" not in page
        and "<b>law" not in page
    )
    assert "always &lt;i&gt;nothing" in page and "&lt;b&gt;law&lt;/b&gt;" in page
    assert page.count("<figure") == len(FIGURES) and page.count("<svg") == 2 * len(FIGURES)
    assert 'src="http' not in page and 'href="http' not in page and "nan" not in page.replace("nano", "")


def test_the_same_answers_give_the_same_scorecard() -> None:
    trials, answers = drawn(21, seed=4)
    assert scorecard({}, trials, {"skred": answers}) == scorecard({}, trials, {"skred": answers})


def test_order_of_trials_does_not_matter_to_counts() -> None:
    trials, answers = drawn(21, seed=4)
    one, other = (
        scorecard({}, those, {"skred": answers})["methods"]["skred"]["open"]["all"]
        for those in (trials, trials[::-1])
    )
    assert one["confusion"] == other["confusion"] and one["false_alarms"] == other["false_alarms"]


DRAG = truth("listed", effect("segment_drag"))
HOSTILE: dict[str, tuple[list[dict[str, Any]], list[dict[str, Any] | None]]] = {
    "three trials": (
        [truth("nothing"), DRAG, truth("unlisted", effect("wave"))],
        [QUIET, named("obstacle"), QUIET],
    ),
    "no unlisted": ([truth("nothing"), DRAG], [QUIET, QUIET]),
    "only crashes": ([truth("nothing"), DRAG, truth("masked", effect("entrainment"))], [CRASH, None, CRASH]),
    "only nulls": ([truth("nothing"), truth("nasty", nasty="odd_event")], [QUIET, QUIET]),
    "only masked": ([truth("masked", effect("segment_drag"))], [named("segment_drag")]),
    "one time-out": ([DRAG], [{"verdict": "timeout"}]),
    "no trial": ([], []),
    "junk": (
        [DRAG, DRAG, DRAG],
        [
            named("strange <id>", probability={"nothing": float("nan")}),
            named("obstacle", location={"s_from_m": None}, gain=None),
            {"verdict": "instrument", "mechanism": "segment_drag", "strength": None, "evidence": None,
             "wall_seconds": "long", "indistinguishable": None, "mechanisms": None, "probability": {}},
        ],
    ),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("case", HOSTILE)
def test_few_trials_and_bad_answers_do_not_fail(case: str, tmp_path: Path) -> None:
    truths, given = HOSTILE[case]
    trials = [{"trial": f"trial-{k:04d}", "truth": one} for k, one in enumerate(truths)]
    answers = {f"trial-{k:04d}": one for k, one in enumerate(given) if one is not None}
    write_scorecard(tmp_path, {}, trials, {"skred": answers, "silent": {}})
    write_reports(tmp_path)
    data, page = written(tmp_path)
    assert data["n_trials"] == len(trials)
    assert not any(bar["status"] == "met" for bar in data["bars"])
    if case == "only crashes":
        found = data["methods"]["skred"]["open"]["all"]
        assert found["failures"]["crash"]["share"] == 1.0 and found["probability"] is None
        assert found["unlisted"]["all"]["wrong_name"] == {
            "n": 0,
            "hits": 0,
            "share": None,
            "low": None,
            "high": None,
        }
    assert "no trial" in page and "strange <id>" not in page
