"""Ryggfonn by the code before issue 34, and by an independent audit, beside the results of today."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from skred.inference.between_events import PRIOR, BetweenEvents
from studies.files import RESULTS, read

Found = Mapping[str, Any]
_SHOWN = 4
"""Candidates of each law, besides the force that is not in the list."""
_CARRYING = ("19880315", "19890217", "19920311", "20030406", "20050416")
"""Avalanches that carried the answer under M2 by the audit."""


def before_and_now(found: Mapping[str, Found]) -> str:
    """Each law's answer by both codes, and the evidence of what leads."""
    before = read(RESULTS / "ryggfonn_before.json")
    rows, leading = [], []
    for law, then in before["laws"].items():
        now = found[law]
        rows.append(f"| `{law}` | {_answer(then, then['added'])} | {_answer(now, _added(now))} |")
        leading += _leading(law, then, now)
    return f"""## What changed, and why

The code of commit {before["commit"]} had one strength for all avalanches, looked for it around the base
law's own fit, began the terms of the whole track at its top, and gave stretches of friction and of drag
different priors of their places.

| base | before | now |
| --- | --- | --- |
{chr(10).join(rows)}

Log Bayes factors. What a candidate has now with one strength for all avalanches is due to how it is looked
for, and where: at all starts, in finer steps of place and length, and from the first recording on. What it
has beyond that it has because avalanches may differ.

| base | candidate | before | now, one strength for all | now |
| --- | --- | --- | --- | --- |
{chr(10).join(leading)}
"""


def beside_the_audit(found: Mapping[str, Found]) -> str:
    """What the audit, which had code of its own, found under M2."""
    pcm, stated = found["pcm"], found["pcm-places-stated"]
    friction, factors = _candidate(pcm, "segment_friction"), pcm["log_bayes_factors"]
    at_best = pcm["prior_scales"]["segment_friction"]["1.0"]
    below = pcm["conditional"]["sensors"][0]
    speeds = below["all"]
    without = sorted(pcm["influence"]["events"], key=lambda one: one["log_bayes_factor"])
    most = [one["event"] for one in without[: len(_CARRYING)]]
    same = "the same five" if set(most) == set(_CARRYING) else ", ".join(most)
    rows = (
        ("friction on a stretch, best shape, one strength", "28.7 nats", f"{at_best:.1f} nats"),
        ("the same over all its places", "21.7", f"{_in_common(friction):.1f}"),
        ("the same if avalanches may differ", "25.8 (two regimes)", f"{friction['log_bayes_factor']:.1f}"),
        ("a force that is not in the list", "25.6", f"{factors['unlisted']:.1f}"),
        (
            "what stated places of LC and CD (40 and 20 m) take of friction on a stretch",
            "6",
            f"{factors['segment_friction'] - stated['log_bayes_factors']['segment_friction']:.1f}",
        ),
        ("avalanches that take most of it", ", ".join(_CARRYING), same),
        (
            "without those that carry it",
            f"-0.15 (those {len(_CARRYING)})",
            _without(pcm["influence"]),
        ),
        (
            f"error of the speed at {below['sensor']} given that at LC",
            "10.4 to 8.3 m/s",
            f"{speeds['rmse_before']:.1f} to {speeds['rmse_after']:.1f} m/s",
        ),
    )
    table = "\n".join(f"| {' | '.join(row)} |" for row in rows)
    return f"""## Beside an independent audit

The audit had code of its own. It compared under scaled errors; the tool sums over error models.

| under M2 | audit | here |
| --- | --- | --- |
{table}

The 21.7 nats are by the priors of the code before, whose friction could begin no higher up than the
recordings do, while drag could. That is why it said `unexplained`.
"""


def _without(influence: Found) -> str:
    """What is left without the few that carry it, and without the third that carries most."""
    alarm = influence.get("alarm", influence)
    few = f"{alarm['without_them']:.1f} ({', '.join(alarm['carried_by'])})"
    third = influence["without_a_third"]
    return few if third is None else f"{few}; {third:.1f} (the third that takes most)"


def _answer(one: Found, added: list[str]) -> str:
    tied = [f"`{name}`" for name in one["indistinguishable"]]
    names = " + ".join(f"`{name}`" for name in added)
    return (
        f"`{one['verdict']}`"
        + (f": {names}" if names else "")
        + (f", tied with {', '.join(tied)}" if tied else "")
    )


def _added(one: Found) -> list[str]:
    return [entry["id"] for entry in one["mechanisms"]]


def _leading(law: str, then: Found, now: Found) -> list[str]:
    """The candidates with most evidence now, and the force that is not in the list."""
    candidates = sorted(now["candidates"], key=lambda one: -one["log_bayes_factor"])[:_SHOWN]
    unlisted = now["log_bayes_factors"]["unlisted"]
    shown = [(one["id"], _in_common(one), one["log_bayes_factor"]) for one in candidates]
    before = then["log_bayes_factors"]
    return [
        f"| `{law}` | `{name}` | {before[name]:.1f} | {in_common:.1f} | {factor:.1f} |"
        for name, in_common, factor in [*shown, ("unlisted", unlisted, unlisted)]
    ]


def _candidate(one: Found, name: str) -> Found:
    return next(row for row in one["candidates"] if row["id"] == name)


def _in_common(candidate: Found) -> float:
    """Log Bayes factor with one strength for all avalanches, from how probable that is."""
    before = PRIOR[BetweenEvents.COMMON]
    common = (candidate["strength"].get("ways") or {"common": before})["common"]
    return float(candidate["log_bayes_factor"]) + math.log(common / before)
