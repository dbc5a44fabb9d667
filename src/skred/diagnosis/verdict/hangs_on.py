"""What the answer hangs on, in words."""

from __future__ import annotations

from skred.diagnosis.influence.influence import Influence, ReadingsLeftOut
from skred.diagnosis.words import MOST_NAMED, counted
from skred.inference import influence_words as words
from skred.inference.influence_words import title_of

_KINDS = {"zeros": ("reading", "of zero"), "near a stop": ("speed", "beside the same avalanche's stop")}


def carried(found: Influence | None, errors: str = "") -> str:
    """That few avalanches carry the answer, where they do; begins with a small letter.

    Parameters
    ----------
    errors : str
        The error model that this is under, where there are several.
    """
    if found is None:
        return ""
    told, n = [], len(found.events)
    rival = found.rival
    if rival is not None and rival.few is not None and rival.few.events == found.carried_by:
        otherwise = words.displaced(title_of(rival.id), rival.ahead, rival.few.left)
        told.append(words.carried(rival.few.events, n, otherwise))
    if found.few is not None:
        otherwise = words.too_little(found.log_bayes_factor, found.few.left, found.needed, errors)
        told.append(
            words.carried(found.few.events, n, otherwise, what="the alarm" if told else "this answer")
        )
    return "; ".join(told)


def hangs_on(found: Influence | None, errors: str = "") -> list[str]:
    """That no few avalanches carry the answer; and without which readings the odds would not suffice.

    Parameters
    ----------
    errors : str
        As for `carried`.
    """
    if found is None:
        return []
    sentences = []
    if not found.carried_by and found.without_a_third >= found.needed:
        under = f"; under {errors} errors" if errors else ""
        evidence = f"{found.without_a_third:.1f} nats ({found.log_bayes_factor:.1f} with all{under})"
        sentences.append(
            "It does not hang on a few avalanches: without the third that carry most of it, its log Bayes"
            f" factor is still {evidence}."
        )
    lost = [one for one in found.readings if one.log_bayes_factor < found.needed]
    lost.sort(key=lambda one: (one.sensor is not None, one.log_bayes_factor))
    if lost:
        named = ", nor without ".join(_words(one) for one in lost[:MOST_NAMED])
        more = len(lost[MOST_NAMED:])
        any_of = "any one of " if more > 1 else ""
        rest = f", nor without those of {any_of}{counted(more, 'further sensor')}" if more else ""
        sentences.append(f"The odds would not suffice for it without {named}{rest}.")
    return sentences


def _words(readings: ReadingsLeftOut) -> str:
    """Some of the readings, and how many they are."""
    what, which = _KINDS.get(readings.kind, ("reading", f"of {readings.sensor}"))
    return f"the {counted(readings.n, what)} {which}"
