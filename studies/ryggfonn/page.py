"""docs/ryggfonn.md from the diagnoses of the real recordings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from studies.ryggfonn.before import before_and_now, beside_the_audit
from studies.ryggfonn.groups import words

Found = Mapping[str, Any]
DAM_CROWN_M, DAM_HEIGHT_M = 1940.0, 15.0
_NEAR_M = 60.0
LAWS = {
    "coulomb": "Base M1, dry friction",
    "pcm": "Base M2, PCM",
    "constant": "Base M3, constant retardation",
    "voellmy": "The Voellmy model: friction without curvature, and drag",
}
PUBLISHED = ("coulomb", "pcm", "constant")
"""Those of the published calibration, whose diagnosis is repeated without some avalanches."""
UNSEEN = "-unseen"
"""What the names of those cases end in that repeat the diagnosis without some avalanches."""
_HEAD = """# Ryggfonn: what the block models leave out

Written by `python -m studies.ryggfonn` from `studies/results/ryggfonn/`. Every figure is the
tool's own. Cases were computed as time allowed, not all by one version of the code: *code* is its commit.
The campaign has 22 avalanches on the natural terrain. The catching dam is withheld: 15 m high,
crown at s = 1940 m, upstream foot at 1910 m.

- *Log Bayes factors* are against `nothing`, in nats. Coefficients and shapes are integrated over, and the
  error models that were compared are summed over.
- *Probabilities* use the prior odds of [the method](method.md).
- *Held-out* gains are changes of the log score when each avalanche is predicted from the others. Augmented
  and base law are compared under one error model, the one in which the first name is most probable.
- *Force not in the list* is the model discrepancy, a Gaussian process along the track.
"""
_UNITS = {"1": "", "m-1": " 1/m", "s-1": " 1/s", "m s-2": " m/s²", "m": " m"}


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
        before_and_now(found),
        beside_the_audit(found),
    ]
    return "\n".join(parts)


def _base(title: str, one: Found) -> str:
    name = one["base_model"]
    rows = sorted(one.get("candidates", []), key=lambda row: -row["log_bayes_factor"])[:6]
    table = "".join(_row(row, one["probability"][row["id"]]) for row in rows)
    unlisted = one.get("log_bayes_factors", {}).get("unlisted", float("nan"))
    answer = "".join(f"| {what} | {said} |\n" for what, said in _answers(one).items())
    return f"""## {title}

| | |
| --- | --- |
{answer}
The six candidates with the most evidence, and the force that is not in the list:

| candidate | log Bayes factor | probability | coefficient | where |
| --- | --- | --- | --- | --- |
{table}| force not in the list | {unlisted:.1f} | {_share(one["probability"].get("unlisted", 0.0))} | | |

