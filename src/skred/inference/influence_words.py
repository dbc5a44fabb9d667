"""What an answer hangs on, in words: for the diagnosis, and for predictions that are made from it."""

from __future__ import annotations

from collections.abc import Sequence

from skred.physics.mechanisms import mechanisms

NOT_LISTED = "unlisted"
ERRS_BY = 1.0
"""Nats that what is left without some avalanches errs by, as the shapes that were looked at are kept."""


def enumerated(names: Sequence[str]) -> str:
    """Names as one says them: ``a``, ``a and b``, ``a, b and c``."""
    return " and ".join(part for part in (", ".join(names[:-1]), *names[-1:]) if part)


def title_of(name: str) -> str:
    """An id in words, without examples: recordings of speeds do not show whether it is ice or bare ground."""
    if name == NOT_LISTED:
        return "a force not in the list"
    known = mechanisms()
    return known[name].title.partition(":")[0] if name in known else str(name)


def carried(carried_by: Sequence[str], n_events: int, otherwise: str, what: str = "this answer") -> str:
    """That few avalanches carry an answer; begins with a small letter.

    Parameters
    ----------
    carried_by : sequence of str
        Without these the answer would not be given.
    n_events : int
        How many avalanches there are.
    otherwise : str
        What would be without them: `too_little` or `displaced`.
    what : str
        What they carry.
    """
    one, many = len(carried_by) == 1, f"{len(carried_by)} of {n_events} avalanches"
    return (
        f"{many} {'carries' if one else 'carry'} {what} ({enumerated(carried_by)}), and without"
        f" {'it' if one else 'them'} {otherwise}"
    )


def too_little(with_all: float, without_them: float, needed: float, errors: str = "") -> str:
    """That odds would not suffice, by log Bayes factors in nats under an error model if there are several."""
    under = f" under {errors} errors" if errors else ""
    evidence = f"{with_all:.1f} nats with all, {without_them:.1f} without, {needed:.1f} needed"
    return f"the odds would not suffice for it (log Bayes factor{under} {evidence})"


def _probable_as(without_them: float) -> str:
    """How probable a rival would be that an answer is so many nats ahead of without some avalanches."""
    return "more probable" if without_them < -ERRS_BY else "about as probable"


def displaced(rival: str, ahead: float, without_them: float) -> str:
    """That something else would be as probable, or more so.

    Parameters
    ----------
    rival : str
        What.
    ahead, without_them : float
        Nats of its log Bayes factor that the answer can lose against it, by all recordings and without some.
    """
    evidence = f"{ahead:.1f} nats behind with all, {-without_them:.1f} ahead without"
    return f"{rival} would be {_probable_as(without_them)} ({evidence})"
