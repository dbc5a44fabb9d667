"""The record of concealed trials, as a page: ``python -m studies.proof`` writes docs/proof.md.

``--add DIR`` takes a revealed proof folder into the record first (``record.py`` has its form).
``--full`` prints what the page has no room for instead: every trial with a wrong answer, the criteria over
all batches, and what was written about each batch.

A batch is one ledger. Batches are added as time allows, each with a seed of its own. One that is given up
keeps its ledger, and its notes say why.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import cyclopts

from benchmarks.scorecard_tables import STRONG, asked, bars_table, found_of, measured, named_of
from skred.output import write_text
from skred.prove.ledger import ledger_sha256
from skred.prove.scorecard import DIAGNOSIS, scorecard
from skred.prove.scoring.answers import UNLISTED
from studies.files import FIGURES, ROOT, shrink
from studies.proof.beside import EARLIER, beside
from studies.proof.record import (
    Batch,
    add,
    answers_of,
    batches,
    is_open,
    ledger_of,
    missed,
    notes_of,
    opened_batches,
    sealed_of,
)

FAILED = ("crash", "timeout")
COMMAND, KEPT = "python -m studies.proof", "studies/results/proof.tar.xz"
"""How this is run, and where the record is kept, as the page says it."""
SHOWN = ("power", "confusion_classes", "reliability", "gain", "baselines")
"""Figures of the page."""
Found = Mapping[str, Any]
_HEAD = f"""# The record of concealed trials

Written by `{COMMAND}` from `{KEPT}`. [Reliability](reliability.md) says what
to make of it.

A *trial* is a simulated campaign with hidden physics, or with nothing hidden. The simulator shares no code
with the diagnosis. Its forces have other shapes than the mechanisms of the list, and some are in no list.

1. **Sealed** (`skred prove seal`): a ledger with the salted SHA-256 of every trial's truth, campaign,
   settings and source is written before the first diagnosis.
2. **Diagnosed** (`skred prove run`): each trial by a process that is given the campaign alone.
3. **Opened** (`skred prove reveal`): truths are compared with the ledger, and answers are scored. A crash or
   a time-out is a wrong answer. Every trial of every opened batch counts. Two exceptions are in the record's
   notes: in 1269020304 five answers that were ended from outside or ran beside other work were set aside
   unopened and made again, and the beginning of one truth was seen early; the first run of 1274408422 failed
   as a whole, for want of a folder, and was repeated.

Words used here:

- *Signal-to-noise* is the square root of twice the expected log likelihood ratio of the true model with and
  without what is hidden; 7 is a ratio of 24.5 nats.
- *Sparse* trials have a few sensors, *dense* ones about forty.
- *Contaminated* trials hide no physics, but have heavy tails, correlated errors or an odd avalanche.
- An effect is *compensated* where the calibrated base law is right on average at every sensor. All others
  are *open*.
"""
_RUN = """Seed {seed}: {n} trials, {nothing} of them with nothing hidden ({nasty} contaminated). One version
of the code diagnosed all of them. It was frozen before the seed was chosen. With the source of that version
the same trials, with other salts, come from

```console
skred prove seal DIR --trials {n} --nothing-share {share:g} --seed {seed}
skred prove run DIR
skred prove reveal DIR
python -m benchmarks.run_baselines --trials DIR
skred prove reveal DIR
```

The *newest batch* is {newest}, the last that was sealed. Intervals in brackets are of 95 %. The *ceiling* is
what the linearised model expects of a perfect method in the blind run. Criteria leave compensated effects
out; these have a table of their own.
"""
_EARLIER = f"""The same campaigns by the code of commit 7d03b1a as well. That *earlier* version had no global
starts, took avalanches to have every added strength in common, named a term that two mechanisms share by one
of them, and compared no mechanism with a force beside it. *Later* is the version that the batch was sealed
for. It diagnosed the first batch side by side with the other on one machine; times of the others are of
different days, beside other work. *p* is that of a sign test of trials that one version has right and the
other has not. Rows on effects take those with a signal-to-noise of {STRONG:g} and more, and open ones but for
the row on compensated effects.
"""
_ORDER = """In the order in which they were sealed, each diagnosed by the code of its day. *Found* counts
effects with a signal-to-noise of {strong:g} and more. The first two batches did not look for forces that are
nil on average. CPU times are of different machines.
"""
_FULL = """`{command} --full` prints the rest: every trial with a wrong answer, the criteria over
all batches, and what was written about each batch. The files are in `{kept}`:

