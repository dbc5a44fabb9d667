"""The first paragraph of a comparison, for readers who know avalanches and no statistics."""

from __future__ import annotations

from collections.abc import Sequence

from skred.report.shared.document import Document, failed, get, listed, ranked
from skred.report.shared.labels import printable
from skred.report.shared.numbers import counted, is_number

_OTHER_SCORES = {
    "loo": "predictions of avalanches left out without a refit",
    "waic": "WAIC",
    "evidence": "evidence",
}
"""Scores beside that which decides, in words."""


def lay_words(comparison: Document) -> list[str]:
    """Sentences that say what was asked, what came out, and what to make of it; no nats, no Pareto k."""
    laws, campaign = ranked(comparison), get(comparison, "campaign")
    n = counted(get(campaign, "n_events"), "avalanche")
    asked = (
        f"{_fitted(laws, failed(comparison))} to the {n}"
        f" recorded at {printable(get(campaign, 'name') or 'this path')}. Question: which predicts best an"
        " avalanche that it has not seen?"
    )
    if not laws:
        return [
            asked,
            "Answer: none can be used yet. The computation of all of them has to be repeated, longer.",
        ]
    answer = [*_answer(laws), *_disputed(comparison, laws), *_firm(comparison, n), *_miss(laws)]
    return [asked, *answer, _meaning(laws)]


def _fitted(laws: Sequence[Document], others: Sequence[Document]) -> str:
    n, what = len(laws) + len(others), "of how avalanches slow down"
    words = {2: "Two", 3: "Three", 4: "Four"}
    if n == 1:
        return f"One simple model {what} was fitted"
    return f"{words.get(n, n)} simple models {what} were fitted"


def _answer(laws: Sequence[Document]) -> list[str]:
    names = [printable(get(law, "id")) for law in laws]
    if len(laws) == 1:
        return [f"Answer: there is only one to choose from ({names[0]})."]
    clear = [
        name
        for name, law in zip(names[1:], laws[1:], strict=True)
        if get(law, "difference", "practical") is True
    ]
    close = [name for name in names[1:] if name not in clear]
    told = [f"Answer: {names[0]}."]
    if clear:
        told.append(f"{_listed(clear)} {'does' if len(clear) == 1 else 'do'} clearly worse.")
    if close:
        told.append(f"Between {names[0]} and {_listed(close, 'or')} these recordings do not decide.")
    return told


def _disputed(comparison: Document, laws: Sequence[Document]) -> list[str]:
    """Which other scores put a law first that does clearly worse by that which decides."""
    orders = get(comparison, "ranking", "orders") or {}
    worse = {get(law, "id") for law in laws if get(law, "difference", "practical") is True}
    others = {name: listed(orders, name)[:1] for name in _OTHER_SCORES}
    against = {name: printable(ids[0]) for name, ids in others.items() if ids and ids[0] in worse}
    if not against:
        return []
    told = [f"{law} by {_OTHER_SCORES[name]}" for name, law in against.items()]
    return [f"But do not rely on that: other scores put another one first ({_listed(told)})."]


def _firm(comparison: Document, n: str) -> list[str]:
    """How many avalanches the first place hangs on."""
    ours = [one for one in listed(comparison, "ranking", "rivals") if listed(one, "reversed_without")]
    if not ours:
        return []
    closest = min(ours, key=lambda one: len(listed(one, "reversed_without")))
    count, name = len(listed(closest, "reversed_without")), printable(get(closest, "id"))
    first = printable(get(comparison, "ranking", "best"))
    which = ", ".join(map(printable, listed(closest, "reversed_without")))
    if count <= 2:
        one = counted(count, "avalanche")
        return [f"Take that with care: without {one} ({which}) {name} would be ahead of {first}."]
    return [
        f"That {first} is first does not hang on a few: {count} of the {n} would have to go before"
        " another were ahead of it."
    ]


def _miss(laws: Sequence[Document]) -> list[str]:
    """Best of several need not be good."""
    if get(laws[0], "fits") is not False:
        return []
    name = printable(get(laws[0], "id"))
    return [f"Best does not mean good: {name} misses some recordings by more than chance allows."]


def _meaning(laws: Sequence[Document]) -> str:
    weight = get(laws[0], "weight")
    share = (
        f" In a mixture of all that predicts best, its share is {100 * weight:.0f} %."
        if is_number(weight)
        else ""
    )
    return "The answer is for this path and for avalanches like those recorded." + (
        share if len(laws) > 1 else ""
    )


def _listed(names: Sequence[str], last: str = "and") -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} {last} {names[-1]}"
