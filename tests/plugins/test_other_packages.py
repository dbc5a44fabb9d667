"""Mechanisms and laws of other packages in commands, comparison and verdict, in processes that find them."""

from __future__ import annotations

import json
import os
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator
from plugin_cases import SPEC, install, seen, skred

TESTS = Path(__file__).parents[1]
SCHEMA = json.loads((files("skred") / "verdict.schema.json").read_text(encoding="utf-8"))
SNOW = """
import numpy as np

def warm(setting):
    return (Shape(covariate="wetness_percent"),)

def by_wetness(setting, shape):
    return Direction(log_strengths=setting.covariates[shape.covariate])

def each_speed(setting):
    return tuple(Shape(sensor=name) for name, one in zip(setting.sensors, setting.velocities) if one)

def lower_ones(setting, shape):
    first = setting.sensors.index(shape.sensor)
    lower = [one and k >= first for k, one in enumerate(setting.velocities)]
    return Direction(log_readings=np.array(lower, dtype=float))

LEDGE = mechanism("ledge", "ledge_loss", "b_l", BoundTo.PLACE, added=dict(
    direction=along_a_stretch(Column.CONSTANT), shapes=stretches, split=split_stretch))
WET = mechanism("wet", "wetness_effect", "beta_w", BoundTo.COVARIATE, added=dict(
    direction=by_wetness, shapes=warm, needs=("wetness_percent",), either_sign=True))
CLOCK = mechanism("clock", "log_clock_factor", "a_c", BoundTo.SENSOR, group=Group.INSTRUMENT, added=dict(
    direction=lower_ones, shapes=each_speed, either_sign=True))
"""
"""One bound to a place, one that needs a covariate that few campaigns have, a fault of the instruments."""
LAWS = """
import pymc as pm
from skred.physics.law import Law, Parameter, parameter_of
from skred.physics.mechanisms import coulomb_friction, viscous_drag

TWO = (coulomb_friction.MECHANISM, viscous_drag.MECHANISM)

def build(problem):
    with pm.Model(coords=problem.coords) as model:
        drawn = [pm.HalfNormal(one.strength.name, sigma=one.strength.prior_scale) for one in TWO]
        problem.observe(TWO, drawn)
    return model

def law(id, *parameters):
    words = dict(id=id, title=f"the title of {id}", reference="nobody (2020)")
    return Law(mechanisms=TWO, parameters=parameters, build=build, **words)

SLUSH = law("slush", *(parameter_of(one.strength) for one in TWO))
LEDGES = law("ledges", Parameter("dry_friction", "mu", "1"), Parameter("time", "b_l", "1"))
PCM = SLUSH
"""
TWICE = """
TWICE = law("twice", Parameter("friction", "mu", "1"), Parameter("viscous_drag", "c", "s-1"))
"""
COMPARED = """
import json
from dataclasses import replace
from diagnosis_cases import base_of, first_events, trial, with_sensors
from diagnosis_report_cases import diagnosis
from skred.diagnosis.compare.comparison import compare
from skred.diagnosis.detect.detectability import identify
from skred.diagnosis.detect.run import identify_document
from skred.diagnosis.verdict.document import verdict
from skred.output import plain

campaign = first_events(trial(1003, "dense", "nothing", "constant").campaign, 6)
campaign = with_sensors(campaign, [12, 18, 24, campaign.n_sensors - 1])
wet = [replace(one, covariates={"wetness_percent": float(k % 4)}) for k, one in enumerate(campaign.events)]
base = base_of(replace(campaign, events=tuple(wet)), "constant")
found = compare(base)
lacking = base_of(campaign, "constant")
table = identify_document(lacking.problem, lacking.law, identify(lacking))
print(json.dumps(plain({
    "probability": found.probability,
    "stretch": found.under_each[0].candidates["ledge"].ends(0.5),
    "looked_for_without_it": [row["id"] for row in table["identifiability"]],
    "verdicts": {name: verdict(diagnosis(name)) for name in ("ledge", "clock")},
})))
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Good mechanisms, a broken one, one that clashes, and laws of both kinds."""
    folder = tmp_path_factory.mktemp("installed")
    good = {"ledge": "LEDGE", "wet": "WET", "clock": "CLOCK"}
    install(folder, "other-snow", SPEC + SNOW, good)
    install(folder, "broken-snow", "import a_module_that_is_not_there", {"fog": "FOG"})
    install(folder, "rival-snow", SPEC + "LEDGE = mechanism('ledge', 'x', 'y')", {"ledge": "LEDGE"})
    laws = {"slush": "SLUSH", "ledges": "LEDGES", "pcm": "PCM"}
    install(folder, "other-laws", LAWS, laws, "skred.laws")
    return folder


@pytest.fixture(scope="module")
def compared(folder: Path) -> dict[str, Any]:
    more = os.pathsep.join(map(str, (folder, TESTS / "diagnosis", TESTS / "report")))
    done = seen(Path(more), "-c", COMPARED)
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


