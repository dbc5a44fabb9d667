"""The published record: concealed trials that were sealed, diagnosed, revealed; and docs/proof.md.

``python -m studies.proof --add DIR`` takes a revealed proof folder into the record
(``record.py`` has its form); without ``--add`` it only writes the page anew. The page scores the
largest batch, which one version of the code diagnosed from first to last, and then all batches together.

A batch is one ledger. Batches are added as time allows, each with a seed of its own. One that is given up
keeps its ledger, and its notes say why.
"""

from __future__ import annotations

import math
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import cyclopts
import numpy as np

from skred.output import write_text
from skred.prove.ledger import ledger_sha256
from skred.prove.plan import KINDS
from skred.prove.scorecard import DIAGNOSIS, scorecard
from skred.prove.scoring.answers import UNLISTED
from skred.prove.scoring.standards import SNR_BINS
from studies.files import FIGURES, ROOT, shrink
from studies.proof.record import (
    Batch,
    add,
    answers_of,
    batches,
    is_open,
    ledger_of,
    missed,
    notes_of,
    sealed_of,
)

FAILED = ("crash", "timeout")
Found = Mapping[str, Any]
_HEAD = """# The record of concealed trials

Written by `python -m studies.proof` from `studies/results/proof.tar.xz`. Each batch was sealed before its
first diagnosis (`skred prove seal`: salted SHA-256 of truth, campaign, settings and source), diagnosed by
processes that were given the campaign alone (`skred prove run`), then opened and verified (`skred prove
reveal`). A crash or a time-out is a wrong answer; every trial of every opened batch is counted, and a
batch that was given up is listed with its reason. Scores are defined
in `src/skred/prove/scoring/`.
"""
_RUN = """Seed {seed}: {n} trials, {nothing} of them with nothing hidden ({nasty} nasty), all diagnosed by one
version of the code, which was frozen before the seed was chosen. With the source of that version the same
trials, with other salts, are drawn, diagnosed and scored by

```console
skred prove seal DIR --trials {n} --nothing-share {share:g} --seed {seed}
skred prove run DIR
skred prove reveal DIR
python -m benchmarks.run_baselines --trials DIR
skred prove reveal DIR
```
"""
_IN_ORDER = """Each batch was diagnosed by the code of its day, so these rows are also a history. The first
two (1471600277, 1152334902) did not look for forces that are nil on average. Clean trials whose diagnosis
crashed or timed out are counted as failures; CPU times are of different machines.
"""
_BEFORE_OPPOSED = 2
"""Opened batches whose code did not look for forces that are nil on average."""
_WEAK, _STRONG = 4.0, 5.5
"""Signal-to-noise from which on effects should be found."""


def gathered(batches: Sequence[Batch]) -> tuple[list[dict[str, Any]], dict[str, dict[str, Any]]]:
    """Trials with their truths, and answers by method, of all batches, named by seed and trial."""
    trials, answers = [], dict[str, dict[str, Any]]()
    for batch in filter(is_open, batches):
        sealed = sealed_of(batch)
        trials += [{"trial": f"{batch.name}/{name}", "truth": one["truth"]} for name, one in sealed.items()]
        for method, by_trial in answers_of(batch).items():
            mine = answers.setdefault(method, {})
            mine.update({f"{batch.name}/{name}": answer for name, answer in by_trial.items()})
    return trials, answers


def page(batches: Sequence[Batch], run: Found, document: Found, figures: Sequence[str]) -> str:
    """The whole page: the largest batch's scores are `run`, those of all together `document`."""
    parts = [_HEAD, "## Batches\n", _batches(batches)]
    parts += ["## One blind run\n", _about(_largest(batches)), bars_table(run)]
    parts += [f"![{name.replace('_', ' ')}](figures/proof-{name}.png)\n" for name in figures]
    parts += ["### Open and masked\n", _masked(run), "### By what was hidden\n", _by_hidden(run)]
    parts += ["### Why bars are missed\n", missed()]
    parts += ["## The newest batch\n", _newest(batches)]
    parts += ["## All batches together\n", _IN_ORDER, _by_batch(batches, document), bars_table(document)]
    parts += [_later(batches, document), _by_hidden(document)]
    parts += ["## What it got wrong\n", _wrong(batches), *map(_notes, batches)]
    return "\n".join(parts)


