"""Which runs can be compared: those that predict the same observations in the same way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from skred.report.explore.run import Run


@dataclass(frozen=True, eq=False)
class Comparable:
    """Runs, sorted by what they predict.

    Attributes
    ----------
    sets : list of list of Run
        Two or more runs of the same observations with the same likelihood.
    others : list of (Run, str)
        Runs that are compared with none, and why.
    """

    sets: list[list[Run]]
    others: list[tuple[Run, str]]


def comparable(runs: Sequence[Run]) -> Comparable:
    """Sort runs into sets that can be compared; the curves of a diagnosis are no run with a likelihood."""
    sets: dict[tuple[str, ...], list[Run]] = {}
    others = []
    calibrated = [run for run in runs if run.kind != "diagnosis"]
    for run in calibrated:
        why = _why_never(run)
        if why:
            others.append((run, why))
        else:
            sets.setdefault(_predicts(run), []).append(run)
    alone = [of for of in sets.values() if len(of) == 1]
    others += [(run, _why_alone(run, calibrated)) for (run,) in alone]
    return Comparable([of for of in sets.values() if len(of) > 1], sorted(others, key=lambda o: o[0].number))


def _predicts(run: Run) -> tuple[str, ...]:
    """What a run predicts, and how: its observations, its likelihood and what can be left out."""
    fingerprint = str(run.tree.attrs.get("campaign_fingerprint", ""))
    return (fingerprint, run.observations, *_likelihood(run), *run.event_ids)


def _likelihood(run: Run) -> tuple[str, ...]:
    return (str(run.tree.attrs.get("likelihood", "")), str(run.likelihood_name))


def _why_never(run: Run) -> str:
    """Why a run can be compared with no other; empty where it can."""
    if run.likelihood_name is None:
        return "it has no log likelihood of each observation (group log_likelihood)"
    if not run.can_leave_out:
        return "leaving out its observations cannot be computed"
    if not run.observations:
        return "it does not say what was observed (group observed_data)"
    return ""


def _why_alone(run: Run, runs: Sequence[Run]) -> str:
    """Why no other run predicts the same."""
    same = [one for one in runs if one is not run and one.observations == run.observations]
    if not same:
        return "no other run has the same observations"
    if all(_likelihood(one) != _likelihood(run) for one in same):
        return "runs of the same observations have another likelihood"
    return "runs of the same observations leave out other parts of them"