@pytest.mark.slow
def test_the_list_has_them_and_tells_of_those_that_it_leaves_out(folder: Path) -> None:
    done = skred(folder, "mechanisms", "--json")
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    listed = {one["id"]: one for one in document["mechanisms"]}
    assert {"ledge", "wet", "clock", "obstacle"} < set(listed) and "fog" not in listed
    assert listed["wet"]["needs"] == ["wetness_percent"] and "wetness_percent" in listed["wet"]["looked_for"]
    assert listed["ledge"]["package"] == "other-snow" and listed["clock"]["group"] == "instrument"
    refused = {(one["kind"], one["id"]): one["package"] for one in document["refused"]}
    assert refused[("mechanism", "fog")] == "broken-snow" and refused[("mechanism", "ledge")] == "rival-snow"
    assert refused[("law", "pcm")] == "other-laws and skred"
    lines = done.stderr.splitlines()
    assert len(lines) == len(refused) and all(line.startswith("warning: ") for line in lines)
    (fog,) = (line for line in lines if "'fog'" in line)
    assert "broken-snow" in fog and "No module named 'a_module_that_is_not_there'" in fog
    (ledge,) = (line for line in lines if "mechanism 'ledge'" in line)
    assert "rival-snow" in ledge and "other-snow" in ledge


@pytest.mark.slow
def test_tables_for_people_hold_them_too(folder: Path) -> None:
    done = skred(folder, "mechanisms")
    assert done.returncode == 0 and "wet " in done.stdout and "beta_w [-]" in done.stdout
    done = skred(folder, "mechanisms", "fog")
    assert done.returncode == 2 and "broken-snow" in done.stderr and "Traceback" not in done.stderr


@pytest.mark.slow
def test_the_comparison_holds_all_three(compared: dict[str, Any]) -> None:
    probability = compared["probability"]
    assert {"ledge", "wet", "clock"} < set(probability)
    assert all(0.0 < probability[name] < 1.0 for name in ("ledge", "wet", "clock"))
    first, last = compared["stretch"]
    assert 0.0 <= first < last


def test_what_needs_a_covariate_is_not_looked_for_without_it(compared: dict[str, Any]) -> None:
    looked_for = compared["looked_for_without_it"]
    assert {"ledge", "clock", "obstacle"} < set(looked_for) and "wet" not in looked_for


@pytest.mark.parametrize(
    ("name", "word", "group", "key"),
    [
        ("ledge", "missing_physics", "physics", "location"),
        ("clock", "instrument", "instrument", "sensor"),
    ],
)
def test_a_verdict_that_names_one_fits_the_schema(
    name: str, word: str, group: str, key: str, compared: dict[str, Any]
) -> None:
    document = compared["verdicts"][name]
    assert list(Draft202012Validator(SCHEMA).iter_errors(document)) == []
    assert (document["verdict"], document["mechanism"], document["mechanisms"][0]["group"]) == (
        word,
        name,
        group,
    )
    assert document[key] is not None and document[key] == document["mechanisms"][0][key]
    assert f"the title of {name}" in document["statement"]


@pytest.mark.slow
def test_a_law_of_another_package_is_calibrated_and_compared(folder: Path, tmp_path: Path) -> None:
    words = ("slush", "ryggfonn", "--quiet", "--seed", "1", "--out", str(tmp_path / "one"))
    done = skred(folder, "calibrate", *words)
    assert done.returncode == 0, done.stderr
    assert {"summary.json", "posterior.nc"} <= {file.name for file in (tmp_path / "one").iterdir()}
    models = ("--models", "coulomb,slush", "--quiet", "--out", str(tmp_path / "two"))
    done = skred(folder, "compare", *models)
    assert done.returncode == 0, done.stderr
    compared = json.loads((tmp_path / "two" / "compare.json").read_text(encoding="utf-8"))
    assert {model["id"] for model in compared["models"]} == {"coulomb", "slush"}


@pytest.mark.slow
@pytest.mark.parametrize("command", ["calibrate", "identify --base-model", "diagnose --base-model"])
def test_a_law_that_cannot_be_used_is_told_with_its_packages(command: str, folder: Path) -> None:
    done = skred(folder, *command.split(), "pcm")
    assert done.returncode == 2 and "other-laws and skred" in done.stderr
    assert "Traceback" not in done.stderr
    done = skred(folder, *command.split(), "melt")
    assert done.returncode == 2 and "no law named 'melt'; there are: " in done.stderr
    assert "slush" in done.stderr


@pytest.mark.slow
def test_a_law_with_the_symbol_of_a_mechanism_is_not_diagnosed(folder: Path) -> None:
    done = skred(folder, "identify", "--base-model", "ledges", "--quiet")
    assert done.returncode == 2 and "Traceback" not in done.stderr
    (error,) = (line for line in done.stderr.splitlines() if line.startswith("error: "))
    for word in ("symbol 'b_l'", "'ledge' of the package other-snow", "'ledges' of the package other-laws"):
        assert word in error


def test_a_law_in_which_a_name_stands_for_two_things_names_the_package(tmp_path: Path) -> None:
    install(tmp_path, "two-laws", LAWS + TWICE, {"twice": "TWICE"}, "skred.laws")
    done = skred(tmp_path, "calibrate", "twice")
    assert done.returncode == 2 and "Traceback" not in done.stderr
    assert "two-laws" in done.stderr and "symbol 'mu' is used twice" in done.stderr
