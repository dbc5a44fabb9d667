"""The paper's statements, each with its figure, ours, a verdict and what moves it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from studies.reproduction.cases import LAWS, SHORT, Outcome
from studies.reproduction.facts import (
    bowl_limit,
    correlation,
    modelled_retardation,
    recorded_retardation,
    response,
    retardation_at,
    start_for_limit,
    start_for_runout,
)
from studies.reproduction.study import LC, PAPER, RUNOUT, Study

CLOSE = 0.05
"""Largest relative difference that still counts as 'about'."""
TAIL = (0.05, 0.95)
LC_STRETCH_M = (-350.0, -230.0)
"""Tower to wedge, relative to the crown: what 'near LC' is taken to mean."""


@dataclass(frozen=True)
class Statement:
    """One row: what the paper says, its figure, ours, verdict, and what could explain a difference."""

    says: str
    paper: str
    ours: str
    verdict: str
    moves: str


def judge(paper: float, ours: float, sd: float, interval: tuple[float, float] | None = None) -> str:
    """Verdict on a number: by our 90 % interval, or else by the relative difference.

    Parameters
    ----------
    paper, ours : float
    sd : float
        Posterior standard deviation of ours; 0 for a number without one.
    interval : (float, float), optional
        90 % posterior interval of ours.
    """
    relative = abs(ours - paper) / abs(paper)
    if interval is not None and interval[0] <= paper <= interval[1]:
        return "reproduced"
    apart = f", {abs(ours - paper) / sd:.1f} of our posterior sd" if sd > 0 else ""
    if relative <= CLOSE:
        return f"reproduced to {100 * relative:.1f} %{apart}"
    return f"differs by {ours - paper:+.2g} ({100 * relative:.0f} %{apart})"


def statements(study: Study) -> list[Statement]:
    """All of them, in the order of the brief."""
    rows = [*_bowl(study), *_coulomb(study), _constant(study), *_pcm(study), _shape(study)]
    return [*rows, _mean_at_lc(study), *_runout(study), _correlated(study), _mean_retardation(study)]


def nearest(study: Study, law_id: str, number: int) -> tuple[Outcome, Outcome, Outcome]:
    """Outcomes with the smallest and largest mean of a strength, and the one nearest to the paper's.

    Without the stated errors alone, which is shown to be no usable likelihood.
    """
    usable = [o for o in study.of_law(law_id) if o.case.key != "stated"]
    by_mean = sorted(usable, key=lambda o: float(o.posterior.mean[number]))
    target = PAPER[law_id][number]
    closest = min(usable, key=lambda o: abs(float(o.posterior.mean[number]) - target))
    return by_mean[0], by_mean[-1], closest


def _range_text(study: Study, law_id: str, number: int, factor: float = 1.0, decimals: int = 3) -> str:
    low, high, closest = nearest(study, law_id, number)

    def value(o: Outcome) -> str:
        return f"{factor * float(o.posterior.mean[number]):.{decimals}f}"

    return (
        f"alternatives give {value(low)} ({low.case.title}) to {value(high)} ({high.case.title});"
        f" nearest to the paper: {value(closest)} ({closest.case.title})"
    )


def _interval(o: Outcome, number: int) -> tuple[float, float]:
    low, high = o.posterior.quantiles(number, TAIL)
    return float(low), float(high)


def height_at_limit(study: Study) -> float:
    """Density of M1's posterior at the bowl's limit, relative to its largest."""
    posterior = study.baseline("coulomb").posterior
    limit, _ = bowl_limit(study.base.problem, study.base.mechanisms("coulomb"), 1.5, 0.0)
    (axis,) = posterior.axes
    last = max(int(np.searchsorted(axis, limit)) - 1, 0)
    return float(posterior.weights[last] / posterior.weights.max())


def _bowl(study: Study) -> list[Statement]:
    base = study.base
    mechanisms, high = base.mechanisms("constant"), 9.0
    at = {s: bowl_limit(base.problem, mechanisms, high, s) for s in (0.0, 50.0, 100.0)}
    limit, readings = at[0.0]
    starts = ", ".join(f"{at[s][0]:.2f} from s = {s:.0f} m" for s in at)
    speeds = ", ".join(f"{r[LC]:.1f} m/s from s = {s:.0f} m" for s, (_, r) in at.items())
    at_paper = float(response(base.problem, mechanisms, [4.7], 0.0)[LC])
    start = start_for_limit(base.problem, mechanisms, 4.7)
    there = float(bowl_limit(base.problem, mechanisms, high, start)[1][LC])
    return [
        Statement(
            "a3 must stay below a limit for the front to pass the bowl",
            "4.7 m/s²",
            f"{limit:.3f} m/s²",
            judge(4.7, limit, 0.0),
            f"the start decides: {starts}; 4.70 from s = {start:.0f} m",
        ),
        Statement(
            "speed at LC with a3 at that limit",
            "about 30 m/s",
            f"{readings[LC]:.1f} m/s at our limit, {at_paper:.1f} m/s at 4.7 m/s²",
            f"at our limit {judge(30.0, readings[LC], 0.0)}; at 4.7 m/s² {judge(30.0, at_paper, 0.0)}",
            f"at the limit it is {speeds}; {there:.1f} m/s from s = {start:.0f} m, where the limit is 4.70",
        ),
    ]


def _coulomb(study: Study) -> list[Statement]:
    base, o = study.base, study.baseline("coulomb")
    mechanisms, problem = base.mechanisms("coulomb"), base.problem
    limit, _ = bowl_limit(problem, mechanisms, 1.5, 0.0)
    paper_run = response(problem, mechanisms, PAPER["coulomb"], 0.0)
    start = start_for_runout(problem, mechanisms, PAPER["coulomb"][0], study.plain_mean[RUNOUT])
    recorded = study.plain_mean[LC]
    excess = float(o.response[LC] - recorded)
    se = float(np.sqrt(problem.covariance[LC, LC] / problem.campaign.n_events))
    at_start = bowl_limit(problem, base.mechanisms("constant"), 9.0, start)[0]
    return [
        Statement(
            "M1: a0",
            "about 0.47",
            f"{o.posterior.mean[0]:.4f} ± {o.posterior.sd[0]:.4f}",
            judge(0.47, o.posterior.mean[0], o.posterior.sd[0], _interval(o, 0)),
            f"{_range_text(study, 'coulomb', 0)}. The bowl's limit is {limit:.4f}."
            f" From"
            f" s = 0, a0 = 0.47 runs {paper_run[RUNOUT] - study.plain_mean[RUNOUT]:.0f} m beyond the"
            f" recorded"
            f" mean; no front with it stops short of the mean unless it starts at s = {start:.0f} m or"
            f" lower,"
            f" where M3's limit would be {at_start:.2f} m/s²",
        ),
        Statement(
            "M1 over-predicts LC considerably",
            "considerably",
            f"{o.response[LC]:.1f} ± {o.response_sd[LC]:.1f} m/s against {recorded:.1f} ± {se:.1f} recorded",
            f"{'reproduced' if excess > 2 * se else 'only in sign' if excess > 0 else 'not reproduced'}:"
            f" {excess:+.1f} m/s, {excess / se:+.1f} standard errors of the recorded mean",
            f"a0 = 0.47 on our track: {paper_run[LC]:.1f} m/s, {paper_run[LC] - recorded:+.1f} m/s",
        ),
        _retardation(study, "coulomb", -4.0),
    ]


def stretch_retardation(study: Study, law_id: str) -> tuple[float, float, float]:
    """Posterior mean and sd of a_ret over the stretch near LC, and a_ret with the paper's strengths."""
    o, problem = study.baseline(law_id), study.base.problem
    places = [study.crown_m + d for d in LC_STRETCH_M]
    mechanisms = study.base.mechanisms(law_id)
    nodes, weights = o.posterior.nodes, o.posterior.node_weights
    # Speeds of 10^5 fronts at every cell would not fit: the cells that hold all but 1e-4 will do.
    order = np.argsort(-weights)[:20_000]
    values = modelled_retardation(problem, mechanisms, nodes[order], *places)
    share = weights[order] / weights[order].sum()
    mean = float(share @ values)
    sd = float(np.sqrt(share @ (values - mean) ** 2))
    paper = modelled_retardation(problem, mechanisms, np.array([PAPER[law_id]]), *places)
    return mean, sd, float(paper[0])