![Where: the missing retardation along the track](figures/ryggfonn-{name}-where.png)
"""


def _answers(one: Found) -> dict[str, str]:
    """The verdict, part by part."""
    held, evidence, shares = one["held_out"], one["evidence"], one["probability"]
    said = {"verdict": f"`{one['verdict']}`"}
    said |= {f"added: `{row['id']}`": _added(row) for row in one["mechanisms"]}
    if one["indistinguishable"]:
        said[f"tied with `{one['mechanism']}`"] = ", ".join(
            f"`{name}` ({shares[name]:.2f})" for name in one["indistinguishable"]
        )
    if one.get("profile"):
        said["added: a force profile"] = (
            f"{one['profile']['equation']}, most clearly at {_where(one['location'])}"
        )
        fronts = {"fast front": "none on a typical front; faster and slower ones feel it with opposite signs"}
        said["mean effect"] = fronts.get(one["missing_work_of"], "on all fronts")
    said["check"] = (
        f"p = {_number(evidence['p_value'])}; with what was added {_number(one.get('p_value_augmented'))}"
    )
    if clean := one.get("clean"):
        odds = clean["log_odds"]
        said["log odds of anything against `nothing`"] = (
            f"{clean['recordings']:.1f}; of {len(odds)} clean campaigns at most {max(odds):.1f}"
        )
    said["probability of `nothing`"] = _share(shares["nothing"])
    said["error models compared"] = f"{', '.join(one.get('error_models', []))}{_under(one)}"
    if one["next_sensor"] and one["next_sensor"]["splits"]:
        place, splits = one["next_sensor"]["s_from_m"], one["next_sensor"]["splits"]
        said["speed that would split the tie best"] = f"at s = {place:.0f} m ({' from '.join(splits)})"
    said["avalanches differ in it: common, spread, some"] = _differ(one)
    said["carried by"] = _carried(one["influence"])
    said["held-out log score"] = (
        f"{evidence['elpd_diff']:+.1f} (doubled standard error {2.0 * evidence['elpd_se']:.1f})"
    )
    said["held-out error of runout"] = _before_after(held, "rmse_runout", "m", 0)
    said["held-out error of speeds"] = _before_after(held, "rmse_velocity", "m/s", 1)
    return said


def _carried(found: Found) -> str:
    """The few avalanches without which the answer would not be given, or that there are none."""
    alarm, rival = found.get("alarm", found), found.get("rival")
    name = ""
    if rival is not None and rival["carried_by"]:
        few = ", ".join(rival["carried_by"])
        name = f"the name by {few}: without, `{rival['id']}` is {-rival['without_them']:.1f} nats ahead; "
    if not alarm["carried_by"]:
        left = f"{found['without_a_third']:.1f} nats are left"
        return f"{name}the alarm by no few: {left} without the third that carry most"
    few = ", ".join(alarm["carried_by"])
    left = f"{alarm['without_them']:.1f} nats are left, and {found['needed']:.1f} are needed"
    return f"{name}the alarm by {few}: without them {left}"


def _added(row: Found) -> str:
    strength = row["strength"]
    size = f"{strength['mean']:.3g} ± {strength['sd']:.2g}{_UNITS[strength['unit']]}"
    return f"{size}, {_where(row['location']) or 'along the track'}"


def _before_after(held: Found, key: str, unit: str, digits: int) -> str:
    return f"{held[key + '_before']:.{digits}f} {unit} before, {held[key + '_after']:.{digits}f} {unit} after"


def _under(one: Found) -> str:
    return f"; before and after under {one['error_model']} errors" if one.get("error_model") else ""


def _row(row: Found, probability: float) -> str:
    strength = row["strength"]
    unit = _UNITS[strength["unit"]]
    where = _where(row["location"]) or row["covariate"] or row["sensor"] or "along the track"
    return (
        f"| `{row['id']}` | {row['log_bayes_factor']:.1f} | {_share(probability)} |"
        f" {strength['mean']:.3g} ± {strength['sd']:.2g}{unit} | {where} |\n"
    )


def _named(one: Found) -> str:
    if not one["mechanism"]:
        return ""
    ties = f", tied with {', '.join(one['indistinguishable'])}" if one["indistinguishable"] else ""
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
    """Whether what M1 lacks grows with speed."""
    factors = found["coulomb"]["log_bayes_factors"]
    drags = ("turbulent_drag", "viscous_drag", "segment_drag")
    others = (
        "obstacle",
        "constant_retardation",
        "segment_friction",
        "velocity_weakening",
        "covariate_friction",
    )
    best = max(factors, key=lambda name: factors[name])
    rows = [(name, "yes") for name in drags] + [(name, "no") for name in others]
    rows.sort(key=lambda row: -factors[row[0]])
    table = "".join(f"| `{name}` | {grows} | {factors[name]:.1f} |\n" for name, grows in rows)
    word = "grows with speed" if best in (*drags, "entrainment") else "does not grow with speed"
    return (
        "## Does M1 lack a drag that grows with speed?\n\n"
        "| candidate | grows with speed | log Bayes factor |\n| --- | --- | --- |\n" + table + "\n"
        f"The candidate with the most evidence, `{best}`, {word}.\n"
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
            f"\nUnder M2 the best friction on a stretch acts at {_where(stretch['location'])}:"
            f" {stretch['strength']['mean']:.2g} ± {stretch['strength']['sd']:.1g} m/s² beside dry friction"
            " and drag.\n"
        )
    return (
        "## Between LC and CD\n\n"
        "LC and CD are sensors at 1650 and 1810 m. Missing specific work is positive where the law\n"
        "decelerates fronts too little. It is the work of the most probable discrepancy that depends on\n"
        "speed as the first name does. A compensated force does no work on a typical front. Its row is\n"
        "for a front that is faster than the typical one by the fronts' spread.\n\n"
        "| base | s [m] | work on a | missing work [J/kg] |\n| --- | --- | --- | --- |\n" + rows + said
    )


def _dam(found: Mapping[str, Found]) -> str:
    """The best obstacle under each law, beside the dam."""
    rows = []
    for name in ("pcm", "constant"):
        row = _candidate(found[name], "obstacle")
        if row is None:
            rows.append(f"| `{name}` | no comparison was run: {found[name]['reason']} | | | | |")
            continue
        middle = 0.5 * (row["location"]["s_from_m"] + row["location"]["s_to_m"])
        best = max(one["log_bayes_factor"] for one in found[name]["candidates"])
        near = "yes" if abs(middle - DAM_CROWN_M) <= _NEAR_M else "no"
        height, share = row["strength"], _share(found[name]["probability"]["obstacle"])
        rows.append(
            f"| `{name}` | s = {middle:.0f} m | {near} | {height['mean']:.1f} ± {height['sd']:.1f} m |"
            f" {row['log_bayes_factor']:.1f}; {row['log_bayes_factor'] - best:+.1f} | {share} |"
        )
    return (
        "## Did the dam stop the avalanches that rest at it?\n\n"
        "| base | best obstacle | at the dam's crown | height | log Bayes factor against `nothing`; against"
        " the best | probability |\n| --- | --- | --- | --- | --- | --- |\n" + "\n".join(rows) + "\n\n"
    ) + _answer(found)


def _answer(found: Mapping[str, Found]) -> str:
    """The answer that the numbers give, and what it would take where they give none."""
    wins = [name for name in ("pcm", "constant") if found[name]["mechanism"] == "obstacle"]
    if wins:
        return f"The diagnosis names an obstacle under {' and '.join(wins)}.\n"
    return (
        "The diagnosis does not name the dam under either law. Another candidate explains more of the same\n"
        "recordings. So these recordings, with these laws, cannot tell whether the dam stopped the\n"
        "avalanches that rest at it. Two things would help:\n\n"
        "- speeds of one avalanche just above the foot and just below the crown. The diagnostic signature\n"
        "  of a dam is the threshold U² = 2 g h between avalanches that pass and those that stop;\n"
        "- better known places of the upper sensors. They are known to ±20 and ±40 m.\n"
    )


def _robust(found: Mapping[str, Found]) -> str:
    """The sensitivity runs side by side."""
    rows = []
    for name, one in found.items():
        if one["base_model"] != "pcm" or name.endswith(UNSEEN):
            continue
        listed = sorted(one.get("candidates", []), key=lambda row: -row["log_bayes_factor"])[:2]
        what = "; ".join(
            f"`{row['id']}` {row['log_bayes_factor']:.1f}, {_where(row['location']) or 'along the track'}"
            for row in listed
        )
        said = one["verdict"] + _named(one) + (f": {one['reason']}" if one.get("reason") else "")
        share = _share(one["probability"].get("unlisted", 0.0))
        p_value = _number(one["evidence"]["p_value"])
        rows.append(f"| {name} | {said} | {p_value} | {what} | {share} | {_differ(one)} | {_code(one)} |")
    scales = found["pcm"].get("prior_scales", {})
    priors = "\n".join(
        f"| `{name}` | {values['0.5']:.1f} | {values['1.0']:.1f} | {values['2.0']:.1f} |"
        for name, values in sorted(scales.items(), key=lambda item: -item[1]["1.0"])[:3]
    )
    return f"""## What it depends on

