"""Sealing: what is drawn, that it resumes, and that nothing of the truth is beside the campaign."""

from __future__ import annotations

import json
import shutil
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from prove_cases import PLAN, Alone, silent

from skred.campaign import read_campaign
from skred.errors import InputError
from skred.prove.folder import ProofFolder, read_object, write_once
from skred.prove.hashes import canonical, document_sha256, files_sha256, source_sha256
from skred.prove.ledger import code_identity, read_ledger, trial_names
from skred.prove.plan import FIRST_SEED, Plan, asked, diagnosis_settings, random_seed
from skred.prove.seal import seal, seal_trial


def test_every_trial_has_its_seed_and_kind() -> None:
    trials = asked(Plan(7, 2_000_000))
    assert [one["seed"] for one in trials] == list(range(2_000_000, 2_000_007))
    assert [one["kind"] for one in trials] == ["sparse", "dense"] * 3 + ["sparse"]
    assert {one["kind"] for one in asked(Plan(3, 2_000_000, "dense"))} == {"dense"}
    assert asked(Plan(7, 2_000_000)) == trials and asked(Plan(7, 2_000_001))[:6] != trials[1:]
    assert [one["hidden"] for one in asked(Plan(7, 2_000_001))][:6] == [one["hidden"] for one in trials[1:]]


def test_shares_of_what_is_hidden() -> None:
    drawn = Counter(one["hidden"] for one in asked(Plan(4000, 2_000_000)))
    expected = {"nothing": 0.175, "nasty": 0.175, "listed": 0.315, "masked": 0.035, "two": 0.1}
    for name, share in expected.items():
        assert drawn[name] / 4000 == pytest.approx(share, abs=4.0 * (share * (1 - share) / 4000) ** 0.5)
    assert "masked" not in {one["hidden"] for one in asked(Plan(300, 2_000_000, masked_share=0.0))}


@pytest.mark.parametrize("nothing", [None, 0.25])
def test_the_share_of_what_is_in_no_list_can_be_asked_for(nothing: float | None) -> None:
    trials = asked(Plan(4000, 2_000_000, nothing_share=nothing, unlisted_share=0.5))
    drawn = Counter(one["hidden"] for one in trials)
    n_something = 4000 - drawn["nothing"] - drawn["nasty"]
    assert n_something / 4000 == pytest.approx(0.65 if nothing is None else 0.75, abs=0.03)
    assert drawn["unlisted"] / n_something == pytest.approx(0.5, abs=0.04)
    assert drawn["two"] / drawn["instrument"] == pytest.approx(1.0, abs=0.25)
    assert drawn["listed"] > drawn["two"]


@pytest.mark.parametrize("kind", ["mixed", "sparse", "dense"])
def test_the_number_of_nulls_can_be_asked_for(kind: Any) -> None:
    trials = asked(Plan(300, 3_000_000, kind, nothing_share=0.4))
    counts = Counter((one["kind"], one["hidden"]) for one in trials)
    nulls = {key: n for key, n in counts.items() if key[1] in ("nothing", "nasty")}
    assert sum(nulls.values()) == 120
    assert set(nulls.values()) == ({30} if kind == "mixed" else {60})


def test_seeds_of_development_are_refused() -> None:
    with pytest.raises(InputError, match="development"):
        Plan(3, FIRST_SEED - 1)
    assert Plan(3, 5, quick=True).seed == 5
    with pytest.raises(InputError, match="too large"):
        Plan(3, 2**31 - 2)
    seeds = {random_seed() for _ in range(20)}
    assert len(seeds) == 20 and min(seeds) >= FIRST_SEED


def test_settings_are_those_of_a_user() -> None:
    from skred.diagnosis.effort import Effort

    settings, quick = diagnosis_settings(False), diagnosis_settings(True)
    assert Effort(**settings["effort"]) == Effort()
    sampler = {"sampler": "metropolis", "draws": 600, "tune": 1000, "chains": 4, "seed": 0}
    assert settings["sampler"] == sampler == quick["sampler"]
    assert settings["effort"]["max_mechanisms"] == 2 and quick["effort"]["max_mechanisms"] == 1


def test_hashes_do_not_depend_on_the_order_of_keys() -> None:
    one, other = {"a": 1.5, "b": [None, "ø"]}, {"b": [None, "ø"], "a": 1.5}
    assert canonical(one) == canonical(other) and document_sha256(one) == document_sha256(other)
    assert document_sha256(one) != document_sha256({"a": 1.5, "b": ["ø", None]})
    assert document_sha256({}) == "44136fa355b3678a1146ad16f7e8649e94fb4fc21fe77e8310c060f61caaff8a"
    assert source_sha256() == source_sha256()


def test_what_is_sealed(proof: ProofFolder) -> None:
    ledger = read_ledger(proof)
    assert trial_names(ledger) == ["trial-0001", "trial-0002", "trial-0003"]
    salts = set()
    for entry in ledger["trials"]:
        name = entry["trial"]
        sealed = read_object(proof.sealed(name))
        assert document_sha256(sealed) == entry["sha256"]
        assert sealed["campaign"] == files_sha256(proof.campaign(name)) and len(sealed["campaign"]) == 5
        assert len(files_sha256(proof.fresh(name))) == 5 and sealed["fresh"] == files_sha256(
            proof.fresh(name)
        )
        assert sealed["truth"]["seed"] == sealed["asked"]["seed"]
        assert sealed["asked"]["hidden"] == sealed["truth"]["hidden"]
        assert sealed["settings"]["plan"]["n"] == 3 and sealed["source_sha256"] == ledger["source_sha256"]
        salts.add(sealed["salt"])
        read_campaign(proof.campaign(name))
    assert len(salts) == 3 and all(len(salt) == 64 for salt in salts)
    assert not proof.plan.exists()


