"""docs/ryggfonn.md from the diagnoses of the real recordings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from studies.ryggfonn.groups import words

Found = Mapping[str, Any]
DAM_CROWN_M, DAM_HEIGHT_M = 1940.0, 15.0
_NEAR_M = 60.0
LAWS = {
    "coulomb": "Base M1, dry friction",
    "pcm": "Base M2, PCM",
    "constant": "Base M3, constant retardation",
}
UNSEEN = "-unseen"
"""What the names of those cases end in that repeat the diagnosis without some avalanches."""
_HEAD = """# Ryggfonn: what the block models leave out

Written by `python -m studies.ryggfonn` from `studies/results/ryggfonn/`; every figure below
is the tool's own. 22 avalanches on the natural terrain, the catching dam (15 m high, crown at s = 1940 m,
upstream foot at 1910 m) withheld. Log Bayes factors are against nothing, in nats, shapes and strengths
integrated over, under the error models that were raced; probabilities use the prior odds of the campaign
format. Left-out gains compare the augmented law with the base law under one error model, the one that the
winner leads in.
"""


def page(found: Mapping[str, Found]) -> str:
    """The whole page."""
    parts = [_HEAD, *(_base(title, found[name]) for name, title in LAWS.items())]
    parts += [
        _growing(found),
        _dam(found),
        _between(found),
        words(found["pcm"].get("retardations", [])),
        _robust(found),
        _left(found),
        _unseen(found),
    ]
    return "\n".join(parts)


def _base(title: str, one: Found) -> str:
    name = one["base_model"]
    rows = sorted(one.get("candidates", []), key=lambda row: -row["log_bayes_factor"])[:6]
    table = "".join(_row(row, one["probability"][row["id"]]) for row in rows)
    unlisted = one.get("log_bayes_factors", {}).get("unlisted", float("nan"))
    return f"""## {title}

Verdict `{one["verdict"]}`{_named(one)}; omnibus p = {_number(one["evidence"]["p_value"])}, error models
raced: {", ".join(one.get("error_models", []))}{_under(one)}.

> {one["statement"]}

| candidate | log Bayes factor | probability | strength | where |
| --- | --- | --- | --- | --- |
{table}| unlisted force | {unlisted:.1f} | {_share(one["probability"].get("unlisted", 0.0))} | | |

![Where: the missing retardation along the track](figures/ryggfonn-{name}-where.png)
"""


def _under(one: Found) -> str:
    return f"; before and after under {one['error_model']} errors" if one.get("error_model") else ""


def _row(row: Found, probability: float) -> str:
    strength = row["strength"]
    unit = "" if strength["unit"] == "1" else f" {strength['unit']}"
    where = _where(row["location"]) or row["covariate"] or row["sensor"] or "all along"
    return (
        f"| `{row['id']}` | {row['log_bayes_factor']:.1f} | {_share(probability)} |"
        f" {strength['mean']:.3g} ± {strength['sd']:.2g}{unit} | {where} |\n"
    )


def _named(one: Found) -> str:
    if not one["mechanism"]:
        return ""
    ties = f", not to be told from {', '.join(one['indistinguishable'])}" if one["indistinguishable"] else ""
    return f": {one['mechanism']}{ties}"


def _where(location: Found | None) -> str:
    return "" if location is None else f"{location['s_from_m']:.0f}-{location['s_to_m']:.0f} m"


def _share(probability: float) -> str:
    return f"{probability:.2f}" if probability >= 0.005 else "<0.01"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.2g}"


def _candidate(one: Found, name: str) -> Found | None:
    return next((row for row in one.get("candidates", []) if row["id"] == name), None)


def _growing(found: Mapping[str, Found]) -> str:
    """Whether M1 is found to lack a drag that grows with speed."""
    factors = found["coulomb"]["log_bayes_factors"]
    drags = ("turbulent_drag", "viscous_drag", "segment_drag")
    others = (
        "obstacle",
        "constant_retardation",
        "segment_friction",
        "velocity_weakening",
        "covariate_friction",
    )
    said = ", ".join(f"`{name}` {factors[name]:.1f}" for name in drags)
    against = ", ".join(f"`{name}` {factors[name]:.1f}" for name in others)
    best = max(factors, key=lambda name: factors[name])
    word = "is one of them" if best in (*drags, "entrainment") else "is none of them"
    return (
        "## Does M1 lack a drag that grows with speed?\n\n"
        f"Terms that grow with speed: {said}. Others: {against}. The most probable candidate, `{best}`,\n"
        f"{word}.\n"
    )


def _between(found: Mapping[str, Found]) -> str:
    """The missing work between the sensors, where the data's README tells of two groups of retardation."""
    rows = "".join(
        f"| {name} | {row['s_from_m']:.0f}-{row['s_to_m']:.0f} | {found[name]['missing_work_of']} |"
        f" {row['mean']:.0f} ± {row['sd']:.0f} |\n"
        for name in LAWS
        for row in found[name].get("missing_work", [])
    )
    stretch = _candidate(found["pcm"], "segment_friction")
    said = ""
    if stretch is not None:
        said = (
            f"Under M2 plain friction on a stretch would sit at {_where(stretch['location'])} and take"
            f" {stretch['strength']['mean']:.2g} ± {stretch['strength']['sd']:.1g} m/s² more than dry"
            " friction and drag do.\n"
        )
    return (
        "## Between LC and CD\n\nMissing specific work between sensors (positive: the law brakes too little),"
        " with the most probable unlisted force that goes with speed as what is named does. A force that is"
        " nil at the typical speed does work only on other fronts; then it is that on one faster than most by"
        f" the fronts' spread. {said}\n"
        "| base | s [m] | work on a | missing work [J/kg] |\n| --- | --- | --- | --- |\n" + rows
    )