Base M2 under other choices:

| case | what is different |
| --- | --- |
| `pcm-smoothing-5`, `-20` | the terrain is smoothed over 5 or 20 m, elsewhere over 10 m |
| `pcm-student` | Student errors are the ones asked for |
| `pcm-spans` | LC and CD are taken as the spans that they are, elsewhere as points |
| `pcm-sensors-up`, `-down`, `-closer` | LC is moved by 40 m and CD by 20 m, as far as their places are \
uncertain: both up, both down, towards each other |
| `pcm-places-stated` | these 40 and 20 m are stated as errors (`place_sd_m`), a nuisance of every model |
| `pcm-with-dam` | the surveyed terrain, with the dam in it |

| case | verdict | p of the check | leading candidates, log Bayes factor | probability of `unlisted` | \
common, spread, some | code |
| --- | --- | --- | --- | --- | --- | --- |
{chr(10).join(rows)}

*Common, spread, some*: how probably all avalanches have the same strength, differ log-normally, or have it
only in part. *Along the track* is all of it, or from the first recording on.

Log Bayes factor of the best shape with the prior of the coefficient half, once and twice as wide:

| candidate | half | as it is | twice |
| --- | --- | --- | --- |
{priors}
"""


def _code(one: Found) -> str:
    """The commit that a case was computed by."""
    return one["commit"]


def _differ(one: Found) -> str:
    """How probable each way is in which avalanches may differ in what was added first."""
    ways = (one.get("strength") or {}).get("ways")
    return "" if not ways else ", ".join(_share(ways[name]) for name in ("common", "spread", "some"))


def _left(found: Mapping[str, Found]) -> str:
    """What the check says of the augmented laws, and how they predict."""
    rows = []
    for name in LAWS:
        one = found[name]
        if not one["mechanisms"] and not one.get("profile"):
            rows.append(f"| `{name}` | nothing ({one['verdict']}) | | | | {_code(one)} |")
            continue
        held, gain = one["held_out"], _gain(one["evidence"])
        runout = f"{held['rmse_runout_before']:.0f}, {held['rmse_runout_after']:.0f} m"
        p_value = _number(one.get("p_value_augmented"))
        rows.append(f"| `{name}` | {_added_terms(one)} | {p_value} | {gain} | {runout} | {_code(one)} |")
    return f"""## With what was added

