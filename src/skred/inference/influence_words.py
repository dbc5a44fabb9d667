"""What an answer hangs on, in words: for the diagnosis, and for predictions that are made from it."""

from __future__ import annotations

from collections.abc import Sequence


def enumerated(names: Sequence[str]) -> str:
    """Names as one says them: ``a``, ``a and b``, ``a, b and c``."""
    return " and ".join(part for part in (", ".join(names[:-1]), *names[-1:]) if part)


def carried(
    carried_by: Sequence[str], n_events: int, with_all: float, without_them: float, needed: float
) -> str:
    """That few avalanches carry an answer; begins with a small letter.

    Parameters
    ----------
    carried_by : sequence of str
        Without these the odds would not suffice for the answer.
    n_events : int
        How many avalanches there are.
    with_all, without_them, needed : float, nats
        Log Bayes factors.
    """
    one, many = len(carried_by) == 1, f"{len(carried_by)} of {n_events} avalanches"
    evidence = f"{with_all:.1f} nats with all, {without_them:.1f} without"
    return (
        f"{many} {'carries' if one else 'carry'} this answer ({enumerated(carried_by)}), and without"
        f" {'it' if one else 'them'} the odds would not suffice for it"
        f" (log Bayes factor {evidence}, {needed:.1f} needed)"
    )