def _retardation(study: Study, law_id: str, paper: float) -> Statement:
    mean, sd, with_paper = stretch_retardation(study, law_id)
    o, problem = study.baseline(law_id), study.base.problem
    place = study.crown_m + 0.5 * sum(LC_STRETCH_M)
    friction, *drag = o.posterior.mean
    at_point = retardation_at(problem, friction, drag[0] if drag else 0.0, o.response[LC], place)
    straight = retardation_at(problem, PAPER[law_id][0], 0.0, 0.0, place)
    extra = f"; its a0 without curvature and drag {straight:.2f}" if law_id == "coulomb" else ""
    return Statement(
        f"{SHORT[law_id]}: retardation near LC",
        f"about {paper} m/s²",
        f"{mean:.2f} ± {sd:.2f} m/s² from tower to wedge; {at_point:.2f} in the cell at LC",
        judge(paper, mean, sd, (mean - 1.645 * sd, mean + 1.645 * sd)),
        f"the paper's strengths on our track: {with_paper:.2f} m/s² over the same stretch{extra}",
    )


def _constant(study: Study) -> Statement:
    o = study.baseline("constant")
    return Statement(
        "M3: retardation",
        "about -4.5 m/s²",
        f"-{o.posterior.mean[0]:.3f} ± {o.posterior.sd[0]:.3f} m/s²",
        judge(4.5, o.posterior.mean[0], o.posterior.sd[0], _interval(o, 0)),
        _range_text(study, "constant", 0) + " (m/s², positive as a3)",
    )


