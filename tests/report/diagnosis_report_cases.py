"""A diagnosis made up quickly: no sampler runs, and nothing is refitted."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import xarray as xr
from hierarchical_cases import hierarchical_calibration, hierarchical_ryggfonn

from skred.diagnosis.augment.added_strength import AddedStrength
from skred.diagnosis.augment.step import Augmented, Step
from skred.diagnosis.check.bootstrap_test import BootstrapTest
from skred.diagnosis.check.decision import Decision, blamed
from skred.diagnosis.compare.candidate import Candidate
from skred.diagnosis.compare.comparison import Comparison, ComparisonUnderErrors
from skred.diagnosis.compare.location import Location
from skred.diagnosis.detect.detectability import Detectability, Identifiability
from skred.diagnosis.discrepancy.profile import KINDS, Prior, Profile
from skred.diagnosis.evidence.coefficient import Curve
from skred.diagnosis.evidence.extension import setting_of
from skred.diagnosis.evidence.predictive import Predicted
from skred.diagnosis.evidence.prior_odds import UNLISTED, prior_odds
from skred.diagnosis.evidence.refit import Fit
from skred.diagnosis.influence.influence import Few, Influence, ReadingsLeftOut
from skred.diagnosis.outcome import Diagnosis, NotDiagnosed, Outcome
from skred.diagnosis.predict.conditional import BeforeAfter, Conditional, above
from skred.diagnosis.predict.draws import Draws
from skred.diagnosis.predict.held_out import HeldOut
from skred.diagnosis.predict.profile_law import ProfileLaw
from skred.diagnosis.verdict.document import verdict
from skred.diagnosis.verdict.figure_data import figure_data
from skred.diagnosis.verdict.report_facts import report_facts
from skred.inference.gate import Gate
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.inference.results import save
from skred.output import plain, write_json
from skred.physics.law import Parameter
from skred.physics.laws import load_law
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.spec import Direction

GATE = Gate(1.0021, 912.0, 803.0, 0, ())
LAW = load_law("coulomb")


def hostile_problem(text: str) -> HierarchicalProblem:
    """Ryggfonn with names that attack."""
    problem = hierarchical_ryggfonn()
    campaign = problem.campaign
    sensors = tuple(replace(one, id=f"{text}{k}") for k, one in enumerate(campaign.sensors))
    events = tuple(
        replace(one, id=f"{text}{k}", covariates={text: float(k)}) for k, one in enumerate(campaign.events)
    )
    attacked = replace(campaign, name=text, description=text, source=text, sensors=sensors, events=events)
    return replace(problem, campaign=attacked)


def curves_of(mechanism, setting, top: float, at: float) -> Candidate:
    """A parabola of evidence for each shape, highest near a place."""
    added = mechanism.added
    curves = []
    shapes = added.shapes(setting)
    for shape in shapes[:: max(1, len(shapes) // 5)]:
        far = 0.0 if shape.place_m is None else abs(shape.place_m - at) / 100.0
        height = top - far
        strengths = added.scale * np.array([0.0, 0.3, 0.7, 1.0, 1.4, 2.0])
        heights = height - 20.0 * (strengths / added.scale - 1.0) ** 2
        heights[0] = 0.0
        curves.append(Curve(mechanism, shape, Direction(), strengths, heights, ()))
    return Candidate(mechanism, tuple(curves), np.full(len(curves), -np.log(len(curves))))


def comparison_of(
    problem: HierarchicalProblem, tops: dict[str, float], n_error_models: int = 1
) -> Comparison:
    """A comparison in which some candidates have evidence."""
    setting = setting_of(problem, LAW)
    candidates = {
        name: curves_of(mechanism, setting, tops.get(name, -2.0), 1800.0)
        for name, mechanism in mechanisms().items()
        if mechanism.added is not None
        and mechanism.added.joins(setting.base)
        and mechanism.added.shapes(setting)
    }
    profile = SimpleNamespace(log_bayes_factor=tops.get("unlisted", -1.0), kind=KINDS[0], error=0.15)
    under_each = tuple(
        ComparisonUnderErrors(name, SimpleNamespace(), candidates, [profile])
        for name in ("robust", "student")[:n_error_models]
    )
    odds = prior_odds(candidate.mechanism for candidate in candidates.values())
    return Comparison(under_each, odds, {"robust": -100.0, "student": -103.0})


def told(problem: HierarchicalProblem, power: float) -> Identifiability:
    setting = setting_of(problem, LAW)
    rows = tuple(
        Detectability(
            one, 0.3, 2.0 * one.added.scale, one.added.scale, (1700.0, 1800.0), power, ("obstacle",)
        )
        for one in mechanisms().values()
        if one.added is not None and one.added.joins(setting.base)
    )
    return Identifiability(rows, 1750.0, power, 0.5 + 0.5 * power)


def location() -> Location:
    s_m = np.linspace(1620.0, 2200.0, 60)
    mean = 0.8 * np.exp(-(((s_m - 1800.0) / 80.0) ** 2))
    work = np.array([[1650.0, 1810.0, 61.3, 12.1], [1810.0, 1910.0, 12.2, 14.0]])
    return Location(
        s_m, mean, mean - 0.3, mean + 0.3, np.linspace(1, 0, 60), 140.0, False, (1750.0, 1850.0), work, 9.0
    )


def held(problem: HierarchicalProblem, better: float) -> HeldOut:
    rng = np.random.default_rng(5)
    n = problem.campaign.n_events
    noise = rng.normal(0.0, 3.0, problem.values.shape)
    predicted = np.where(problem.observed, problem.values + noise, np.nan)
    pointwise = rng.normal(-12.0, 2.0, n) + better
    return HeldOut(
        pointwise,
        np.full(n, 0.4),
        problem.campaign.event_ids[:2],
        (),
        Predicted(predicted, predicted - 8.0, predicted + 8.0),
    )


def given_above(problem: HierarchicalProblem, better: float) -> Conditional:
    """Readings by those above them: in all avalanches better by as much, and nearer to what was read."""
    rng = np.random.default_rng(6)
    seen = problem.observed
    off = rng.normal(0.0, 6.0, seen.shape) / (1.0 + better)
    mean = np.where(seen, problem.values + off, np.nan)
    score = np.where(seen, rng.normal(-3.0, 0.5, seen.shape) + better, np.nan)
    n_above = np.where(seen, seen.astype(int) @ above(problem).T.astype(int), 0)
    return Conditional(
        mean, mean - 8.0, mean + 8.0, score, np.abs(off), n_above, np.where(seen, 240.0, np.nan)
    )


def calibration(problem: HierarchicalProblem, added: tuple = (), gate: Gate = GATE) -> SimpleNamespace:
    """What the report reads of a calibration; with added strengths, of an augmented law's."""
    tree = hierarchical_calibration(problem, LAW)
    posterior = tree["posterior"].to_dataset()
    rng = np.random.default_rng(4)
    for one in added:
        scale = one.mechanism.added.scale
        draws = rng.normal(scale, 0.1 * scale, tuple(posterior.sizes[d] for d in ("chain", "draw")))
        posterior[one.name] = (("chain", "draw"), draws)
    tree = xr.DataTree.from_dict({"posterior": posterior})
    strengths = [
        Parameter(one.name, one.mechanism.strength.symbol, one.mechanism.strength.unit) for one in added
    ]
    shown = SimpleNamespace(
        parameters=lambda law: (*problem.parameters(law), *strengths),
        added=added,
        error_model=problem.error_model,
    )
    return SimpleNamespace(problem=shown, law=LAW, tree=tree, gate=gate)


