"""What the comparison amounts to: every sentence hangs on a number of the same run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from studies.reproduction.cases import LAWS, SHORT, Outcome
from studies.reproduction.facts import bowl_limit, recorded_retardation, start_for_limit
from studies.reproduction.statements import CLOSE, Statement, height_at_limit
from studies.reproduction.study import LC, PAPER, RUNOUT, STOPS_FIT, Study

_NOT_THE_START = ("recordings", "sensor places", "terrain", "priors")
_LATE = "release150"
_NEAR = 0.15
"""Relative distance at which a plain fit is called near the paper's figure."""


def what_we_make_of_it(study: Study, rows: Sequence[Statement]) -> str:
    """The closing section."""
    parts = [_count(rows), _coulomb(study), _constant(study), _pcm(study), _shape(study), _runout(study)]
    return "\n\n".join([*parts, _retardation(study), _stands(study), _LIMITS])


_LIMITS = (
    "**Limits of this comparison.** The paper's track, release points and covariance are not among our"
    " figures; its statements are taken as quoted in our brief, most of them with 'about' or 'near'. The"
    " alternatives are taken one at a time, except the last row of the tables, which was chosen after seeing"
    " the others. That a change moves a number towards the paper's does not prove that its authors made it."
)


def _count(rows: Sequence[Statement]) -> str:
    good = [row for row in rows if row.verdict.startswith("reproduced")]
    rest = "; ".join(row.says for row in rows if row not in good)
    return (
        f"**{len(good)} of {len(rows)} statements are reproduced** by the rule above. Not, or only in part:"
        f" {rest}."
    )


def largest_move(study: Study, law_id: str, number: int, groups: Sequence[str]) -> tuple[float, Outcome]:
    """Largest change of a strength's mean from the baseline over some groups of alternatives.

    Without the stated errors alone (see the tables) and runout alone, which leaves M2 undetermined.
    """
    base = float(study.baseline(law_id).posterior.mean[number])
    chosen = [
        o for o in study.of_law(law_id) if o.case.group in groups and o.case.key not in ("stated", "runout")
    ]
    moved = max(chosen, key=lambda o: abs(float(o.posterior.mean[number]) - base))
    return float(moved.posterior.mean[number]) - base, moved


def _coulomb(study: Study) -> str:
    posterior, target = study.baseline("coulomb").posterior, PAPER["coulomb"][0]
    base = float(posterior.mean[0])
    gap = target - base
    move, which = largest_move(study, "coulomb", 0, _NOT_THE_START)
    limit, _ = bowl_limit(study.base.problem, study.base.mechanisms("coulomb"), 1.5, 0.0)
    height = height_at_limit(study)
    fits = [f for f in study.fits if f.law_id == "coulomb"]
    fit = min(fits, key=lambda f: abs(f.strengths[0] - target))
    text = [f"**M1.** Our a0 is {base:.3f}, the paper's {target}."]
    if height > 0.1:
        text.append(
            f"Ours leans on the largest friction that still passes the bowl ({limit:.4f}), where its"
            f" posterior is cut off at {100 * height:.0f} % of its largest height: its small width is no"
            " merit."
        )
    if abs(move) < 0.5 * abs(gap):
        text.append(
            "Neither Sigma, nor sensor places, smoothing, curvature, the dam or the priors move it far"
            f" enough: the largest move is {move:+.3f} ({which.case.title}), of {gap:+.3f} needed. Nor does a"
            f" plain fit: the nearest, {fit.what}, gives {fit.strengths[0]:.3f}."
        )
    else:
        text.append(f"It moves by {move:+.3f} with: {which.case.title}.")
    return " ".join([*text, *_start(study, gap, base)])