def _pcm(study: Study) -> list[Statement]:
    o = study.baseline("pcm")
    mean, sd = o.posterior.mean, o.posterior.sd
    a0, a2 = study.speeds_fit("pcm")
    fitted = f"; least squares of the plain mean speeds: a0 {a0:.3f}, a2 {1e3 * a2:.2f}e-3 1/m"
    return [
        Statement(
            "M2: a0",
            "near 0.2",
            f"{mean[0]:.3f} ± {sd[0]:.3f}",
            judge(0.2, mean[0], sd[0], _interval(o, 0)),
            _range_text(study, "pcm", 0) + fitted,
        ),
        Statement(
            "M2: a2",
            "near 3e-3 1/m",
            f"({1e3 * mean[1]:.2f} ± {1e3 * sd[1]:.2f})e-3 1/m",
            judge(3e-3, mean[1], sd[1], _interval(o, 1)),
            _range_text(study, "pcm", 1, 1e3, 2) + " (1e-3 1/m)",
        ),
        _retardation(study, "pcm", -4.7),
    ]


def _shape(study: Study) -> Statement:
    def shape(o: Outcome) -> str:
        p = o.posterior
        return f"{len(p.modes)} mode(s), correlation {p.correlation:+.2f}, bend {p.bend:.3f}"

    base = study.baseline("pcm")
    several = [o for o in study.of_law("pcm") if len(o.posterior.modes) > 1]
    bent = max(study.of_law("pcm"), key=lambda o: o.posterior.bend)
    steepest = max(study.of_law("pcm"), key=lambda o: abs(o.posterior.correlation))
    bimodal = "; ".join(f"{o.case.title}: {shape(o)}" for o in several) or "none"
    reproduced = len(base.posterior.modes) > 1 or base.posterior.bend > 0.05
    return Statement(
        "M2: (a0, a2) bimodal or non-linear",
        "bimodal, non-linear",
        shape(base),
        "reproduced"
        if reproduced
        else "not reproduced in the baseline"
        + (f"; {len(several)} alternative(s) have several modes" if several else ""),
        f"several modes with {bimodal}. Strongest correlation {steepest.posterior.correlation:+.2f}"
        f" ({steepest.case.title}); strongest bend {bent.posterior.bend:.3f} ({bent.case.title})",
    )


def _mean_at_lc(study: Study) -> Statement:
    o, problem = study.baseline("pcm"), study.base.problem
    recorded = float(study.plain_mean[LC])
    se = float(np.sqrt(problem.covariance[LC, LC] / problem.campaign.n_events))
    paper_run = response(problem, study.base.mechanisms("pcm"), PAPER["pcm"], 0.0)
    off = float(o.response[LC] - recorded)
    return Statement(
        "M2 hits the recorded mean at LC",
        "hits",
        f"{o.response[LC]:.1f} ± {o.response_sd[LC]:.1f} m/s against {recorded:.1f} ± {se:.1f} recorded",
        f"{'reproduced' if abs(off) <= se else 'not reproduced'}: {off:+.1f} m/s",
        f"the paper's strengths on our track: {paper_run[LC]:.1f} m/s",
    )


