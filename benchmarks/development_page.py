"""The development set's own table: ``python benchmarks/development_page.py`` writes ``development.md``.

From ``results/development.json``, after ::

    python benchmarks/development_set.py --each --seed 3100000 --out DIR
    python benchmarks/diagnosis.py --trials DIR --workers 1 --json benchmarks/results/development.json
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from development_set import EACH
from proof_page import bars_table, found_of, named_of

from skred.output import write_text
from skred.simulator.unlisted import UNLISTED

HERE = Path(__file__).resolve().parent
_HEAD = """# The development set

Written by `python benchmarks/development_page.py` from `results/development.json`. The commands that made it:

    python benchmarks/development_set.py --each --seed 3100000 --out DIR
    python benchmarks/diagnosis.py --trials DIR --workers 1 --json benchmarks/results/development.json

{n} simulated campaigns, sparse and dense in turn, with each mechanism, each force that is in no list, masked
ones, two at once, and nothing, all of a signal-to-noise drawn evenly from 2 to 12. What was tuned, was tuned
on other seeds (and on trials of the [record](../docs/proof.md) once they were opened), so on other tracks,
avalanches and effects: nothing was on these before this table. They were not sealed; claims are made from the
record, which has more trials and another mix: here a mechanism is as frequent as another, and {unlisted} hide
a force that is in no list.
"""


def main() -> None:
    """Write the page."""
    document = json.loads((HERE / "results" / "development.json").read_text(encoding="utf-8"))
    lines = document["trials"]
    parts = [
        _HEAD.format(n=len(lines), unlisted=sum(one["hidden"] == "unlisted" for one in lines)),
        "## Goals\n",
        bars_table(document),
        "## By what was hidden\n",
    ]
    write_text(HERE / "development.md", "\n".join([*parts, _by_name(lines)]))


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
    main()
