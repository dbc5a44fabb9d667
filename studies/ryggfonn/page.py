"""docs/ryggfonn.md from the diagnoses of the real recordings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from studies.ryggfonn.before import before_and_now, beside_the_audit
from studies.ryggfonn.cells import number_text, share_text, where_text
from studies.ryggfonn.groups import words
from studies.ryggfonn.questions import between, dam, growing

Found = Mapping[str, Any]
LAWS = {
    "coulomb": "Base M1, dry friction",
    "pcm": "Base M2, PCM",
    "constant": "Base M3, constant retardation",
    "voellmy": "The Voellmy model: friction without curvature, and drag",
}
MOVED = ("LC", "CD")
"""Sensors whose places are inferred, to within 40 and 20 m (data README)."""
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
- Drag on a stretch has one and a half parts of the prior of listed physics, entrainment half a part, every
  other mechanism one: drag and entrainment at a constant rate are one term.
- `data/ryggfonn/README.md` says what was assumed: all releases at s = 0, sensors' places inferred, five
  readings of unknown meaning.
"""
_UNITS = {"1": "", "m-1": " 1/m", "s-1": " 1/s", "m s-2": " m/s²", "m": " m"}


def page(found: Mapping[str, Found]) -> str:
    """The whole page."""
    parts = [_HEAD, *(_base(title, found[name]) for name, title in LAWS.items())]
    parts += [
        growing(found),
        dam(found),
        between(found, tuple(LAWS)),
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
{table}| force not in the list | {unlisted:.1f} | {share_text(one["probability"].get("unlisted", 0.0))} | | |

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
            f"{one['profile']['equation']}, most clearly at {where_text(one['location'])}"
        )
        fronts = {"fast front": "none on a typical front; faster and slower ones feel it with opposite signs"}
        said["mean effect"] = fronts.get(one["missing_work_of"], "on all fronts")
    p_value, again = number_text(evidence["p_value"]), number_text(one.get("p_value_augmented"))
    said["check"] = f"p = {p_value}; with what was added {again}"
    if clean := one.get("clean"):
        odds = clean["log_odds"]
        said["log odds of anything against `nothing`"] = (
            f"{clean['recordings']:.1f}; of {len(odds)} clean campaigns at most {max(odds):.1f}"
        )
    said["probability of `nothing`"] = share_text(shares["nothing"])
    said["error models compared"] = f"{', '.join(one.get('error_models', []))}{_under(one)}"
    if one["next_sensor"] and one["next_sensor"]["splits"]:
        place, splits = one["next_sensor"]["s_from_m"], one["next_sensor"]["splits"]
        said["speed that would split the tie best"] = f"at s = {place:.0f} m ({' from '.join(splits)})"
    said["avalanches differ in it: common, spread, some"] = _differ(one)
    said["carried by"] = _carried(one["influence"])
    said["of the readings"] = _by_readings(one["influence"])
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


def _by_readings(found: Found) -> str:
    """Which sensor or kind of readings most hangs on, and what is left without it."""
    least = min(found["readings"], key=lambda one: one["log_bayes_factor"])
    without = f"the {least['n']} " + (
        f"readings of {least['sensor']}" if least["sensor"] else f"readings that are {least['kind']}"
    )
    left, needed = least["log_bayes_factor"], found["needed"]
    enough = "more than" if left > needed else "and not"
    return f"most hangs on {without}: without them {left:.1f} nats are left, {enough} the {needed:.1f} needed"


def _added(row: Found) -> str:
    strength = row["strength"]
    size = f"{strength['mean']:.3g} ± {strength['sd']:.2g}{_UNITS[strength['unit']]}"
    return f"{size}, {where_text(row['location']) or 'along the track'}"


def _before_after(held: Found, key: str, unit: str, digits: int) -> str:
    return f"{held[key + '_before']:.{digits}f} {unit} before, {held[key + '_after']:.{digits}f} {unit} after"


def _under(one: Found) -> str:
    return f"; before and after under {one['error_model']} errors" if one.get("error_model") else ""


def _row(row: Found, probability: float) -> str:
    strength = row["strength"]
    unit = _UNITS[strength["unit"]]
    where = where_text(row["location"]) or row["covariate"] or row["sensor"] or "along the track"
    return (
        f"| `{row['id']}` | {row['log_bayes_factor']:.1f} | {share_text(probability)} |"
        f" {strength['mean']:.3g} ± {strength['sd']:.2g}{unit} | {where} |\n"
    )


def _named(one: Found) -> str:
    if not one["mechanism"]:
        return ""
    ties = f", tied with {', '.join(one['indistinguishable'])}" if one["indistinguishable"] else ""
    return f": {one['mechanism']}{ties}"


def _robust(found: Mapping[str, Found]) -> str:
    """The sensitivity runs side by side."""
    rows = []
    for name, one in found.items():
        if one["base_model"] != "pcm" or name.endswith(UNSEEN):
            continue
        listed = sorted(one.get("candidates", []), key=lambda row: -row["log_bayes_factor"])[:2]
        what = "; ".join(
            f"`{row['id']}` {row['log_bayes_factor']:.1f}, {where_text(row['location']) or 'along the track'}"
            for row in listed
        )
        said = one["verdict"] + _named(one) + (f": {one['reason']}" if one.get("reason") else "")
        share = share_text(one["probability"].get("unlisted", 0.0))
        p_value, again = number_text(one["evidence"]["p_value"]), number_text(one.get("p_value_augmented"))
        lc = next(row for row in one["influence"]["readings"] if row["sensor"] == MOVED[0])
        carried, needed = lc["log_bayes_factor"], one["influence"]["needed"]
        rows.append(
            f"| {name} | {said} | {p_value}, {again} | {what} | {share} | {_differ(one)} |"
            f" {carried:.1f} of {needed:.1f} | {_code(one)} |"
        )
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

| case | verdict | p of the check, and with what was added | leading candidates, log Bayes factor | \
probability of `unlisted` | common, spread, some | left without LC, of nats needed | code |
| --- | --- | --- | --- | --- | --- | --- | --- |
{chr(10).join(rows)}

*Common, spread, some*: how probably all avalanches have the same strength, differ log-normally, or have it
only in part. *Along the track* is all of it, or from the first recording on. *Left without LC*: the log
Bayes factor of the name without the readings of LC, whose place is inferred, and what a claim needs. At p of
0.01 the law with what was added is still not all: do not take it for the whole story.

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
    return "" if not ways else ", ".join(share_text(ways[name]) for name in ("common", "spread", "some"))


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
        p_value = number_text(one.get("p_value_augmented"))
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
        added = f"{_added_terms(found[name])}; {_added_terms(found[name + UNSEEN])}"
        rows.append(f"| `{name}` | {added} | {gains} | {_code(found[name + UNSEEN])} |")
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

| base | added by all: now; by the code of the last two columns | each left out by weights (now) | \
refitted without each | whole diagnosis without it | that code |
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
