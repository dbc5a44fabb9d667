"""The equation of motion with its new term, and what its symbols mean, as rows of text."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any

from skred.diagnosis.augment.coefficient import augmented_of, strength_of
from skred.diagnosis.evidence.covariates import standard_of
from skred.physics.mechanisms.spec import Group
from skred.physics.mechanisms.stretches import U_1, U_2, equation_of, is_opposed
from skred.report.shared.draws import chains_of, interval
from skred.report.shared.labels import name_text, population_role, symbol_text, unit_text
from skred.report.shared.numbers import decimals_for, rounded

if TYPE_CHECKING:
    from markupsafe import Markup

    from skred.diagnosis.augment.step import Step
    from skred.diagnosis.discrepancy.profile import Profile
    from skred.inference.calibrate import Calibration
    from skred.physics.law import Law
    from skred.report.diagnosis.flat import Flat as Diagnosis

INTERVAL_SDS = 1.645
"""Standard deviations from the middle to the end of a 90 % interval."""
_HEAD = "dU^2/(2 ds) ="
_SIMPLE = [
    ("U", "m s-1", "speed of the front"),
    ("s", "m", "length along the track, downhill"),
    ("phi", "rad", "slope of the track"),
    ("kappa", "m-1", "curvature of the track, positive where it is concave"),
    ("g", "m s-2", "gravity, 9.81"),
]


def formula(text: str) -> Markup:
    """An equation in plain text with its Greek letters, powers and indices; everything else escaped."""
    from markupsafe import Markup, escape

    shown = str(escape(symbol_text(re.sub(r"_", " _", text))))
    shown = re.sub(r"\s_(\w+)", r"<sub>\1</sub>", shown)
    shown = re.sub(r"\^(\w+)", r"<sup>\1</sup>", shown)
    return Markup(shown.replace("- -", "- "))  # noqa: S704 (escaped above)


def equations(found: Diagnosis) -> dict[str, Any]:
    """The base law's equation, with each new term, and what is read instead for an instrument's fault."""
    terms, readings = [], []
    for step in found.steps:
        mechanism, shape = step.candidate.mechanism, step.candidate.best.shape
        if mechanism.group is Group.INSTRUMENT:
            readings.append(formula(mechanism.equation.partition(": ")[2] or mechanism.equation))
        else:
            terms.append(formula("- " + equation_of(mechanism, shape).removeprefix("-")))
    right, relation = _right(found.law)
    if found.profile is not None:
        terms.append(formula("- " + found.profile.profile.kind.equation.removeprefix("-")))
    return {
        "head": formula(_HEAD),
        "base": formula(right),
        "relation": formula(relation) if relation else "",
        "terms": terms,
        "readings": readings,
    }


def _right(law: Law) -> tuple[str, str]:
    """Right-hand side of a law's equation, and the relation of its parameters."""
    ending = f", {law.relation}" if law.relation else ""
    return law.equation.removeprefix(_HEAD).strip().removesuffix(ending), law.relation


def symbol_rows(found: Diagnosis) -> list[dict[str, Any]]:
    """Symbol, unit, meaning and reference of everything in the equation."""
    rows = []
    for mechanism in found.law.mechanisms:
        strength = mechanism.strength
        name = name_text(strength.name)
        meaning = mechanism.title if mechanism.title.startswith(name) else f"{name}: {mechanism.title}"
        rows.append(_row(strength.symbol, strength.unit, meaning, mechanism.reference, mechanism.doi))
    for number, step in enumerate(found.steps):
        rows += _added_rows(found, step, number)
    if found.profile is not None:
        rows += _profile_rows(found.profile.profile)
    text = found.law.equation + "".join(step.candidate.mechanism.equation for step in found.steps)
    present = set(re.findall(r"[A-Za-z]+", text)) | {"s", "U"}
    return rows + [_row(*one) for one in _SIMPLE if one[0] in present]


def _row(symbol: str, unit: str, meaning: str, reference: str = "", doi: str = "", new: bool = False) -> Any:
    return {
        "symbol": formula(symbol),
        "unit": unit_text(unit),
        "meaning": meaning,
        "reference": f"{reference}{', doi ' + doi if doi else ''}",
        "new": new,
    }