def _start(study: Study, gap: float, base: float) -> list[str]:
    """What the place of the start does to M1, and whether one start fits the paper's two limits."""
    late = study.outcomes[_LATE, "coulomb"]
    if (float(late.posterior.mean[0]) - base) / gap <= 0.5:
        return []
    problem, case = study.base.problem, study.base
    late_m3, _ = bowl_limit(problem, case.mechanisms("constant"), 9.0, 150.0)
    start = start_for_limit(problem, case.mechanisms("constant"), 4.7)
    there, _ = bowl_limit(problem, case.mechanisms("coulomb"), 1.5, start)
    text = [
        f"The start does: from s = 150 m a0 is {late.posterior.mean[0]:.3f}, and M1 reads"
        f" {late.response[LC]:.0f} m/s at LC."
    ]
    if abs(late_m3 / 4.7 - 1) > CLOSE and abs(there / PAPER["coulomb"][0] - 1) > CLOSE:
        text.append(
            f"But from there M3's limit at the bowl is {late_m3:.2f} m/s², not the paper's 4.7; where that is"
            f" 4.70 (s = {start:.0f} m) M1's limit is {there:.3f}. On our track no single start gives both"
            " figures. We do not know what does: another track in or above the bowl, or starts that differ"
            " between avalanches, are candidates."
        )
    return text


def _constant(study: Study) -> str:
    o = study.baseline("constant")
    b, sd = float(o.posterior.mean[0]), float(o.posterior.sd[0])
    dropped = float(study.outcomes["dropped", "constant"].posterior.mean[0])
    start = float(study.outcomes["release50", "constant"].posterior.mean[0])
    text = f"**M3.** Ours is {b:.2f} ± {sd:.2f} m/s², {100 * abs(b / 4.5 - 1):.0f} % from the paper's 4.5."
    if max(dropped, start) < b - sd:
        share = (b - max(dropped, start)) / (b - 4.5)
        text += (
            f" Dropping the incomplete events, which selects the fast ones ({dropped:.2f}), and a start at"
            f" 50 m ({start:.2f}) each close at least {100 * share:.0f} % of the gap."
        )
    return text


def _pcm(study: Study) -> str:
    mean, paper = study.baseline("pcm").posterior.mean, np.array(PAPER["pcm"])
    fit = study.speeds_fit("pcm")
    others = {law: float(study.speeds_fit(law)[0]) for law in ("coulomb", "constant")}
    text = [
        f"**M2.** Ours is a0 {mean[0]:.3f}, a2 {1e3 * mean[1]:.2f}e-3 1/m; the paper's 0.2 and 3e-3.",
        f"Least squares of the three plain mean speeds gives {fit[0]:.3f} and {1e3 * fit[1]:.2f}e-3 1/m.",
    ]
    if np.all(np.abs(fit / paper - 1) <= _NEAR):
        text.append(
            f"That is within {100 * _NEAR:.0f} % of the paper's, whose priors came from an optimisation on"
            " the same recordings: such a fit would be enough to explain M2's figures."
        )
        if all(abs(others[law] / PAPER[law][0] - 1) > 0.04 for law in others):
            text.append(
                f"It is no explanation of all three laws: the same fit gives M1 {others['coulomb']:.3f} and"
                f" M3 {others['constant']:.2f} m/s², no nearer to the paper's than our posteriors."
                if all(
                    abs(others[law] - PAPER[law][0])
                    > 0.95 * abs(float(study.baseline(law).posterior.mean[0]) - PAPER[law][0])
                    for law in others
                )
                else "It does not explain the other two laws."
            )
    stops = study.speeds_fit("pcm", STOPS_FIT)
    if stops[0] > fit[0] + 0.5 * abs(float(mean[0]) - fit[0]):
        text.append(
            "The avalanches that did not arrive, which a plain mean leaves out, are enough to part our"
            f" posterior from that fit: with the stops counted it gives {stops[0]:.3f} and"
            f" {1e3 * stops[1]:.2f}e-3 1/m, on the other side of ours."
            if stops[0] > mean[0]
            else "Counting the avalanches that did not arrive moves that fit towards our posterior:"
            f" {stops[0]:.3f} and {1e3 * stops[1]:.2f}e-3 1/m."
        )
    move, which = largest_move(study, "pcm", 0, _NOT_THE_START)
    start, _ = largest_move(study, "pcm", 0, ("release",))
    text.append(f"The largest move of a0 among the alternatives is {move:+.3f} ({which.case.title});")
    forgets = abs(start) < 0.005
    text.append(
        "the start does not matter, since drag makes a front forget where it started."
        if forgets
        else f"the start moves it by {start:+.3f}."
    )
    return " ".join(text)


