"""The development set's own table: ``python -m benchmarks.page.development`` writes ``development.md``.

From ``results/development.json``, after ::

    python -m benchmarks.development_set --each --seed 3100000 --out DIR
    python -m benchmarks.diagnosis --trials DIR --workers 1 --json benchmarks/results/development.json
"""

from __future__ import annotations

from typing import Any

import cyclopts

from benchmarks.development_set import EACH
from benchmarks.files import RESULTS
from benchmarks.page.results import result_of
from benchmarks.scorecard_tables import bars_table, found_of, named_of
from skred.output import write_text
from skred.simulator.unlisted import UNLISTED

_HEAD = """# The development set

Written by `python -m benchmarks.page.development` from `results/development.json`. The commands that made it:

    python -m benchmarks.development_set --each --seed 3100000 --out DIR
    python -m benchmarks.diagnosis --trials DIR --workers 1 --json benchmarks/results/development.json

{n} simulated campaigns, sparse and dense in turn, with each mechanism, each force that is in no list, masked
ones, two at once, and nothing, all of a signal-to-noise drawn evenly from 2 to 12. What was tuned, was tuned
on other seeds (and on trials of the [record](../docs/proof.md) once they were opened), so on other tracks,
avalanches and effects: nothing was on these before this table. They were not sealed; claims are made from the
record, which has more trials and another mix: here a mechanism is as frequent as another, and {unlisted} hide
a force that is in no list. By the code of 24 November 2026, before issue 34: today's is slower and has other
priors.
"""


app = cyclopts.App(help=__doc__)


@app.default
def main() -> None:
    """Write the page."""
    document = result_of("development")
    lines = document["trials"]
    parts = [
        _HEAD.format(n=len(lines), unlisted=sum(one["hidden"] == "unlisted" for one in lines)),
        "## Goals\n",
        bars_table(document),
        "## By what was hidden\n",
    ]
    write_text(RESULTS.parent / "development.md", "\n".join([*parts, _by_name(lines)]))


def _by_name(lines: list[dict[str, Any]]) -> str:
    """What became of each trial, by what it hides."""
    rows = [
        "| hidden | found from 5.5 on | one name: right | tie sets with it | signal-to-noise, verdict |",
        "| --- | --- | --- | --- | --- |",
    ]
    for name in dict.fromkeys(EACH):
        own = [one for one in lines if name in (one["hidden"], *one["true_ids"][:1]) and _alone(one, name)]
        told = "; ".join(
            f"{'' if one['snr'] is None else format(one['snr'], '.1f')} {one['kind']}: {_told(one)}"
            for one in sorted(own, key=lambda one: one["snr"] or 0.0)
        )
        label = f"{name} (in no list)" if name in UNLISTED else name
        rows.append(f"| {label} | {found_of(own)} | {' | '.join(named_of(own))} | {told} |")
    return "\n".join(rows) + "\n"


def _alone(line: dict[str, Any], name: str) -> bool:
    """Whether a trial belongs to a row: one of two effects, or a masked one, to that of its class."""
    return name == line["hidden"] or line["hidden"] not in ("two", "masked")


def _told(line: dict[str, Any]) -> str:
    """What a diagnosis says."""
    return " or ".join(line["names"]) or line["verdict"].replace("_", " ")


if __name__ == "__main__":
    app()