def _added_rows(found: Diagnosis, step: Step, number: int) -> list[dict[str, Any]]:
    candidate = step.candidate
    mechanism, shape = candidate.mechanism, candidate.best.shape
    mean, sd = strength_of(found.steps, number)
    decimals = decimals_for(sd)
    about = f"{name_text(mechanism.strength.name)}: {mechanism.title}"
    meaning = f"{about}; here {rounded(mean, decimals)} ± {rounded(sd, decimals)}"
    if shape.sensor:
        percent = 100.0 * (math.exp(mean) - 1.0)
        meaning += f": {shape.sensor} reads {abs(percent):.0f} % too {'high' if percent > 0 else 'low'}"
    rows = [
        _row(
            mechanism.strength.symbol,
            mechanism.strength.unit,
            meaning,
            mechanism.reference,
            mechanism.doi,
            True,
        )
    ]
    if (stretch := candidate.stretch()) is not None:
        first, last = stretch
        if mechanism.id == "obstacle":
            middle = 0.5 * (first + last)
            rows.append(_row("s_o", "m", f"its crown, here {middle:.0f}", new=True))
            rows.append(_row("w", "m", f"length of its climb, and of its descent, here {middle - first:.0f}"))
        else:
            ends = f"where the stretch begins and ends, here {first:.0f} and {last:.0f}"
            rows.append(_row("s_1, s_2", "m", ends, new=True))
    if is_opposed(shape):
        first, last = (dict(shape.constants)[name] for name in (U_1, U_2))
        what = f"speed at which a relief on the stretch equals it, here {first:g} at s_1 to {last:g} at s_2"
        return [*rows, _row("U_0", "m s-1", what, new=True)]
    for named, value in shape.constants:
        symbol, _, unit = named.partition(" [")
        rows.append(_row(_short(symbol), unit.rstrip("]") or "1", f"{symbol}, here {value:g}", new=True))
    if shape.covariate:
        standard = standard_of(found.problem.campaign.events, shape.covariate)
        what = "logarithm standardised" if standard is not None and standard.logarithm else "standardised"
        rows.append(_row("x", "1", f"{shape.covariate}, {what}", new=True))
    return rows


def _profile_rows(profile: Profile) -> list[dict[str, Any]]:
    """The force profile's symbols."""
    first, last = profile.knots_m[0], profile.knots_m[-1]
    what = f"the force profile: linear between {len(profile.knots_m)} knots from {first:.0f} to {last:.0f} m"
    rows = [_row("f(s)", profile.kind.unit, what, new=True)]
    if profile.kind.opposed:
        rows.append(_row("U_0", "m s-1", "typical speed of the base law's fronts there", new=True))
    return rows


def _short(symbol: str) -> str:
    return {"loss": "l"}.get(symbol, symbol)


def parameter_rows(found: Diagnosis) -> list[dict[str, str]]:
    """All parameters, by the base law and by the augmented one."""
    rows: dict[str, dict[str, str]] = {}
    calibrations = {
        "before": found.calibration,
        "after": found.steps[-1].calibration if found.steps else None,
    }
    for when, calibration in calibrations.items():
        if calibration is None:
            continue
        for parameter in calibration.problem.parameters(calibration.law):
            values = chains_of(calibration.tree, parameter.name).ravel()
            shown = {
                "name": _role(parameter.name, calibration),
                "symbol": formula(parameter.symbol),
                "unit": unit_text(parameter.unit),
                "before": "",
                "after": "",
            }
            rows.setdefault(parameter.name, shown)[when] = _interval_text(values)
    # Of what was added the one interval that there is: over all places, not that of the chains at one.
    for number, name in enumerate(_added_names(found)):
        mean, sd = strength_of(found.steps, number)
        decimals = decimals_for(sd)
        ends = (rounded(mean + side * INTERVAL_SDS * sd, decimals) for side in (-1.0, 1.0))
        rows[name]["after"] = f"{rounded(mean, decimals)} ({' to '.join(ends)})"
    return list(rows.values())


def _added_names(found: Diagnosis) -> list[str]:
    return [one.name for one in augmented_of(found.steps[-1].calibration).added] if found.steps else []


def _role(name: str, calibration: Calibration) -> str:
    role = population_role(name)
    added = {one.name for one in getattr(calibration.problem, "added", ())}
    return (
        f"{name_text(name)}, added"
        if name in added
        else f"median {name_text(name)}"
        if role == "median"
        else role
    )


def _interval_text(values: Any) -> str:
    decimals = decimals_for(float(values.std()))
    low, high = (rounded(value, decimals) for value in interval(values))
    return f"{rounded(float(values.mean()), decimals)} ({low} to {high})"