def _runout(study: Study) -> list[Statement]:
    recorded = float(study.plain_mean[RUNOUT])
    problem, crown = study.base.problem, study.crown_m

    def off(o: Outcome) -> float:
        return abs(float(o.response[RUNOUT]) - recorded)

    base = {law: study.baseline(law) for law in LAWS}
    holds: Callable[[str], bool] = lambda key: all(  # noqa: E731
        off(study.outcomes[key, law]) < off(study.outcomes[key, "constant"]) for law in ("coulomb", "pcm")
    )
    where = [case.title for case in study.cases if case.key != "dam" and holds(case.key)]
    sds = {law: float(o.response_sd[RUNOUT]) for law, o in base.items()}
    least = min(sds, key=lambda law: sds[law])
    runs = {law: response(problem, study.base.mechanisms(law), PAPER[law], 0.0)[RUNOUT] for law in LAWS}
    listed = ", ".join(f"{SHORT[law]} {o.response[RUNOUT] - crown:+.0f} m" for law, o in base.items())
    of_paper = ", ".join(f"{SHORT[law]} {value - crown:+.0f} m" for law, value in runs.items())
    second = min((law for law in LAWS if law != "coulomb"), key=lambda law: sds[law])
    return [
        Statement(
            "runout: M1 and M2 closer to the recorded mean than M3",
            "M1, M2 closer",
            f"{listed}; recorded {recorded - crown:+.0f} m (from the crown)",
            "reproduced" if holds(study.base.key) else "not reproduced",
            f"holds under {len(where)} of {len(study.cases) - 2} alternatives on this track"
            f"{' (' + '; '.join(where) + ')' if where else ''}. The paper's strengths on our track:"
            f" {of_paper}",
        ),
        Statement(
            "runout: M2 least uncertain",
            "M2",
            ", ".join(f"{SHORT[law]} ± {sd:.0f} m" for law, sd in sds.items()),
            "reproduced" if least == "pcm" else f"not reproduced: {SHORT[least]}",
            f"uncertainty of the mean response, not of the next avalanche. At the bowl's limit M1's posterior"
            f" has {100 * height_at_limit(study):.0f} % of its largest height and ends; of the other two,"
            f" {SHORT[second]} is the less uncertain",
        ),
    ]


def _correlated(study: Study) -> Statement:
    matrix = correlation(study.base.problem)
    speeds = matrix[:3, :3][np.triu_indices(3, 1)]
    return Statement(
        "observed speeds are correlated",
        "correlated",
        f"correlations {speeds.min():.2f} to {speeds.max():.2f} (LC-CD, LC-b, CD-b: "
        + ", ".join(f"{value:.2f}" for value in speeds)
        + ")",
        "reproduced" if speeds.min() > 0.5 else "not reproduced",
        "what leaving the correlation out does: row 'variances only' of the tables",
    )


def _mean_retardation(study: Study) -> Statement:
    problem = study.base.problem
    here = recorded_retardation(problem, "LC", "b")
    shifted = [recorded_retardation(problem, "LC", "b", a, b).mean for a in (-40, 40) for b in (-5, 5)]
    lower = recorded_retardation(problem, "CD", "b")
    se = here.sd / np.sqrt(len(here.values))
    same = abs(here.mean + 4.6) <= 2 * se
    overlap = "; the spreads overlap" if abs(here.mean + 4.6) < 0.8 + here.sd else ""
    needed = -(here.mean + 4.6) * here.length_m / 9.81
    return Statement(
        "mean retardation from LC to the dam's foot",
        "-4.6 ± 0.8 m/s²",
        f"{here.mean:.2f} ± {here.sd:.2f} m/s² ({len(here.values)} events; standard error {se:.2f})",
        f"{'within two standard errors' if same else 'not reproduced'}: {here.mean + 4.6:+.2f} m/s²,"
        f" {100 * abs(here.mean / -4.6 - 1):.0f} %{overlap}",
        f"sensor places within their uncertainty: {min(shifted):.2f} to {max(shifted):.2f} m/s², so they do"
        f" {'' if max(shifted) >= -4.6 else 'not '}explain it; a fall of the track smaller by"
        f" {needed:.0f} m of"
        f" {here.drop_m:.0f} m would; from CD to the foot alone it is {lower.mean:.2f} ± {lower.sd:.2f}"
        f" m/s²",
    )