def _shape(study: Study) -> str:
    base = study.baseline("pcm").posterior
    diagonal = study.outcomes["diagonal", "pcm"].posterior
    several = [o.case.title for o in study.of_law("pcm") if len(o.posterior.modes) > 1]
    text = [
        f"**The shape of (a0, a2).** Ours has {len(base.modes)} mode(s), correlation {base.correlation:+.2f}."
    ]
    if abs(diagonal.correlation) > abs(base.correlation) + 0.3:
        text.append(
            "Without the correlation of the readings in Sigma it becomes a ridge (correlation"
            f" {diagonal.correlation:+.2f}) on which friction and drag stand in for each other: the"
            " recordings' own correlation is what separates the two."
        )
    if several:
        text.append(f"Several modes appear with: {'; '.join(several)}.")
    if len(base.modes) == 1 and several:
        text.append(
            "So a posterior as the paper describes it is within reach of another likelihood; it is not a"
            " property of the recordings alone."
        )
    return " ".join(text)


def _runout(study: Study) -> str:
    recorded = study.plain_mean[RUNOUT]
    off = {law: float(study.baseline(law).response[RUNOUT] - recorded) for law in LAWS}
    sd = {law: float(study.baseline(law).response_sd[RUNOUT]) for law in LAWS}
    best, least = min(LAWS, key=lambda law: abs(off[law])), min(LAWS, key=lambda law: sd[law])
    listed = ", ".join(f"{SHORT[law]} {off[law]:+.0f} ± {sd[law]:.0f} m" for law in LAWS)
    text = (
        f"**Runout.** Recorded mean against the laws': {listed}. Nearest is {SHORT[best]}, least uncertain"
        f" {SHORT[least]}."
    )
    spread = float(np.sqrt(study.base.problem.covariance[RUNOUT, RUNOUT]))
    se = spread / np.sqrt(study.base.problem.campaign.n_events)
    if all(abs(value) < 2 * np.hypot(se, sd[law]) for law, value in off.items()):
        text += (
            f" The recorded mean itself is known to ± {se:.0f} m and single runouts scatter by {spread:.0f}"
            " m: the recordings cannot settle this order of the laws."
        )
    return text


def _retardation(study: Study) -> str:
    r = recorded_retardation(study.base.problem, "LC", "b")
    shifted = [
        recorded_retardation(study.base.problem, "LC", "b", a, b).mean for a in (-40, 40) for b in (-5, 5)
    ]
    text = f"**Mean retardation from LC to the dam's foot.** {r.mean:.2f} m/s² against the paper's -4.6."
    if max(shifted) < -4.6:
        text += (
            " The sensors' places, moved within their uncertainty, do not close the gap"
            f" ({max(shifted):.2f} at best); a smaller drop between them would, as from snow in front of the"
            " dam or another profile. We do not know which."
        )
    return text


def _stands(study: Study) -> str:
    """Which law has the larger evidence, whatever is changed."""
    differences = {
        (case.title, SHORT[law]): study.outcomes[case.key, "pcm"].posterior.log_evidence
        - study.outcomes[case.key, law].posterior.log_evidence
        for case in study.cases
        for law in LAWS
        if law != "pcm"
    }
    (title, law), least = min(differences.items(), key=lambda item: item[1])
    if least <= 0:
        return (
            f"**What does not stand:** with '{title}', {law} has more evidence than M2 ({-least:.1f} nats)."
        )
    clear = sum(value > 3 for value in differences.values())
    return (
        f"**What stands:** M2 has the largest evidence of the three laws in every row, by more than 3 nats in"
        f" {clear} of {len(differences)} comparisons; the least is {least:.1f} nats over {law} ({title})."
    )