@cache
def diagnosis(kind: str, text: str = "") -> Outcome:
    """A diagnosis of each kind, or one that names a mechanism; with hostile names where `text` is given."""
    problem = hostile_problem(text) if text else hierarchical_ryggfonn()
    if kind == "cannot":
        return NotDiagnosed(problem, LAW, "only 3 avalanches with a reading; at least 6 are needed")
    if kind == "gate":
        failed = Gate(1.3, 12.0, 9.0, 0, ("r-hat 1.300 exceeds 1.01: more --tune",))
        why = "the gate of the base law's calibration failed"
        return NotDiagnosed(problem, LAW, why, calibration(problem, gate=failed), seconds={"base": 3.0})
    tops = {
        "tie": {"segment_drag": 40.0},
        "two": {"covariate_friction": 40.0},
        "sensor": {"sensor_bias": 40.0},
        "unexplained": {"unlisted": 30.0},
    }.get(kind, {kind: 40.0})
    comparison = comparison_of(problem, tops, 2 if kind in ("tie", "sensor") else 1)
    names = {
        "tie": ("segment_drag", "entrainment"), "two": ("covariate_friction",), "sensor": ("sensor_bias",),
    }.get(kind, (kind,) if kind in mechanisms() else ())  # fmt: skip
    verdicts = {
        "tie": "missing_physics", "two": "missing_physics", "sensor": "instrument",
        "unexplained": "unexplained", "nothing": "nothing_missing", "silent": "cannot_tell",
    }  # fmt: skip
    clean = np.random.default_rng(1).normal(0.0, 1.0, 120)
    verdict_ = verdicts.get(kind) or blamed({kind: 1.0, UNLISTED: 0.0}).verdict
    steps = _steps(problem, comparison, names, clean, second=kind == "two")
    alarm = kind not in ("nothing", "silent")
    table = told(problem, 0.3 if kind == "silent" else 0.8)
    finding = after = None
    if steps:
        finding, after = Augmented(steps, calibration(problem)), held(problem, 1.1)
    if kind == "unexplained":
        finding = profile_law(problem, clean)
        after = finding.after
    return Diagnosis(
        problem, LAW, calibration(problem), table,
        BootstrapTest(30.0 if alarm else 0.3, clean), comparison, Decision(verdict_, names),
        location(), finding, held(problem, 0.0), after, hangs_on(verdict_, names, problem),
        None if finding is None else BeforeAfter(
            given_above(problem, 0.0), given_above(problem, 0.4)
        ),
        {"base": 12.3, "comparison": 45.6},
    )  # fmt: skip


