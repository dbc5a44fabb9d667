"""What a comparison says, in plain sentences."""

from __future__ import annotations

from typing import Any

from skred.inference.fit import fit_sentences, missed_sensors
from skred.inference.intervals import PRACTICAL_DIFFERENCE

_NOTABLE_SHARE = 0.05


def statement(comparison: dict[str, Any]) -> list[str]:
    """Sentences on which law the recordings prefer, by how much, and how far to trust it."""
    models = comparison["models"]
    valid = [model for model in models if model["gate"]["passed"]]
    failed = [model for model in models if not model["gate"]["passed"]]
    sentences = []
    if not valid:
        sentences.append("The chains of no law converged: there is nothing to compare.")
    else:
        sentences += _preference(valid, comparison["campaign"]["n_events"])
        sentences += _fit(valid)
        sentences += _agreement(valid)
    for model in failed:
        sentences.append(
            f"The chains of {model['title']} did not converge, so it is not compared:"
            f" {'; '.join(model['gate']['problems'])}."
        )
    return sentences


def _preference(valid: list[dict[str, Any]], n_events: int) -> list[str]:
    best, others = valid[0], valid[1:]
    if not others:
        return [f"Only {best['title']} was calibrated: elpd {best['exact']['elpd']:.2f}."]
    sentences = []
    clear = [model for model in others if model["difference"]["practical"]]
    close = [model for model in others if not model["difference"]["practical"]]
    verb = "prefer" if len(clear) == len(others) else "put first"
    sentences.append(
        f"By {_how(valid)} over {n_events} avalanches the recordings {verb} {best['title']}"
        f" (elpd {best['exact']['elpd']:.2f})."
    )
    for model in clear:
        sentences.append(f"{model['title']} predicts worse by {_by(model)}.")
    for model in close:
        sentences.append(
            f"{model['title']} is behind by {_by(model)}: no practical difference. One is at least"
            f" {PRACTICAL_DIFFERENCE:.0f} and more than twice the standard error."
        )
    if n_events < 100:
        sentences.append(
            "With fewer than 100 events standard errors are optimistic; that is why they are doubled."
        )
    return sentences


def _fit(valid: list[dict[str, Any]]) -> list[str]:
    """Where laws miss the recordings: the best of several need not be good."""
    sentences = []
    for model in valid:
        if not model["fits"]:
            sentences.append(
                f"{model['title']} misses the recordings at {missed_sensors(model)}, more than chance allows."
            )
            sentences += fit_sentences(model)
    return sentences


def _how(valid: list[dict[str, Any]]) -> str:
    """What the scores are."""
    if all(len(model["exact"]["refitted"]) == len(model["exact"]["pointwise"]) for model in valid):
        return "exact leave-one-event-out"
    return "leave-one-event-out (exact where importance sampling is unreliable)"


def _by(model: dict[str, Any]) -> str:
    difference = model["difference"]
    return f"{-difference['elpd']:.2f} (standard error {difference['se']:.2f})"


def _agreement(valid: list[dict[str, Any]]) -> list[str]:
    """Whether evidence agrees, and what the diagnostics of the scores say."""
    sentences = []
    by_evidence = max(valid, key=lambda model: model["evidence"]["mean"])
    if len(valid) > 1:
        agrees = "agrees" if by_evidence is valid[0] else f"prefers {by_evidence['title']} instead"
        spread = max(model["evidence"]["spread"] for model in valid)
        sentences.append(
            f"Evidence by sequential Monte Carlo {agrees}; its seeds differ by at most {spread:.2f}."
        )
    for model in valid:
        if model["loo"]["n_bad"]:
            sentences.append(
                f"Importance sampling is unreliable for {_count(model['loo']['n_bad'], 'event')} of"
                f" {model['title']} (Pareto k up to {model['loo']['pareto_k_max']:.2f}); the ranking rests on"
                " exact refits there."
            )
        if model["exact"]["failed_refits"]:
            sentences.append(
                f"{_count(len(model['exact']['failed_refits']), 'refit')} of {model['title']} did not"
                " converge: its rank is not reliable."
            )
    return sentences


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def changes(comparison: dict[str, Any]) -> list[str]:
    """What changes between the pooled and the hierarchical comparison, and why: one paragraph."""
    ours = [model for model in comparison["models"] if model["gate"]["passed"]]
    theirs = [model for model in comparison["pooled"]["models"] if model["gate"]["passed"]]
    sentences = [
        "The pooled likelihood has one parameter vector for the path. Events differ from its mean response by"
        " the covariance of the recordings, which also contains what the law misses. The hierarchical"
        " likelihood has parameters for every avalanche. Its readings differ from its own front only by the"
        " stated reading errors."
    ]
    if ours:
        sentences += _selection(ours[0])
    if comparison["pooled"]["reason"]:
        return [*sentences, f"There is no pooled calibration here: {comparison['pooled']['reason']}."]
    if not ours or not theirs:
        return sentences
    sentences.append(_order_change(ours, theirs))
    elpd = {model["id"]: model["exact"]["elpd"] for model in theirs}
    best = ours[0]
    if best["id"] in elpd:
        sentences.append(_level_change(best, best["exact"]["elpd"] - elpd[best["id"]]))
    return sentences


def _selection(best: dict[str, Any]) -> list[str]:
    """Whether the law stops more avalanches above a sensor than were recorded to stop."""
    rows = [row for row in best.get("new_avalanche", []) if row["recorded_reached"] is not None]
    row = max(rows, key=lambda row: row["recorded_reached"] - row["reached"], default=None)
    if row is None or row["recorded_reached"] - row["reached"] < _NOTABLE_SHARE:
        return []
    predicted, recorded = 100 * row["reached"], 100 * row["recorded_reached"]
    return [
        f"Under {best['title']} {predicted:.0f} % of new avalanches come to {row['sensor']}, of recorded"
        f" ones {recorded:.0f} %. Either avalanches that stop above the instruments were not recorded, which"
        " the likelihood does not model, or parameters do not vary as assumed."
    ]


def _order_change(ours: list[dict[str, Any]], theirs: list[dict[str, Any]]) -> str:
    order, pooled_order = ([model["id"] for model in models] for models in (ours, theirs))
    if order == pooled_order:
        gaps = ", ".join(
            f"{model['id']} {model['difference']['elpd']:.1f} (pooled"
            f" {next(t for t in theirs if t['id'] == model['id'])['difference']['elpd']:.1f})"
            for model in ours[1:]
        )
        return f"Both put the laws in the same order{'; behind the best: ' + gaps if gaps else ''}."
    return (
        f"The order of the laws changes: {', '.join(pooled_order)} pooled, {', '.join(order)} hierarchically."
    )


def _level_change(best: dict[str, Any], gain: float) -> str:
    if gain < 0:
        return (
            f"Under {best['title']} the hierarchical likelihood predicts a left-out event worse, by"
            f" {-gain:.1f} in elpd. Event-to-event variability and the stated errors do not explain how the"
            " readings of one avalanche differ from its front. The pooled covariance absorbs that, because it"
            " is estimated from the same recordings. Ask what the law or the stated errors miss; the pooled"
            " model is not better for it."
        )
    return (
        f"Under {best['title']} the hierarchical likelihood predicts a left-out event better, by {gain:.1f}"
        " in elpd: events differ mostly by their own parameters."
    )
