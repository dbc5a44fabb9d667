"""Which parameters there are, of a run or of all runs, and which of them a view shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from skred.dashboard.each import Failures
from skred.dashboard.reading import Given
from skred.dashboard.view import Asked, ViewKind
from skred.report.explore.run import Run, apart


@dataclass(frozen=True)
class Choice:
    """Some of many parameters.

    Attributes
    ----------
    labels : list of str
        All that could be shown.
    shown : list of str
        Those that are.
    most : int
        How many can be shown at a time.
    """

    labels: list[str]
    shown: list[str]
    most: int


def choice(view: ViewKind, run: Run | None, given: Given, asked: Asked) -> Choice:
    """The parameters that a view shows: those that are asked for, or the first ones."""
    labels = list(common_parameters(given.runs)) if run is None else run.labels_in(*view.drawn_from)
    wanted = frozenset(asked.parameters)
    shown = [label for label in labels if label in wanted] or labels
    return Choice(labels, shown[: view.most_parameters], view.most_parameters)


def common_parameters(
    runs: Sequence[Run], failures: Failures | None = None
) -> dict[str, list[tuple[Run, str]]]:
    """Parameters of all runs, those that most of them have first.

    Parameters
    ----------
    runs : sequence of Run
    failures : Failures, optional
        Takes the runs whose parameters cannot be told.

    Returns
    -------
    dict of lists of (Run, str)
        By a label, the runs that have the parameter and what each calls it. It is the same in two runs if its
        full name, its place and its unit are: what only shortens alike stands apart.
    """
    found: dict[tuple[str, str], list[tuple[Run, str]]] = {}
    for run, rows in (failures or Failures()).of_each(runs, _named):
        for identity, label in rows:
            found.setdefault(identity, []).append((run, label))
    ranked = sorted(found.values(), key=lambda rows: -len(rows))
    return dict(zip(apart([rows[0][1] for rows in ranked]), ranked, strict=True))


def _named(run: Run) -> list[tuple[tuple[str, str], str]]:
    """What each parameter of a run is, in its own right and with its unit, and what the run calls it."""
    rows = zip(run.names, run.identities, run.all_labels, strict=True)
    return [((identity, run.labels[name]), label) for (name, _), identity, label in rows]
