"""A trial's truth beside an answer to it, and what the two say of each other."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from skred.prove.scoring.standards import TIES, Tie

ALARMS = ("missing_physics", "instrument", "unexplained")
"""Verdicts that say that something is off."""
FAILURES = ("crash", "timeout")
NULLS = ("nothing", "nasty")
"""Trials in which nothing is hidden."""
NOTHING, UNLISTED = "nothing", "unlisted"


@dataclass(frozen=True)
class Pair:
    """A trial's truth and an answer to it.

    Attributes
    ----------
    trial : str
    truth, answer : mapping
        Plain data; the answer of a method that gave none is a crash.
    """

    trial: str
    truth: Mapping[str, Any]
    answer: Mapping[str, Any]

    @property
    def kind(self) -> str:
        """Sparse or dense."""
        return str(self.truth["kind"])

    @property
    def hidden(self) -> str:
        """Class of what is hidden."""
        return str(self.truth["hidden"])

    @property
    def is_null(self) -> bool:
        """Whether nothing is hidden."""
        return self.hidden in NULLS

    @property
    def is_listed(self) -> bool:
        """Whether all that is hidden is in the list: one or two mechanisms, or a fault of the instruments."""
        return bool(self.hidden_effects) and all(one["listed"] for one in self.hidden_effects)

    @property
    def hidden_effects(self) -> Sequence[Mapping[str, Any]]:
        """What is hidden, as the truth records it."""
        return list(self.truth["mechanisms"])

    @property
    def true_ids(self) -> set[str]:
        """Ids of what is hidden."""
        return {str(one["id"]) for one in self.hidden_effects}

    @property
    def snr(self) -> float:
        """Signal-to-noise."""
        return float(self.truth["snr"])

    @property
    def verdict(self) -> str:
        """The verdict; a crash where there is none."""
        return str(self.answer.get("verdict", "crash"))

    @property
    def failed(self) -> bool:
        """Whether there is no verdict because of a crash or the time limit."""
        return self.verdict in FAILURES

    @property
    def alarm(self) -> bool:
        """Whether the verdict says that something is off."""
        return self.verdict in ALARMS

    @property
    def name(self) -> str | None:
        """The leading name, where one is given."""
        name = self.answer.get("mechanism")
        return str(name) if self.alarm and name else None

    @property
    def names(self) -> list[str]:
        """The leading name and those it is tied with."""
        return [self.name, *map(str, self.answer.get("indistinguishable") or ())] if self.name else []

    @property
    def named_alone(self) -> bool:
        """Whether a single name is given, without ties."""
        return len(self.names) == 1

    @property
    def right_name(self) -> bool:
        """Whether the leading name is hidden."""
        return self.name in self.true_ids

    @property
    def right_set(self) -> bool:
        """Whether one of the names is hidden; what is in no list is held by `unlisted` as one of a tie."""
        hidden = self.true_ids | {UNLISTED for one in self.hidden_effects if not one["listed"]}
        return bool(hidden & set(self.names))

    @property
    def right_class(self) -> bool:
        """Whether the leading name is hidden, or permanently tied with what is."""
        return self.right_name or any(self._tied(one) for one in self.hidden_effects)

    @property
    def stated_stretch(self) -> tuple[float, float] | None:
        """The stretch that the answer blames [m]."""
        return stretch(self.answer.get("location")) if self.alarm else None

    @property
    def true_stretches(self) -> list[tuple[float, float]]:
        """Where what is hidden acts [m], as far as it is local."""
        return [place for one in self.hidden_effects if (place := stretch(one)) is not None]

    @property
    def place_error_m(self) -> float | None:
        """Distance between the middles of the stated stretch and the nearest true one [m]."""
        stated = self.stated_stretch
        if stated is None or not self.true_stretches:
            return None
        return min(abs(middle(one) - middle(stated)) for one in self.true_stretches)

    def _tied(self, hidden: Mapping[str, Any]) -> bool:
        """Whether the leading name and one of what is hidden are a permanent tie here."""
        return any(
            self.name in tie.ids and hidden["id"] in tie.ids and self._holds(tie, hidden) for tie in TIES
        )

    def _holds(self, tie: Tie, hidden: Mapping[str, Any]) -> bool:
        """Whether a tie's conditions hold."""
        true, stated = stretch(hidden), self.stated_stretch
        if tie.kind is not None and self.kind != tie.kind:
            return False
        if tie.same_stretch and (true is None or stated is None or overlap_m(true, stated) <= 0.0):
            return False
        if tie.short_m is not None:
            drag = true if hidden["id"] == "segment_drag" else stated if self.name == "segment_drag" else None
            return drag is None or drag[1] - drag[0] <= tie.short_m
        return True

    def number(self, *keys: str) -> float | None:
        """A finite number of the answer at a path of keys; None where there is none."""
        return finite(at(self.answer, *keys))

    @property
    def probability(self) -> dict[str, float]:
        """Stated probability of each id; empty where none is stated."""
        stated = self.answer.get("probability")
        if self.failed or not isinstance(stated, Mapping):
            return {}
        numbers = {str(name): finite(value) for name, value in stated.items()}
        return {name: value for name, value in numbers.items() if value is not None}

    @property
    def probable_ids(self) -> set[str]:
        """The ids whose probability should be high."""
        if self.is_null:
            return {NOTHING}
        return {one["id"] if one["listed"] else UNLISTED for one in self.hidden_effects}


def at(document: Any, *keys: str) -> Any:
    """Value at a path of keys; None where any part of it is absent."""
    for key in keys:
        document = document.get(key) if isinstance(document, Mapping) else None
    return document


def finite(value: Any) -> float | None:
    """A finite number; None for anything else."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        return None
    return float(value)


def stretch(place: Any) -> tuple[float, float] | None:
    """The stretch of an effect or a location [m]; None where it is not local."""
    first, last = finite(at(place, "s_from_m")), finite(at(place, "s_to_m"))
    return None if first is None or last is None else (first, last)


def middle(place: tuple[float, float]) -> float:
    """Middle of a stretch [m]."""
    return 0.5 * (place[0] + place[1])


def overlap_m(one: tuple[float, float], other: tuple[float, float]) -> float:
    """Length that two stretches share [m]; negative is the gap between them."""
    return min(one[1], other[1]) - max(one[0], other[0])


def pairs_of(trials: Sequence[Mapping[str, Any]], answers: Mapping[str, Mapping[str, Any]]) -> list[Pair]:
    """Each trial with its answer; a trial without one has crashed."""
    return [
        Pair(str(one["trial"]), one["truth"], answers.get(one["trial"]) or {"verdict": "crash"})
        for one in trials
    ]


def within(pairs: Sequence[Pair], snr: tuple[float, float]) -> list[Pair]:
    """Pairs whose signal-to-noise lies in a range, its upper end left out."""
    return [pair for pair in pairs if snr[0] <= pair.snr < snr[1]]