def _newest(batches: Sequence[Batch]) -> str:
    """Goals of the batch that was sealed last, by the code of that day."""
    seed = str(_in_order(batches)[-1]["seed"])
    bars = bars_table(_scores([Batch(seed)]))
    return f"Seed {seed}; what is to be said about it stands at the end.\n\n{bars}"


def _largest(batches: Sequence[Batch]) -> Batch:
    """The opened batch with most trials."""
    return max(filter(is_open, batches), key=lambda batch: int(ledger_of(batch)["n"]))


def _about(batch: Batch) -> str:
    """What a batch consists of, and how to repeat it."""
    ledger = ledger_of(batch)
    trials, _ = gathered([batch])
    clean = [one["truth"] for one in trials if not one["truth"]["mechanisms"]]
    return _RUN.format(
        seed=ledger["seed"],
        n=ledger["n"],
        nothing=len(clean),
        nasty=sum(truth["hidden"] == "nasty" for truth in clean),
        share=len(clean) / ledger["n"],
    )


def _masked(document: Found) -> str:
    """Found, of trials of which the base law shows on average something, and of those where it hides it."""
    head = ["| signal-to-noise | open: found | masked: found |", "| --- | --- | --- |"]
    scores = document["methods"][DIAGNOSIS]
    both = [scores[which]["all"]["detection"]["by_snr"] for which in ("open", "masked")]
    rows = [
        f"| {row['snr_from']:g} to {row['snr_to']:g} | {_share(row)} | {_share(other)} |"
        for row, other in zip(*both, strict=True)
    ]
    return "\n".join([*head, *rows, f"\nFrom {_STRONG:g} on: {_open_and_masked(document['trials'])}."]) + "\n"


def _later(batches: Sequence[Batch], document: Found) -> str:
    """The same of the batches whose code looked for what is nil on average."""
    later = {ledger["seed"] for ledger in _in_order(batches)[_BEFORE_OPPOSED:]}
    lines = [one for one in document["trials"] if int(one["trial"].partition("/")[0]) in later]
    text = f"From {_STRONG:g} on, without the first two batches: {_open_and_masked(lines)}.\n\n"
    text += "Share of masked effects found less that of open ones of like signal-to-noise (bins as above, "
    text += "as many open ones as there are masked ones in each; 95 % by bootstrap; asked: within 0.10):\n\n"
    last = str(_in_order(batches)[-1]["seed"])
    newest = [one for one in lines if one["trial"].startswith(f"{last}/")]
    rows = ["| | all | sparse | dense |", "| --- | --- | --- | --- |"]
    for which, of in (("these batches", lines), (f"the last of them alone, {last}", newest)):
        for least in (0.0, _WEAK, _STRONG):
            kinds = [[one for one in of if one["kind"] in kind] for kind in (KINDS, KINDS[:1], KINDS[1:])]
            cells = [_difference([one for one in own if one["snr"] >= least]) for own in kinds]
            at = f"signal-to-noise {least:g} and more" if least else "any signal-to-noise"
            rows.append(f"| {which}: {at} | {' | '.join(cells)} |")
    return text + "\n".join(rows) + "\n"


def _difference(lines: Sequence[Found]) -> str:
    """Found share of masked less open effects at equal signal-to-noise, with its interval and number."""
    rng = np.random.default_rng(0)
    hidden = [one for one in lines if one["true_ids"]]
    drawn = rng.integers(len(hidden), size=(2000, len(hidden)))
    again = [_masked_less_open([hidden[k] for k in sample]) for sample in drawn]
    low, high = np.nanquantile(again, [0.025, 0.975])
    n = sum(one["hidden"] == "masked" for one in hidden)
    return f"{_masked_less_open(hidden):.2f} ({low:.2f} to {high:.2f}), {n} masked"


