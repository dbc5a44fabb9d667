"""What is asked about Ryggfonn, and what the diagnoses answer: drag under M1, the dam, between LC and CD."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from studies.ryggfonn.cells import share_text, where_text

Found = Mapping[str, Any]
DAM_CROWN_M = 1940.0
_NEAR_M = 60.0
_GROWS = {
    "turbulent_drag": "yes",
    "viscous_drag": "yes",
    "segment_drag": "yes",
    "entrainment": "yes",
    "obstacle": "one of its two terms",
    "constant_retardation": "no",
    "segment_friction": "no",
    "velocity_weakening": "no",
    "covariate_friction": "no",
}


def growing(found: Mapping[str, Found]) -> str:
    """Whether what M1 lacks grows with speed."""
    one = found["coulomb"]
    factors = one["log_bayes_factors"]
    names = sorted(_GROWS, key=lambda name: -factors[name])
    table = "".join(f"| `{name}` | {_GROWS[name]} | {factors[name]:.1f} |\n" for name in names)
    named = [one["mechanism"], *one["indistinguishable"]] if one["mechanism"] else []
    grows, does_not = ([name for name in named if _GROWS.get(name) == which] for which in ("yes", "no"))
    if grows and does_not:
        said = f"These recordings do not tell: {_listed(grows)} would, and {_listed(does_not)} would not."
    elif grows or does_not:
        said = f"{'Yes' if grows else 'No'}: {_listed(grows or does_not)}."
    else:
        said = "The diagnosis names nothing that would tell."
    return (
        "## Does M1 lack a drag that grows with speed?\n\n"
        "| candidate | grows with speed | log Bayes factor |\n| --- | --- | --- |\n" + table + "\n"
        f"{said} These are the names that the diagnosis gives, ties included.\n"
    )


def _listed(names: list[str]) -> str:
    return " and ".join(f"`{name}`" for name in names)


def dam(found: Mapping[str, Found]) -> str:
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
        height, share = row["strength"], share_text(found[name]["probability"]["obstacle"])
        rows.append(
            f"| `{name}` | s = {middle:.0f} m | {near} | {height['mean']:.1f} ± {height['sd']:.1f} m |"
            f" {row['log_bayes_factor']:.1f}; {row['log_bayes_factor'] - best:+.1f} | {share} |"
        )
    return (
        "## Did the dam stop the avalanches that rest at it?\n\n"
        "| base | best obstacle | at the dam's crown | height | log Bayes factor against `nothing`; against"
        " the best | probability |\n| --- | --- | --- | --- | --- | --- |\n" + "\n".join(rows) + "\n\n"
    ) + _answer(found)


def between(found: Mapping[str, Found], laws: Sequence[str]) -> str:
    """The missing work between the sensors, where the data's README tells of two groups of retardation."""
    rows = "".join(
        f"| {name} | {row['s_from_m']:.0f}-{row['s_to_m']:.0f} | {found[name]['missing_work_of']} |"
        f" {row['mean']:.0f} ± {row['sd']:.0f} |\n"
        for name in laws
        for row in found[name].get("missing_work", [])
    )
    stretch = _candidate(found["pcm"], "segment_friction")
    said = ""
    if stretch is not None:
        said = (
            f"\nUnder M2 the best friction on a stretch acts at {where_text(stretch['location'])}:"
            f" {stretch['strength']['mean']:.2g} ± {stretch['strength']['sd']:.1g} m/s² beside dry friction"
            " and drag.\n"
        )
    return (
        "## Between LC and CD\n\n"
        "LC and CD are sensors at 1650 and 1810 m. Missing specific work is positive where the law\n"
        "decelerates fronts too little. It is the work of the most probable discrepancy that depends on\n"
        "speed as the first name does.\n\n"
        "| base | s [m] | work on a | missing work [J/kg] |\n| --- | --- | --- | --- |\n" + rows + said
    )


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


def _candidate(one: Found, name: str) -> Found | None:
    return next((row for row in one.get("candidates", []) if row["id"] == name), None)