def _dam(found: Mapping[str, Found]) -> str:
    lines = []
    for name in ("pcm", "constant"):
        row = _candidate(found[name], "obstacle")
        if row is None:
            lines.append(f"- Base `{name}`: no comparison was run ({found[name]['reason']}).")
            continue
        middle = 0.5 * (row["location"]["s_from_m"] + row["location"]["s_to_m"])
        best = max(one["log_bayes_factor"] for one in found[name]["candidates"])
        near = "at" if abs(middle - DAM_CROWN_M) <= _NEAR_M else "not at"
        height, share = row["strength"], _share(found[name]["probability"]["obstacle"])
        lines.append(
            f"- Base `{name}`: the best obstacle stands at s = {middle:.0f} m ({near} the dam's crown),"
            f" height {height['mean']:.1f} ± {height['sd']:.1f} m, log Bayes factor"
            f" {row['log_bayes_factor']:.1f} against nothing and"
            f" {row['log_bayes_factor'] - best:+.1f} against the best candidate; probability {share}."
        )
    title = "## Did the dam stop the avalanches that rest at it?\n\n"
    return title + "\n".join(lines) + "\n\n" + _answer(found)


def _answer(found: Mapping[str, Found]) -> str:
    """The answer that the numbers give, and what it would take where they give none."""
    wins = [name for name in ("pcm", "constant") if found[name]["mechanism"] == "obstacle"]
    if wins:
        return f"The diagnosis names an obstacle under {' and '.join(wins)}.\n"
    return (
        "The diagnosis does not name the dam under either law: something else explains more of the same\n"
        "recordings first. So from these recordings, with these laws, it cannot be told whether the dam\n"
        "stopped the avalanches that rest at it. What it would take: speeds just above the foot and just\n"
        "below the crown of the same avalanche (the dam's mark is the threshold v = 2 g h between those\n"
        "that pass and those that stop), and the upper sensors' places better known than ±20 and ±40 m.\n"
    )


