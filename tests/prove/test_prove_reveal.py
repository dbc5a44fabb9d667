"""Revealing: nothing is scored unless all is as it was sealed."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from prove_cases import Alone, silent
from rich.console import Console

from skred.campaign import read_campaign
from skred.cli.main import run as skred
from skred.diagnosis.predict.gain import realised_gain
from skred.diagnosis.predict.predictor_document import as_dict
from skred.diagnosis.predict.unseen import Predictor
from skred.errors import InputError
from skred.prove.folder import ProofFolder, read_object
from skred.prove.ledger import read_ledger
from skred.prove.reveal import reveal
from skred.prove.show import latest_proof, opened_trial, trial_table


class Scorer:
    """Keeps what it is given."""

    given: tuple[Any, ...] = ()

    def __call__(self, *given: Any) -> dict[str, Any]:
        self.given = given
        (given[0] / "scorecard.json").write_text("{}")
        return {"trials": len(given[2])}


def test_what_the_scorer_gets(answered: ProofFolder) -> None:
    (answered.path / "answers" / "nothing").mkdir()
    answered.answer("trial-0002", "nothing").write_text('{"verdict": "nothing_missing"}')
    scorer = Scorer()
    assert reveal(answered, Alone(), silent, score=scorer) == {"trials": 3}
    folder, ledger, trials, answers = scorer.given
    assert folder == answered.path and ledger == read_ledger(answered)
    assert [one["trial"] for one in trials] == ["trial-0001", "trial-0002", "trial-0003"]
    assert all(one["truth"]["hidden"] in ("nothing", "nasty") for one in trials)
    assert list(answers) == ["nothing", "skred"] and list(answers["nothing"]) == ["trial-0002"]
    assert answers["skred"]["trial-0003"]["wall_seconds"] == 2.0


def edit(file: Path, **change: Any) -> None:
    file.write_text(json.dumps(read_object(file) | change))


def change_truth(proof: ProofFolder) -> None:
    truth = read_object(proof.sealed("trial-0002"))["truth"]
    edit(proof.sealed("trial-0002"), truth=truth | {"hidden": "listed"})


def change_salt(proof: ProofFolder) -> None:
    edit(proof.sealed("trial-0002"), salt="0" * 64)


def change_reading(proof: ProofFolder) -> None:
    file = proof.campaign("trial-0002") / "recordings.csv"
    file.write_text(file.read_text() + "\n")


def change_fresh(proof: ProofFolder) -> None:
    file = proof.fresh("trial-0002") / "events.csv"
    file.write_text(file.read_text() + "\n")


def remove_file(proof: ProofFolder) -> None:
    (proof.campaign("trial-0002") / "sensors.csv").unlink()


def add_file(proof: ProofFolder) -> None:
    (proof.campaign("trial-0002") / "hint.txt").write_text("obstacle")


def change_request(proof: ProofFolder) -> None:
    proof.request("trial-0002").write_text('{"base_model": "constant"}')


def exchange(proof: ProofFolder) -> None:
    shutil.copy(proof.sealed("trial-0001"), proof.sealed("trial-0002"))


def remove_truth(proof: ProofFolder) -> None:
    proof.sealed("trial-0002").unlink()


@pytest.mark.parametrize(
    ("tamper", "file"),
    [
        (change_truth, "sealed/trial-0002.json is changed"),
        (change_salt, "sealed/trial-0002.json is changed"),
        (exchange, "sealed/trial-0002.json is changed"),
        (change_reading, "recordings.csv is changed"),
        (change_fresh, "trial-0002-fresh/events.csv is changed"),
        (remove_file, "sensors.csv is missing"),
        (add_file, "hint.txt is changed"),
        (change_request, "request.json is changed"),
        (remove_truth, "sealed/trial-0002.json: not there"),
    ],
)
def test_whatever_differs_is_named_and_nothing_is_scored(
    answered: ProofFolder, tamper: Any, file: str
) -> None:
    tamper(answered)
    scorer = Scorer()
    with pytest.raises(InputError, match=file) as refused:
        reveal(answered, Alone(), silent, score=scorer)
    assert "trial-0002" in str(refused.value)
    assert scorer.given == () and not answered.scorecard.exists()


def test_other_settings_in_the_ledger_are_seen(answered: ProofFolder) -> None:
    settings = read_ledger(answered)["settings"]
    edit(answered.ledger, settings=settings | {"diagnosis": {}})
    for file in answered.answer("any").parent.iterdir():
        edit(file, ledger_sha256=None)
        file.write_text(json.dumps({k: v for k, v in read_object(file).items() if k != "ledger_sha256"}))
    with pytest.raises(InputError, match="'settings' is not the one"):
        reveal(answered, Alone(), silent, score=Scorer())


@pytest.mark.parametrize("key", ["skred_version", "source_sha256", "scorer_sha256"])
def test_other_code_is_refused(answered: ProofFolder, key: str) -> None:
    edit(answered.ledger, **{key: "0.0.9"})
    with pytest.raises(InputError, match="check out the source"):
        reveal(answered, Alone(), silent, score=Scorer())


def test_missing_answers(answered: ProofFolder) -> None:
    answered.answer("trial-0003").unlink()
    with pytest.raises(InputError, match="1 of 3 trials have no answer yet; `skred prove run"):
        reveal(answered, Alone(), silent, score=Scorer())
    told: list[str] = []
    scorer = Scorer()
    reveal(answered, Alone(), told.append, partial=True, score=scorer)
    assert "partial: 1 of 3 trials have no answer yet" in told
    assert list(scorer.given[3]["skred"]) == ["trial-0001", "trial-0002"] and len(scorer.given[2]) == 3


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("trial-0009", "{}", "not in the ledger"),
        ("trial-0001", "{}", "expected the answer to trial-0001"),
        ("trial-0001", '{"verdict": "crash", "trial": "trial-0002"}', "expected the answer to trial-0001"),
        ("trial-0001", '{"verdict": "crash", "ledger_sha256": "0"}', "another ledger"),
        ("trial-0001", "nonsense", "expected JSON"),
    ],
)
def test_answers_that_are_none(answered: ProofFolder, name: str, text: str, message: str) -> None:
    answered.answer(name).write_text(text)
    with pytest.raises(InputError, match=message):
        reveal(answered, Alone(), silent, score=Scorer())


def test_trials_are_shown_once_they_are_opened(
    answered: ProofFolder, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(InputError, match="still sealed"):
        opened_trial(answered, "2")
    reveal(answered, Alone(), silent, score=Scorer())
    assert opened_trial(answered, "2") == opened_trial(answered, "trial-0002")
    for which in ("4", "trial-4", "../x", "9" * 30):
        with pytest.raises(InputError, match="no trial"):
            opened_trial(answered, which)
    assert skred(["prove", "show", "2", "--out", str(answered.path)]) == 0
    assert "nothing missing" in capsys.readouterr().out
    assert skred(["prove", "show", "2", "--out", str(answered.path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["trial"] == "trial-0002"
    change_truth(answered)
    with pytest.raises(InputError, match="changed"):
        opened_trial(answered, "2")


def predictor(retardation: float) -> dict[str, Any]:
    """Of a law with one retardation [m s-2], on any path."""
    means, factors = np.full((5, 1), np.log(retardation)), np.full((5, 1, 1), 0.3)
    return as_dict(Predictor("constant", "robust", 8.0, 10.0, means, factors, (), np.empty((5, 0))))


def gains(proof: ProofFolder) -> list[dict[str, Any]]:
    """Of all three trials, as the scorer gets them."""
    scorer = Scorer()
    reveal(proof, Alone(), silent, score=scorer)
    return [scorer.given[3]["skred"][f"trial-{number:04d}"]["gain"] for number in (1, 2, 3)]


def test_gains_are_realised_once(answered: ProofFolder) -> None:
    before, after = predictor(2.0), predictor(3.0)
    damaged = {**after, "law": "bingham"}
    for number, one in enumerate([after, damaged, None], 1):
        predictors = {"before": before, "after": one}
        edit(answered.answer(f"trial-{number:04d}"), predictors=predictors, gain={"promised": 0.5})
    exact = realised_gain({"before": before, "after": after}, read_campaign(answered.fresh("trial-0001")))
    assert exact is not None and exact["realised"] != 0.0 and exact["n_fresh"] == 12
    first, second, third = gains(answered)
    assert first == {"promised": 0.5, **exact} and third == {"promised": 0.5}
    assert set(second) == {"promised", "error"} and "bingham" in second["error"]
    # What was computed is kept, and belongs to that very answer.
    kept = answered.path / "gains" / "skred" / "trial-0001.json"
    edit(kept, gain=exact | {"realised": 0.4})
    assert gains(answered)[0]["realised"] == 0.4
    edit(answered.answer("trial-0001"), predictors={"before": before, "after": before})
    assert gains(answered)[0]["realised"] == 0.0


def test_truth_beside_answer() -> None:
    truth = {
        "hidden": "listed", "kind": "sparse", "base_model": "pcm", "snr": 6.54, "nasty": None,
        "mechanisms": [
            {"id": "obstacle", "parameter": "height", "unit": "m", "strength": 7.3, "s_from_m": 1010.0,
             "s_to_m": 1010.0},
        ],
    }  # fmt: skip
    strength = {"parameter": "height", "unit": "m", "mean": 6.91, "sd": 1.23}
    answer = {
        "verdict": "missing_physics", "mechanism": "obstacle", "indistinguishable": ["segment_drag"],
        "mechanisms": [
            {"id": "obstacle", "strength": strength, "location": {"s_from_m": 990.0, "s_to_m": 1050.0}}
        ],
        "probability": {"obstacle": 0.61, "segment_drag": 0.3, "nothing": 0.02, "centrifugal": 0.01},
        "location": {"s_from_m": 990.0, "s_to_m": 1050.0}, "statement": "A [bold] dam.", "wall_seconds": 41.2,
    }  # fmt: skip
    console = Console(width=200, record=True, file=open("/dev/null", "w"))
    for one in (answer, None, {"verdict": "crash", "error": "worker died twice"}):
        console.print(trial_table({"trial": "trial-0001", "truth": truth, "answer": one}))
    console.file.close()
    text = console.export_text()
    for words in (
        "obstacle", "or segment_drag", "height = 7.3 m", "height = 6.91 m (sd 1.2)", "1010 m",
        "990 to 1050 m", "signal-to-noise 6.5", "obstacle 0.61", "nothing 0.02",
        "A [bold] dam.", "after 41 s", "no answer",
        "worker died twice",
    ):  # fmt: skip
        assert words in text
    assert "centrifugal" not in text


def test_the_latest_proof(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--out"):
        latest_proof(tmp_path)
    for name in ("prove-1", "prove-2"):
        (tmp_path / name).mkdir()
    (tmp_path / "prove-1" / "ledger.json").write_text("{}")
    assert latest_proof(tmp_path).path.name == "prove-1"