The check of the augmented law, and each avalanche predicted from the others. A force profile is fitted again
without each avalanche. Where odds allow no claim the check simulates nine clean campaigns at most, so p is
coarse: on another processor PCM had 0.3.

| base | added | p of the check | held-out log score (doubled standard error) | runout error before, after \
| code |
| --- | --- | --- | --- | --- | --- |
{chr(10).join(rows)}
"""


def _unseen(found: Mapping[str, Found]) -> str:
    """What the gain is on avalanches that did not choose what was let in."""
    rows, folds = [], []
    for name in PUBLISHED:
        usual, exact = found[name]["evidence"], found[name + UNSEEN]["evidence"]
        outer = found[name + UNSEEN]["outer_folds"]
        gains = " | ".join(_gain(one) for one in (usual, exact, outer))
        rows.append(f"| `{name}` | {_added_terms(found[name])} | {gains} | {_code(found[name + UNSEEN])} |")
        for number, one in enumerate(outer["folds"], start=1):
            names = " and ".join(_named_in_fold(mechanism) for mechanism in one["mechanisms"]) or "nothing"
            without = ", ".join(one["events"])
            folds.append(
                f"| `{name}` | {number}: {without} | {one['verdict']} | {names} | {one['elpd_diff']:+.1f} |"
            )
    k = found["pcm" + UNSEEN]["outer_folds"]["k"]
    return f"""## On avalanches that did not choose it

All avalanches chose what was added, and then judge it. So the whole diagnosis, its naming included, is
repeated without each of {k} parts of them. Each part then judges what was added without it
(`--outer-folds {k}`). Before that, each avalanche is left out alone: by importance sampling, with a refit
where that is unreliable, and as a check by a refit without each (`--exact-loo`). Changes of the log score,
with doubled standard errors:

| base | added by all | each left out by weights | refitted without each | whole diagnosis without it \
| code of the last two |
| --- | --- | --- | --- | --- | --- |
{chr(10).join(rows)}

Part by part:

| base | part: avalanches left out | verdict without them | added | gain on them |
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
