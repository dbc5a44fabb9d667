"""The schema of verdict.json: what the code writes passes, and so does no verdict that says too little."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from dataclasses import replace
from importlib.resources import files
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from skred.campaign import find_campaign, read_campaign
from skred.diagnosis.outcome import NotDiagnosed
from skred.diagnosis.verdict.document import verdict
from skred.inference.hierarchical.problem import hierarchical_problem
from skred.output import plain
from skred.physics.laws import load_law
from skred.physics.mechanisms import Mechanism, mechanisms
from skred.physics.mechanisms.spec import BoundTo, Group

SCHEMA = json.loads((files("skred") / "verdict.schema.json").read_text(encoding="utf-8"))
VALIDATOR = Draft202012Validator(SCHEMA)
KEYS = (
    "format", "campaign", "base_model", "verdict", "mechanism", "mechanisms", "probability",
    "indistinguishable", "location", "strength", "covariate", "sensor", "equation", "evidence", "held_out",
    "detection_limits", "next_sensor", "diagnostics", "statement",
)  # fmt: skip
MORE = ("alarm_by", "converged", "refits_not_converged", "influence", "conditional", "sensor_places")
"""Keys that came later: they are written, and verdicts before them stay whole."""
NULLABLE = {
    "evidence": ("elpd_diff", "elpd_se", "log_bayes_factor", "p_value"),
    "held_out": ("rmse_velocity_before", "rmse_velocity_after", "rmse_runout_before", "rmse_runout_after"),
    "diagnostics": ("r_hat_max", "ess_min", "pareto_k_max", "divergences"),
}
STRENGTH = {"parameter": "segment_drag", "unit": "m-1", "mean": 0.002, "sd": 0.0004}
STRETCH = {"s_from_m": 1875.0, "s_to_m": 1950.0}
SENSOR = {"quantity": "front_velocity", "s_from_m": 1700.0, "s_to_m": 1700.0, "splits": []}
LIMIT = {"parameter": "viscous_drag", "unit": "s-1", "value": 0.04}


def nothing_missing() -> dict[str, Any]:
    return {
        "format": 1,
        "campaign": "made up",
        "base_model": "pcm",
        "verdict": "nothing_missing",
        "mechanism": None,
        "mechanisms": [],
        "probability": {"nothing": 0.9, "unlisted": 0.01, "segment_drag": 0.09},
        "indistinguishable": [],
        "location": None,
        "strength": None,
        "covariate": None,
        "sensor": None,
        "equation": None,
        "evidence": {"elpd_diff": None, "elpd_se": None, "log_bayes_factor": -2.0, "p_value": 0.4},
        "held_out": {
            "unit": "event", "rmse_velocity_before": 6.1, "rmse_velocity_after": None,
            "rmse_runout_before": 71.0, "rmse_runout_after": None,
        },
        "detection_limits": {"viscous_drag": LIMIT},
        "next_sensor": None,
        "diagnostics": {"r_hat_max": 1.0, "ess_min": 1450, "pareto_k_max": 0.5, "divergences": 0},
        "statement": "The recordings give no reason to add anything.",
    }  # fmt: skip


def named(mechanism: str, kind: str = "missing_physics", **more: Any) -> dict[str, Any]:
    spec = mechanisms()[mechanism]
    return found(mechanism, kind, spec, **more)


def found(mechanism: str, kind: str, spec: Mechanism, **more: Any) -> dict[str, Any]:
    """A verdict that names a mechanism, in the library or not."""
    assert spec.added is not None
    equation = spec.equation
    local = {
        "id": mechanism, "group": str(spec.group), "bound_to": str(spec.added.bound_to), "strength": STRENGTH,
        "location": more.get("location"), "equation": equation, "covariate": more.get("covariate"),
        "sensor": more.get("sensor"),
    }  # fmt: skip
    return nothing_missing() | {
        "verdict": kind,
        "mechanism": mechanism,
        "mechanisms": [local],
        "probability": {"nothing": 0.02, "unlisted": 0.01, mechanism: 0.97},
        "strength": STRENGTH,
        "equation": equation,
        **more,
    }


def tie() -> dict[str, Any]:
    sensor = SENSOR | {"splits": ["segment_drag", "obstacle"]}
    return named("segment_drag", indistinguishable=["obstacle"], next_sensor=sensor, location=STRETCH)


def two() -> dict[str, Any]:
    document = named("segment_drag", location=STRETCH)
    fault = {"id": "sensor_bias", "group": "instrument", "bound_to": "sensor", "sensor": "LC"}
    second = document["mechanisms"][0] | fault | {"location": None}
    return document | {"mechanisms": [*document["mechanisms"], second]}


def unexplained() -> dict[str, Any]:
    return nothing_missing() | {"verdict": "unexplained", "location": STRETCH}


def cannot_tell() -> dict[str, Any]:
    return nothing_missing() | {"verdict": "cannot_tell", "next_sensor": SENSOR}


def failed() -> dict[str, Any]:
    """A gate failed: nothing was raced."""
    nothing: dict[str, Any] = {part: dict.fromkeys(keys) for part, keys in NULLABLE.items()}
    nothing["held_out"] |= {"unit": "event"}
    return cannot_tell() | nothing | {"probability": {}, "detection_limits": {}, "next_sensor": None}


def given_above(**more: Any) -> dict[str, Any]:
    """Readings predicted from those above them."""
    scores: dict[str, Any] = {"n": 20, "coverage_90_before": 0.65, "coverage_90_after": 0.8}
    for name in ("rmse", "crps", "log_score"):
        sign = -1.0 if name == "log_score" else 1.0
        scores |= {f"{name}_before": sign * 10.4, f"{name}_after": sign * 8.3, f"{name}_diff": -sign * 2.1}
        scores |= {f"{name}_{key}_2se": 1.5 for key in ("before", "after", "diff")}
    sets = {"gain": "better", "all": scores, "carrying": scores | more, "others": None}
    sensor = {"sensor": "CD", "quantity": "front_velocity", "unit": "m s-1", **sets}
    return {
        "sensors": [sensor], "speeds": sets, "effective_draws_min": 40.0, "n_few_draws": 2,
        "statement": "So.",
    }  # fmt: skip


VALID: dict[str, Callable[[], dict[str, Any]]] = {
    "nothing": nothing_missing,
    "named": lambda: named("segment_drag", location=STRETCH),
    "global": lambda: named("viscous_drag"),
    "covariate": lambda: named("covariate_friction", covariate="snow_temperature_degC"),
    "sensor": lambda: named("sensor_bias", "instrument", sensor="LC"),
    "release": lambda: named("release_offset", "instrument"),
    "tie": tie,
    "tied across groups": lambda: named(
        "sensor_bias", "instrument", sensor="LC", indistinguishable=["obstacle", "unlisted"]
    ),
    "two": two,
    "unexplained": unexplained,
    "cannot tell": cannot_tell,
    "failed": failed,
    "never seen": lambda: nothing_missing() | {"detection_limits": {"viscous_drag": LIMIT | {"value": None}}},
    "alarm": lambda: named("segment_drag", location=STRETCH, alarm_by="both", converged=True),
    "not converged": lambda: nothing_missing() | {"converged": False, "refits_not_converged": ["3"]},
    "an interval of the place": lambda: named(
        "segment_drag", location=STRETCH | {"s_from_interval_m": [1850.0, 1900.0], "s_to_interval_m": None}
    ),
    "given above": lambda: named("segment_drag", location=STRETCH, conditional=given_above()),
    "nothing given above": lambda: nothing_missing() | {"conditional": None},
    "one avalanche given above": lambda: named(
        "segment_drag", location=STRETCH, conditional=given_above(rmse_diff_2se=None)
    ),
    "more keys": lambda: nothing_missing() | {"reason": None, "seconds": {"comparison": 3.0}},
}


def problems(document: dict[str, Any]) -> list[str]:
    return [f"{error.json_path}: {error.message}" for error in VALIDATOR.iter_errors(document)]


def changed(document: dict[str, Any], path: str, value: Any) -> dict[str, Any]:
    """A copy with another value at a path like ``evidence.p_value``."""
    result = copy.deepcopy(document)
    *outer, last = path.split(".")
    part: Any = result
    for key in outer:
        part = part[int(key) if isinstance(part, list) else key]
    part[last] = value
    return result


def test_the_schema_is_one() -> None:
    Draft202012Validator.check_schema(SCHEMA)
    assert tuple(SCHEMA["required"]) == KEYS
    assert tuple(SCHEMA["properties"]) == (*KEYS, *MORE, "locked", "outer_folds")  # where they were asked for


@pytest.mark.parametrize("kind", VALID)
def test_verdicts_that_are_whole(kind: str) -> None:
    assert problems(VALID[kind]()) == []


@pytest.mark.parametrize("kind", VALID)
@pytest.mark.parametrize("key", KEYS)
def test_no_key_is_left_out(kind: str, key: str) -> None:
    document = VALID[kind]()
    del document[key]
    assert problems(document)


@pytest.mark.parametrize(("part", "key"), [(part, key) for part, keys in NULLABLE.items() for key in keys])
def test_numbers_may_be_null_but_not_left_out(part: str, key: str) -> None:
    document = named("viscous_drag")
    assert problems(changed(document, f"{part}.{key}", None)) == []
    assert problems(changed(document, f"{part}.{key}", "1.0"))
    document[part] = {name: value for name, value in document[part].items() if name != key}
    assert problems(document)


@pytest.mark.parametrize(
    ("kind", "path", "value"),
    [
        ("nothing", "format", 2),
        ("nothing", "campaign", ""),
        ("nothing", "campaign", None),
        ("nothing", "verdict", "all_is_well"),
        ("nothing", "verdict", None),
        ("nothing", "verdict", "missing_physics"),
        ("nothing", "verdict", "instrument"),
        ("nothing", "verdict", "unexplained"),
        ("nothing", "mechanism", "segment_drag"),
        ("nothing", "location", STRETCH),
        ("nothing", "strength", STRENGTH),
        ("nothing", "detection_limits", {}),
        ("nothing", "detection_limits.viscous_drag", LIMIT | {"value": 0.0}),
        ("nothing", "detection_limits.viscous_drag", LIMIT | {"value": "never"}),
        ("nothing", "detection_limits.nothing", LIMIT),
        ("nothing", "probability", {}),
        ("nothing", "probability", {"nothing": 1.0, "segment_drag": 0.0}),
        ("nothing", "probability.nothing", 1.2),
        ("nothing", "probability.nothing", None),
        ("nothing", "evidence.p_value", -0.1),
        ("nothing", "held_out.unit", None),
        ("nothing", "diagnostics.divergences", 0.5),
        ("nothing", "statement", " "),
        ("alarm", "alarm_by", "race"),
        ("not converged", "converged", None),
        ("not converged", "refits_not_converged", [3]),
        ("an interval of the place", "location.s_from_interval_m", [1850.0]),
        ("given above", "conditional.sensors.0.all.n", 0),
        ("given above", "conditional.sensors.0.all.rmse_before", None),
        ("given above", "conditional.sensors.0.all.crps_after", -1.0),
        ("given above", "conditional.sensors.0.all.coverage_90_after", 1.2),
        ("given above", "conditional.sensors.0.all", None),
        ("given above", "conditional.sensors.0.gain", "very much"),
        ("given above", "conditional.speeds.carrying.log_score_diff_2se", -0.1),
        ("given above", "conditional.statement", ""),
        ("given above", "conditional.n_few_draws", None),
        ("nothing", "indistinguishable", ["obstacle"]),
        ("named", "verdict", "nothing_missing"),
        ("named", "verdict", "instrument"),
        ("named", "mechanism", None),
        ("named", "mechanism", "unlisted"),
        ("named", "mechanism", "Segment Drag"),
        ("named", "mechanisms", []),
        ("named", "mechanisms.0.strength", None),
        ("named", "mechanisms.0.equation", ""),
        ("named", "mechanisms.0.group", "people"),
        ("named", "mechanisms.0.group", "instrument"),
        ("named", "mechanisms.0.bound_to", "sensor"),
        ("named", "mechanisms.0.location", None),
        ("two", "mechanisms.1.sensor", None),
        ("named", "location", None),
        ("named", "strength", None),
        ("named", "strength", {"parameter": "segment_drag", "unit": "m-1", "mean": 0.002}),
        ("named", "strength.sd", -1.0),
        ("named", "equation", None),
        ("named", "location", {"s_from_m": 1875.0}),
        ("named", "location.s_to_m", None),
        ("named", "covariate", "snow_type"),
        ("named", "sensor", "LC"),
        ("covariate", "covariate", None),
        ("sensor", "sensor", None),
        ("sensor", "verdict", "missing_physics"),
        ("release", "verdict", "missing_physics"),
        ("tie", "indistinguishable", ["obstacle", "obstacle"]),
        ("tie", "next_sensor.quantity", "temperature"),
        ("tie", "next_sensor.s_from_m", None),
        ("tie", "next_sensor.splits", None),
        ("unexplained", "location", None),
        ("unexplained", "mechanism", "segment_drag"),
        ("cannot tell", "location", STRETCH),
        ("failed", "evidence", None),
    ],
)
def test_verdicts_that_are_not(kind: str, path: str, value: Any) -> None:
    document = VALID[kind]()
    assert problems(document) == []
    assert problems(changed(document, path, value))


@pytest.mark.parametrize("bound_to", BoundTo)
@pytest.mark.parametrize(
    ("group", "kind"), [(Group.PHYSICS, "missing_physics"), (Group.INSTRUMENT, "instrument")]
)
def test_a_mechanism_of_any_other_package(bound_to: BoundTo, group: Group, kind: str) -> None:
    """Whatever it is called: its group decides the verdict, and what it is bound to must be named."""
    like = mechanisms()["viscous_drag"]
    assert like.added is not None
    spec = replace(like, group=group, added=replace(like.added, bound_to=bound_to))
    named_at = {
        BoundTo.PLACE: ("location", STRETCH),
        BoundTo.SENSOR: ("sensor", "LC"),
        BoundTo.COVARIATE: ("covariate", "t_degC"),
    }
    key, value = named_at.get(bound_to, ("location", None))
    document = found("snow_of_my_own", kind, spec, **{key: value})
    assert problems(document) == []
    other = {"missing_physics": "instrument", "instrument": "missing_physics"}[kind]
    assert problems(changed(document, "verdict", other))
    if value is not None:
        assert problems(changed(document, key, None))
    for other_key, other_value in named_at.values():
        if other_key not in (key, "location"):
            assert problems(changed(document, other_key, other_value))


@pytest.mark.parametrize("law_id", ["pcm", "constant"])
def test_what_is_written_where_no_diagnosis_was_possible(law_id: str) -> None:
    problem = hierarchical_problem(read_campaign(find_campaign("ryggfonn")))
    found = NotDiagnosed(problem, load_law(law_id), "only 3 avalanches with a reading")
    document = plain(verdict(found))
    assert problems(document) == []
    assert document["verdict"] == "cannot_tell" and "only 3 avalanches" in document["statement"]
    assert set(MORE) <= set(document) and document["alarm_by"] is None
    json.dumps(document, allow_nan=False)