def hangs_on(verdict_: str, names: tuple[str, ...], problem: HierarchicalProblem) -> Influence | None:
    """Two avalanches carry an answer in no list; none carry what is named."""
    if not names and verdict_ != "unexplained":
        return None
    ids = tuple(problem.campaign.event_ids)
    few = () if names else ids[1:3]
    without = np.where([one in few for one in ids], 12.0, 24.0)
    readings = (
        ReadingsLeftOut("zeros", None, 5, 17.0),
        ReadingsLeftOut("sensor", problem.campaign.sensor_ids[0], 21, 1.5),
    )
    return Influence(
        names[0] if names else "unlisted", 25.0, 4.0, ids, without, Few(few, 0.5) if few else None,
        0.5 if few else None, 0.5 if few else 14.0, readings,
    )  # fmt: skip


def with_finding(found: Diagnosis, **changes: object) -> Diagnosis:
    """The same with something else about what was added."""
    return replace(found, finding=replace(found.finding, **changes))


def profile_law(problem: HierarchicalProblem, clean: np.ndarray) -> ProfileLaw:
    at = np.linspace(1580.0, 2200.0, 20)
    mean = 0.5 * np.exp(-0.5 * ((at - 1800.0) / 60.0) ** 2)
    prior = Prior(0.8, 120.0, 1800.0)
    fit = Fit(None, np.empty(0))
    profile = Profile(KINDS[0], prior, at, mean, 0.01 * np.eye(20), 30.0, 42.0, fit, ())
    draws = Draws(np.empty((0, 1)), np.empty((0, 1, 1)), np.empty((0, 0)))
    scores = held(problem, 0.0), held(problem, 1.1)
    return ProfileLaw(profile, "robust", BootstrapTest(0.1, clean), *scores, draws, draws)


def _steps(problem, comparison, names, clean, *, second):
    if not names:
        return ()
    compared = [(names, comparison)]
    if second:
        again = comparison_of(problem, {"obstacle": 30.0})
        compared.append((("obstacle",), again))
    added, steps = (), []
    for (name, *tied), its_comparison in compared:
        candidate = its_comparison.under_each[0].candidates[name]
        best = candidate.best
        strength = best.mechanism.strength.name
        added += (AddedStrength(best.mechanism, best.shape, Direction(), strength),)
        steps.append(
            Step(
                candidate, tuple(tied), its_comparison, calibration(problem, added), BootstrapTest(0.1, clean)
            )
        )
    return tuple(steps)


def document_of(found: Outcome, **more) -> dict:
    """What `skred diagnose` writes to verdict.json, as it is read again."""
    document = verdict(found) | {"settings": {"draws": 1000}, "report": report_facts(found)}
    return json.loads(json.dumps(plain(document | more), allow_nan=False))


@cache
def documents(kind: str, text: str = "") -> tuple[dict, xr.DataTree]:
    """Content of verdict.json and of diagnosis.nc."""
    found = diagnosis(kind, text)
    return document_of(found), figure_data(found)


def write_documents(kind: str, folder: Path, text: str = "") -> None:
    """What a diagnosis leaves in its folder that its report is made from."""
    document, tree = documents(kind, text)
    write_json(folder / "verdict.json", document)
    save(tree, folder / "diagnosis.nc")
