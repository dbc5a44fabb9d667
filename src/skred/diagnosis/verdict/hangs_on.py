"""What the answer hangs on, in words."""

from __future__ import annotations

from skred.diagnosis.influence.influence import Influence, ReadingsLeftOut
from skred.diagnosis.words import enumerated

_KINDS = {"zeros": "readings of zero", "near a stop": "speeds beside the same avalanche's stop"}


def carried(found: Influence | None) -> str:
    """That few avalanches carry the answer, where they do; begins with a small letter."""
    if found is None or not found.carried_by:
        return ""
    one, many = len(found.carried_by) == 1, f"{len(found.carried_by)} of {len(found.events)} avalanches"
    evidence = f"{found.log_bayes_factor:.1f} nats with all, {found.without_them:.1f} without"
    return (
        f"{many} {'carries' if one else 'carry'} this answer ({enumerated(found.carried_by)}), and without"
        f" {'it' if one else 'them'} it would not be given (log Bayes factor {evidence}, {found.needed:.1f}"
        " needed)"
    )


def hangs_on(found: Influence | None) -> list[str]:
    """That no few avalanches carry the answer; and which kinds of readings it would not be given without."""
    if found is None:
        return []
    sentences = []
    if found.without_a_third is not None:
        evidence = f"{found.without_a_third:.1f} nats ({found.log_bayes_factor:.1f} with all)"
        sentences.append(
            "It does not hang on a few avalanches: without the third that carry most of it, its log Bayes"
            f" factor is still {evidence}."
        )
    lost = [_words(one) for one in found.readings if one.log_bayes_factor < found.needed]
    if lost:
        sentences.append(f"It would not be given without {' or without '.join(lost)}.")
    return sentences


def _words(readings: ReadingsLeftOut) -> str:
    """Some of the readings, and how many they are."""
    return f"{_KINDS.get(readings.kind, f'the readings of {readings.sensor}')} ({readings.n})"