| file of a batch | content |
| --- | --- |
| `ledger.json` | what was published before the first diagnosis |
| `sealed.json` | truth, settings and salt of every trial, which the ledger's hashes are of |
| `answers/skred.json` | every answer, less what is neither scored nor studied |
| `answers/<baseline>.json` | the same of a baseline, of the blind run alone |
| `studies/proof/notes/` | what was written about the batch when it was opened, or why it was given up |

`tests/studies/test_record.py` recomputes every hash.
"""
_BEFORE_COMPENSATED = 2
"""Opened batches whose code did not look for forces that are nil on average."""


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


def page(figures: Sequence[str], run: Found) -> str:
    """The whole page: the largest batch's scores are `run`."""
    every = _in_order()
    newest, lines = every[-1], [line for batch in every for line in _lines(batch)]
    parts = [_HEAD, "## What was sealed\n", _sealed(), "## One blind run, and the newest batch\n"]
    parts += [_about(_largest(), newest), criteria(run, _scores([newest]))]
    parts += [f"![{name.replace('_', ' ')}](figures/proof-{name}.png)\n" for name in figures]
    parts += ["Open and compensated effects of the blind run:\n", _open_and_compensated(run)]
    parts += ["What was hidden in the blind run:\n", _by_hidden(run["trials"])]
    parts += ["## Batches by an earlier version\n", _EARLIER]
    for batch in [one for one in every if EARLIER in answers_of(one)]:
        trials, answers = gathered([batch])
        parts += [f"Batch {batch.name}, {len(trials)} trials:\n", beside(trials, answers)]
    parts += ["## Every batch\n", _ORDER.format(strong=STRONG), _by_batch(every, lines)]
    parts += ["## The full record\n", _FULL.format(command=COMMAND, kept=KEPT)]
    return "\n".join(parts)


def full() -> str:
    """What the page has no room for."""
    every, lines = opened_batches(), [line for batch in opened_batches() for line in _lines(batch)]
    parts = ["## Trials with a wrong answer\n", _wrong(every), "## All batches together\n"]
    parts += [bars_table(_scores(every)), _by_hidden(lines)]
    parts += ["## Why the blind run missed criteria\n", missed()]
    parts += [f"## About batch {one.name}\n\n{notes_of(one)}" for one in batches() if notes_of(one)]
    return "\n".join(parts)


def _in_order() -> list[Batch]:
    """The opened batches as they were sealed."""
    return sorted(opened_batches(), key=lambda one: str(ledger_of(one)["created_utc"]))


def _largest() -> Batch:
    """The opened batch with most trials."""
    return max(opened_batches(), key=lambda batch: int(ledger_of(batch)["n"]))


def _scores(batches: Sequence[Batch]) -> Found:
    """Criteria of the diagnosis beside baselines, of which an earlier version of it is none."""
    trials, answers = gathered(batches)
    answers = {method: given for method, given in answers.items() if method != EARLIER}
    return scorecard({"n": len(trials)}, trials, answers)


def _lines(batch: Batch) -> list[Found]:
    """One line a trial, of the diagnosis alone."""
    trials, answers = gathered([batch])
    found: list[Found] = scorecard({}, trials, {DIAGNOSIS: answers[DIAGNOSIS]})["trials"]
    return found


def _about(batch: Batch, newest: Batch) -> str:
    """What the blind run consists of, and how to repeat it."""
    ledger = ledger_of(batch)
    clean = [one["truth"] for one in sealed_of(batch).values() if not one["truth"]["mechanisms"]]
    return _RUN.format(
        seed=ledger["seed"],
        n=ledger["n"],
        nothing=len(clean),
        nasty=sum(truth["hidden"] == "nasty" for truth in clean),
        share=len(clean) / ledger["n"],
        newest=newest.name,
    )