def _robust(found: Mapping[str, Found]) -> str:
    """The sensitivity runs side by side."""
    rows = []
    for name, one in found.items():
        if one["base_model"] != "pcm" or name.endswith(UNSEEN):
            continue
        listed = sorted(one.get("candidates", []), key=lambda row: -row["log_bayes_factor"])[:2]
        what = "; ".join(
            f"`{row['id']}` {row['log_bayes_factor']:.1f} at {_where(row['location']) or 'all'}"
            for row in listed
        )
        said = one["verdict"] + _named(one) + (f": {one['reason']}" if one.get("reason") else "")
        share = _share(one["probability"].get("unlisted", 0.0))
        rows.append(f"| {name} | {said} | {_number(one['evidence']['p_value'])} | {what} | {share} |")
    scales = found["pcm"].get("prior_scales", {})
    priors = "; ".join(
        f"`{name}` {values['0.5']:.1f} / {values['1.0']:.1f} / {values['2.0']:.1f}"
        for name, values in sorted(scales.items(), key=lambda item: -item[1]["1.0"])[:3]
    )
    return f"""## What it depends on

Base M2 under other choices: smoothing of the terrain (10 m elsewhere), Student errors, sensors taken as the
spans they are, the surveyed terrain with the dam in it, and the sensors LC and CD both further up (by 40 and
20 m), both further down, and closer to each other, as far as their places are uncertain.

| case | verdict | omnibus p | leading candidates, log Bayes factor | probability of an unlisted force |
| --- | --- | --- | --- | --- |
{chr(10).join(rows)}

Priors half, once and twice as wide, log Bayes factor of the best shape: {priors}.
"""


def _left(found: Mapping[str, Found]) -> str:
    lines = []
    for name in LAWS:
        one = found[name]
        if not one["mechanisms"] and not one.get("profile"):
            lines.append(f"- `{name}`: nothing was let in ({one['verdict']}).")
            continue
        names = " and ".join(row["id"] for row in one["mechanisms"])
        names = names or "the force profile (fitted anew without each)"
        held = one["held_out"]
        runout = f"{held['rmse_runout_before']:.0f} to {held['rmse_runout_after']:.0f} m"
        lines.append(
            f"- `{name}` with {names}: the check gives p = {_number(one.get('p_value_augmented'))}; for"
            f" avalanches left out the log score changes by {one['evidence']['elpd_diff']:+.1f}"
            f" (doubled standard error {2.0 * one['evidence']['elpd_se']:.1f}), the error of runout from"
            f" {runout}."
        )
    return "## What is left when it is in\n\n" + "\n".join(lines) + "\n"


def _unseen(found: Mapping[str, Found]) -> str:
    """What the gain is on avalanches that did not choose what was let in."""
    rows, folds = [], []
    for name in LAWS:
        usual, exact = found[name]["evidence"], found[name + UNSEEN]["evidence"]
        outer = found[name + UNSEEN]["outer_folds"]
        gains = " | ".join(_gain(one) for one in (usual, exact, outer))
        rows.append(f"| `{name}` | {_added_terms(found[name])} | {gains} |")
        for number, one in enumerate(outer["folds"], start=1):
            names = " and ".join(_named_in_fold(mechanism) for mechanism in one["mechanisms"]) or "nothing"
            without = ", ".join(one["events"])
            folds.append(
                f"| `{name}` | {number}: {without} | {one['verdict']} | {names} | {one['elpd_diff']:+.1f} |"
            )
    k = found["pcm" + UNSEEN]["outer_folds"]["k"]
    return f"""## On avalanches that did not choose it

What was let in was chosen by the avalanches that then judge it. So the whole diagnosis, its naming
included, is repeated without each of {k} parts of them, which judge what it let in (`--outer-folds {k}`).
Before that, each avalanche alone: left out by importance sampling, refitted where that is unreliable; and, as
a check, by a refit without each one (`--exact-loo`; a force profile is fitted anew without each in any case).
Gains in log score, with twice their standard error:

| base | let in by all | left out one by one | refitted without each | whole diagnosis without it |
| --- | --- | --- | --- | --- |
{chr(10).join(rows)}

Fold by fold:

| base | fold: avalanches left out | verdict without them | let in | gain on them |
| --- | --- | --- | --- | --- |
{chr(10).join(folds)}
"""


def _named_in_fold(mechanism: str) -> str:
    return "the force profile" if mechanism == "unlisted" else f"`{mechanism}`"


def _added_terms(one: Found) -> str:
    names = " and ".join(f"`{row['id']}`" for row in one["mechanisms"])
    return names or ("the force profile" if one.get("profile") else "nothing")


def _gain(one: Found) -> str:
    value, error = one["elpd_diff"], one["elpd_se"]
    return "-" if value is None else f"{value:+.1f} ({2.0 * error:.1f})"