def _masked_less_open(lines: Sequence[Found]) -> float:
    """Mean over the masked effects of found less the share of open ones found in the same bin."""
    differences = []
    for low, high in SNR_BINS:
        found = {True: list[bool](), False: list[bool]()}
        for one in lines:
            if low <= one["snr"] < high:
                found[one["hidden"] == "masked"].append(one["right"] not in ("failed", "not found"))
        if found[True] and found[False]:
            differences += [float(one) - float(np.mean(found[False])) for one in found[True]]
    return float(np.mean(differences)) if differences else math.nan


def _open_and_masked(lines: Sequence[Found]) -> str:
    masked = [one for one in lines if one["hidden"] == "masked"]
    open_ones = [one for one in lines if one["hidden"] != "masked"]
    return f"{found_of(open_ones)} open effects were found, {found_of(masked)} masked ones"


def _in_order(batches: Sequence[Batch]) -> list[Found]:
    """Ledgers of the opened batches as they were sealed."""
    ledgers = [ledger_of(one) for one in batches if is_open(one)]
    return sorted(ledgers, key=lambda one: str(one["created_utc"]))


def _by_batch(batches: Sequence[Batch], document: Found) -> str:
    """What each version of the code did on its own trials, in the order in which they were sealed."""
    rows = [
        "| seed | trials | clean: false alarms, failures | found from 5.5 on: open | masked | one name: right"
        " | tie sets with the truth | median CPU s sparse, dense |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for ledger in _in_order(batches):
        own = [one for one in document["trials"] if one["trial"].startswith(f"{ledger['seed']}/")]
        clean = [one["right"] for one in own if not one["true_ids"]]
        masked = [one for one in own if one["hidden"] == "masked"]
        times = [[one["cpu_seconds"] for one in own if one["kind"] == kind] for kind in ("sparse", "dense")]
        cells = [
            f"{ledger['seed']}",
            f"{len(own)}",
            f"{len(clean)}: {clean.count('false alarm')}, {clean.count('failed')}",
            found_of([one for one in own if one not in masked]),
            found_of(masked),
            *named_of(own),
            ", ".join(f"{median(one for one in those if one is not None):.0f}" for those in times),
        ]
        rows.append(f"| {' | '.join(cells)} |")
    return "\n".join(rows) + "\n"


def _by_hidden(document: Found) -> str:
    """How names fare by what was hidden, from whatever signal-to-noise."""
    rows = [
        "| hidden | trials | found from 5.5 on | one name: right | tie sets with the truth |",
        "| --- | --- | --- | --- | --- |",
    ]
    for name in ("listed", "masked", "two", "instrument", "unlisted", "nothing", "nasty"):
        own = [one for one in document["trials"] if one["hidden"] == name]
        rows.append(f"| {name} | {len(own)} | {found_of(own)} | {' | '.join(named_of(own))} |")
    return "\n".join(rows) + "\n"


def found_of(lines: Sequence[Found]) -> str:
    """How many of the strong effects were found."""
    strong = [one["right"] for one in lines if one["true_ids"] and one["snr"] >= _STRONG]
    return f"{sum(right not in ('failed', 'not found') for right in strong)} of {len(strong)}"


def named_of(lines: Sequence[Found]) -> list[str]:
    """How many single names are right, and how many tie sets hold a truth."""
    cells = []
    for several, good in ((False, ("right",)), (True, ("right", "in the set"))):
        named = [one["right"] for one in lines if one["names"] and (len(one["names"]) > 1) == several]
        cells.append(f"{sum(right in good for right in named)} of {len(named)}")
    return cells


def _share(found: Found) -> str:
    if not found["n"]:
        return "-"
    return f"{found['hits']} of {found['n']} ({found['low']:.2f} to {found['high']:.2f})"


def _notes(batch: Batch) -> str:
    """What is to be said about a batch, written by hand after it was opened."""
    notes = notes_of(batch)
    return f"## About batch {batch.name}\n\n{notes}" if notes else ""


def _batches(batches: Sequence[Batch]) -> str:
    rows = [
        "| seed | trials | sealed (UTC) | SHA-256 of the ledger | source | |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for batch in batches:
        ledger = ledger_of(batch)
        rows.append(
            f"| {ledger['seed']} | {ledger['n']} ({ledger['kind']}) | {ledger['created_utc']} |"
            f" `{ledger_sha256(ledger)}` | `{ledger['source_sha256'][:12]}` |"
            f" {_state(batch)} |"
        )
    return "\n".join(rows) + "\n"


def _state(batch: Batch) -> str:
    if is_open(batch):
        return "opened"
    return "given up unopened, see below" if notes_of(batch) else "not opened yet"


def bars_table(document: Found) -> str:
    """Goals, their bars, and what was measured."""
    rows = [
        "| goal | what | bar | linearised ceiling | measured (95 %) | trials | |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for one in document["bars"]:
        limit = [f"at least {one['at_least']:g}"] if one["at_least"] is not None else []
        limit += [f"at most {one['at_most']:g}"] if one["at_most"] is not None else []
        between = f" ({one['low']:.3g} to {one['high']:.3g})" if one["low"] is not None else ""
        measured = "-" if one["measured"] is None else f"{one['measured']:.3g}{between}"
        ceiling = "" if one["ceiling"] is None else f"{one['ceiling']:.2f}"
        cells = (one["goal"], one["what"], ", ".join(limit), ceiling, measured, one["n"], one["status"])
        rows.append(f"| {' | '.join(map(str, cells))} |")
    return "\n".join(rows) + "\n"


def _wrong(batches: Sequence[Batch]) -> str:
    """Every trial in which something was alarmed, named or missed wrongly."""
    rows = [
        "| trial | what was hidden | signal-to-noise | verdict | named | P(nothing) |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    trials, answers = gathered(batches)
    for one in trials:
        answer, truth = answers["skred"][one["trial"]], one["truth"]
        ids = {hidden["id"] for hidden in truth["mechanisms"]}
        named = [answer["mechanism"], *answer["indistinguishable"]] if answer.get("mechanism") else []
        alarm = answer["verdict"] in ("missing_physics", "instrument", "unexplained")
        unlisted = truth["hidden"] == "unlisted"
        held = ids | ({UNLISTED} if unlisted else set())
        right = (set(named) & held or (unlisted and answer["verdict"] == "unexplained")) if ids else not alarm
        if not right or answer["verdict"] in FAILED:
            hidden = " + ".join(sorted(ids)) or truth["nasty"] or "nothing"
            nothing = answer.get("probability", {}).get("nothing")
            rows.append(
                f"| {one['trial']} {truth['kind']} | {hidden}{' (unlisted)' if unlisted else ''} |"
                f" {truth['snr']:.1f} | {answer['verdict']} | {', '.join(named)} |"
                f" {'-' if nothing is None else f'{nothing:.2f}'} |"
            )
    return "\n".join(rows) + "\n"


def _scores(batches: Sequence[Batch]) -> Found:
    trials, answers = gathered(batches)
    return scorecard({"n": len(trials)}, trials, answers)


app = cyclopts.App(help=__doc__)


@app.default
def main(
    *,
    new: Annotated[Path | None, cyclopts.Parameter(name="--add", help="Revealed proof folder.")] = None,
) -> None:
    """Write the page, after taking in another batch if one is given."""
    from skred.report.scorecard.figures import save_scorecard_figures

    if new is not None:
        add(new)
    every = batches()
    run, document = _scores([_largest(every)]), _scores(every)
    with TemporaryDirectory() as folder:
        figures = save_scorecard_figures(run, Path(folder))
        for name, file in figures.items():
            shrink(file)
            shutil.copy(file, FIGURES / f"proof-{name}.png")
    write_text(ROOT / "docs" / "proof.md", page(every, run, document, list(figures)))


if __name__ == "__main__":
    app()