def _sealed() -> str:
    """All ledgers, opened or given up, and why those were that were."""
    rows = [
        "| seed | trials | sealed (UTC) | SHA-256 of the ledger | source | |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    given_up = [""]
    for batch in batches():
        ledger = ledger_of(batch)
        if not is_open(batch):
            first, _, _ = notes_of(batch).replace("\n", " ").partition(". ")
            given_up.append(f"- {batch.name}: {first.strip().rstrip('.')}.")
        rows.append(
            f"| {ledger['seed']} | {ledger['n']} | {str(ledger['created_utc'])[:16].replace('T', ' ')} |"
            f" `{ledger_sha256(ledger)}` | `{ledger['source_sha256'][:12]}` |"
            f" {'opened' if is_open(batch) else 'given up'} |"
        )
    return "\n".join([*rows, *given_up]) + "\n"


def criteria(run: Found, newest: Found) -> str:
    """Criteria, and what was measured in two batches."""
    rows = [
        "| goal | what | asked | ceiling | blind run | trials | | newest batch | trials | |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    other = {(one["goal"], one["what"]): one for one in newest["bars"]}
    for one in run["bars"]:
        cells = [*asked(one), *measured(one), *measured(other.get((one["goal"], one["what"])))]
        rows.append(f"| {' | '.join(cells)} |")
    return "\n".join(rows) + "\n"


def _open_and_compensated(document: Found) -> str:
    """Found, of trials of which the base law shows on average something, and of those where it hides it."""
    head = ["| signal-to-noise | open: found | compensated: found |", "| --- | --- | --- |"]
    scores = document["methods"][DIAGNOSIS]
    both = [scores[which]["all"]["detection"]["by_snr"] for which in ("open", "masked")]
    rows = [
        f"| {row['snr_from']:g} to {row['snr_to']:g} | {_share(row)} | {_share(other)} |"
        for row, other in zip(*both, strict=True)
    ]
    return "\n".join([*head, *rows]) + "\n"


def _share(found: Found) -> str:
    if not found["n"]:
        return "-"
    return f"{found['hits']} of {found['n']} ({found['low']:.2f} to {found['high']:.2f})"


def _by_batch(every: Sequence[Batch], lines: Sequence[Found]) -> str:
    """What each version of the code did on its own trials, and all of them."""
    rows = [
        "| seed | trials | clean: false alarms, failures | found: open | compensated | one name: right"
        " | ties with the truth | median CPU s sparse, dense |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    later = {one.name for one in every[_BEFORE_COMPENSATED:]}
    sets = {one.name: {one.name} for one in every} | {"all": {one.name for one in every}}
    sets["all but the first two"] = later
    for name, seeds in sets.items():
        own = [one for one in lines if one["trial"].partition("/")[0] in seeds]
        clean = [one["right"] for one in own if not one["true_ids"]]
        masked = [one for one in own if one["hidden"] == "masked"]
        times = [[one["cpu_seconds"] for one in own if one["kind"] == kind] for kind in ("sparse", "dense")]
        cells = [
            name,
            f"{len(own)}",
            f"{len(clean)}: {clean.count('false alarm')}, {clean.count('failed')}",
            found_of([one for one in own if one["hidden"] != "masked"]),
            found_of(masked),
            *named_of(own),
            ", ".join(f"{median(one for one in those if one is not None):.0f}" for those in times),
        ]
        rows.append(f"| {' | '.join(cells)} |")
    return "\n".join(rows) + "\n"


def _by_hidden(lines: Sequence[Found]) -> str:
    """How names fare by what was hidden, from whatever signal-to-noise."""
    rows = [
        "| hidden | trials | found from 5.5 on | one name: right | ties with the truth |",
        "| --- | --- | --- | --- | --- |",
    ]
    shown = {"masked": "compensated", "unlisted": "a force in no list", "nasty": "nothing, contaminated"}
    shown |= {"listed": "one listed mechanism", "two": "two mechanisms", "instrument": "an instrument fault"}
    for name in ("listed", "masked", "two", "instrument", "unlisted", "nothing", "nasty"):
        own = [one for one in lines if one["hidden"] == name]
        rows.append(
            f"| {shown.get(name, name)} | {len(own)} | {found_of(own)} | {' | '.join(named_of(own))} |"
        )
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


app = cyclopts.App(help=__doc__)


@app.default
def main(
    *,
    new: Annotated[Path | None, cyclopts.Parameter(name="--add", help="Revealed proof folder.")] = None,
    everything: Annotated[
        bool, cyclopts.Parameter(name="--full", help="Print what the page leaves out.")
    ] = False,
) -> None:
    """Write the page, after taking in another batch if one is given."""
    from skred.report.scorecard.figures import save_scorecard_figures

    if everything:
        print(full())
        return
    if new is not None:
        add(new)
    run = _scores([_largest()])
    with TemporaryDirectory() as folder:
        figures = save_scorecard_figures(run, Path(folder))
        shown = [name for name in SHOWN if name in figures]
        for name in shown:
            shrink(figures[name].file)
            shutil.copy(figures[name].file, FIGURES / f"proof-{name}.png")
    write_text(ROOT / "docs" / "proof.md", page(shown, run))


if __name__ == "__main__":
    app()