def test_nothing_of_the_truth_is_beside_the_campaign(proof: ProofFolder) -> None:
    for name in trial_names(read_ledger(proof)):
        sealed = read_object(proof.sealed(name))
        files = sorted(file for file in proof.trial(name).rglob("*") if file.is_file())
        assert [file.name for file in files if file.parent == proof.trial(name)] == ["request.json"]
        text = "".join(file.read_text(encoding="utf-8") for file in files)
        words = [str(sealed["asked"]["seed"]), sealed["salt"], "nasty", "nothing", name]
        assert not [word for word in words if word in text]
        assert read_object(proof.request(name)) == {"base_model": sealed["truth"]["base_model"]}


def test_sealing_goes_on_where_it_was_ended(proof: ProofFolder) -> None:
    """As if it had been killed while it drew the second trial."""
    ledger = read_ledger(proof)
    before = files_sha256(proof.path)
    proof.ledger.unlink()
    proof.sealed("trial-0002").unlink()
    (proof.campaign("trial-0002") / "events.csv").unlink()
    (proof.trial("trial-0002") / "left over").mkdir()
    keys = ("skred_version", "source_sha256", "scorer_sha256")
    code = {key: ledger[key] for key in keys}
    write_once(proof.plan, {"settings": ledger["settings"], "code": code})
    told: list[str] = []
    seal(proof, PLAN, Alone(), told.append, told.append)
    assert told[0] == "sealing 1 of 3 trials" and sorted(told[1:]) == trial_names(ledger)
    after = files_sha256(proof.path)
    changed = {file for file in before if before[file] != after.get(file)}
    assert changed <= {"ledger.json", "sealed/trial-0002.json"}  # another salt, nothing else
    assert before.keys() == after.keys() and "sealed/trial-0001.json" not in changed


def test_a_campaign_that_the_loader_refuses_is_drawn_anew(tmp_path: Path) -> None:
    """A reading with heavy tails: of a further avalanche of this seed, above the speed of a free fall."""
    plan = {"settings": {"plan": {"n": 60}}, "code": code_identity()}
    drawn = {"seed": 1_695_081_616, "kind": "dense", "hidden": "nasty"}
    seal_trial({"folder": str(tmp_path), "trial": "trial-0001", "asked": drawn, **plan})
    proof = ProofFolder(tmp_path)
    sealed = read_object(proof.sealed("trial-0001"))
    assert sealed["asked"] == drawn | {"seed": drawn["seed"] + 60}
    assert sealed["truth"]["seed"] == drawn["seed"] + 60
    for folder in (proof.campaign("trial-0001"), proof.fresh("trial-0001")):
        assert read_campaign(folder).n_events


def test_a_ledger_is_never_changed(proof: ProofFolder) -> None:
    before = proof.ledger.read_bytes()
    seal(proof, PLAN, Alone(), silent, silent)
    with pytest.raises(InputError, match="other options"):
        seal(proof, Plan(4, PLAN.seed, "sparse", nothing_share=1.0), Alone(), silent, silent)
    assert not write_once(proof.ledger, {})
    assert proof.ledger.read_bytes() == before


def test_another_folder_is_not_taken(proof: ProofFolder, tmp_path: Path) -> None:
    shutil.copytree(proof.path / "trials", tmp_path / "other" / "trials")
    with pytest.raises(InputError, match="something else"):
        seal(ProofFolder(tmp_path / "other"), PLAN, Alone(), silent, silent)


def test_source_that_changes_in_between_is_refused(proof: ProofFolder) -> None:
    ledger = read_ledger(proof)
    proof.ledger.unlink()
    code = {"skred_version": "0.0.1", "source_sha256": "0" * 64, "scorer_sha256": "0" * 64}
    write_once(proof.plan, {"settings": ledger["settings"], "code": code})
    with pytest.raises(InputError, match="check out the source"):
        seal(proof, PLAN, Alone(), silent, silent)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": 2}, "expected format 1, found 2"),
        ({"seed": "x"}, "'seed'"),
        ({"trials": [{"trial": "../../etc/passwd", "sha256": "0" * 64}]}, "no trial"),
        ({"trials": [{"trial": "trial-0001", "sha256": "0"}]}, "no trial"),
        ({"trials": [7]}, "no trial"),
        ({"n": 2}, "expected 2 trials"),
    ],
)
def test_a_ledger_that_is_none(proof: ProofFolder, change: dict[str, Any], message: str) -> None:
    ledger = read_ledger(proof)
    proof.ledger.write_text(json.dumps(ledger | change))
    with pytest.raises(InputError, match=message):
        read_ledger(proof)


def test_no_ledger(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such folder"):
        read_ledger(ProofFolder(tmp_path / "nowhere"))
    with pytest.raises(InputError, match="no ledger"):
        read_ledger(ProofFolder(tmp_path))
    for text in ("{", "[1]", "[" * 100_000, "\0"):
        (tmp_path / "ledger.json").write_text(text)
        with pytest.raises(InputError, match="expected"):
            read_ledger(ProofFolder(tmp_path))
