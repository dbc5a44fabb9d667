"""Sections of studies/README.md about what the diagnosis' limits and numerical settings were set by."""

from statistics import fmean
from typing import Any

from studies.files import RESULTS, read

_TIE_PARTS = ("sealed after", "all", "sparse", "dense")
_TIE_HEAD = """| recordings | tied within | single names right | tie sets that hold what is hidden\
 | right sets of at most 3 | sets of 4 and more | single over ceiling | no longer single: were right |
| --- | --- | --- | --- | --- | --- | --- | --- |
"""

_NEAR = 0.6
"""Nats from what many draws say that few draws mostly keep within."""


def sections() -> str:
    """All of them."""
    return (
        line_nodes()
        + event_nodes()
        + unseen_nodes()
        + free_force_draws()
        + alarm()
        + nothing_at_most()
        + tie_rules()
    )


def line_nodes() -> str:
    """How far integrals over one strength are off, by rule."""
    rows = "".join(
        f"| {law['base_model']} | {row['budget']} | {row['rule']} | {row['nodes']} | {row['median']:.3f}"
        f" | {row['nine in ten']:.3f} | {row['97 in 100']:.2f} | {row['seconds']:.1f} |\n"
        for law in read(RESULTS / "line_nodes.json")["laws"]
        for row in law["rows"]
    )
    n = {law["integrations"] for law in read(RESULTS / "line_nodes.json")["laws"]}
    return f"""
## Integrating one free strength out

`python -m studies.thresholds.line_nodes`: {max(n)} of the curves of Ryggfonn's
comparison under M1 and M3, each integrated again at all of its strengths: by trapezoids between nodes on a
line, and by importance nodes as laws of two strengths have them; each against a line with sixteen times the
nodes. What a log evidence [nats] is off by, less what it is off by at the other strengths of its curve;
seconds of a processor.

| base law | budget | rule | nodes of an event | median | nine in ten within | 97 in 100 within | seconds |
| --- | --- | --- | --- | --- | --- | --- | --- |
{rows}
Importance nodes by the thousand, the second route, agree with those that stand for exact.
"""


def event_nodes() -> str:
    """How far integrals over an avalanche's strengths are off, by quadrature points."""
    rows = "".join(
        f"| {row['campaign']} | {row['budget']} | {row['nodes']} | {row['integrals']}"
        f" | {row['root mean square']:.3f} | {row['nine in ten']:.3f} | {row['97 in 100']:.3f}"
        f" | {row['median of the sum']:.2f} | {row['seconds']:.1f} |\n"
        for row in read(RESULTS / "event_nodes.json")["rows"]
    )
    return f"""
## Integrating an avalanche's strengths out

`python -m studies.thresholds.event_nodes`: terms of six mechanisms at random
places and of random strengths on base laws of two strengths, under robust errors; what log integrals [nats]
are off by, against eight times the points of re-computed evidence. The few that are off most are of fronts
about to stop. The sum over avalanches is mostly compared with one that is off by about as much.

| campaign and law | budget | points | integrals | rms | nine in ten | 97 in 100 | sum, median | seconds |
| --- | --- | --- | --- | --- | --- | --- | --- | --- |
{rows}"""


def unseen_nodes() -> str:
    """How far scores of held-out avalanches are off, by nodes."""
    rows = "".join(
        f"| {row['nodes']} | {row['of a draw']} | {row['root mean square']:.3f} | {row['sum']:+.2f}"
        f" | {format(row['seconds'], '.1f') if 'seconds' in row else '-'} |\n"
        for row in read(RESULTS / "unseen_nodes.json")["rows"]
    )
    return f"""
## Scores of held-out avalanches

`python -m studies.thresholds.unseen_nodes`: Ryggfonn's 22 avalanches
under PCM with the force profile, each scored by 200 draws of populations and profiles. What log scores [nats]
are off by with few nodes a draw, and what other draws change.

| nodes | of an avalanche and draw | root mean square of an avalanche | sum of 22 | seconds |
| --- | --- | --- | --- | --- |
{rows}
Adapted nodes go where the others have found the weight to be: few as they are, they are too low in the mean.
"""


def free_force_draws() -> str:
    """Both routes to the evidence of a force that is in no list."""
    found = read(RESULTS / "free_force_draws.json")
    rows = "".join(_force_row(row) for row in found["rows"])
    due = [fmean(row["many"]) for row in found["rows"]]
    few = [one - own for row, own in zip(found["rows"], due, strict=True) for one in row["usual"]]
    laplace = [row["laplace"] - own for row, own in zip(found["rows"], due, strict=True)]
    near, many = sum(abs(one) <= _NEAR for one in few), found.get("many_draws", 1024)
    return f"""
## The evidence of a force in no list

`python -m studies.thresholds.free_force_draws` (code
{found["commit"]}): log Bayes factors of what is missing at Ryggfonn against nothing, by the way the force
goes with speed. By Laplace's formula over its 32 values, and by importance sampling of them, with as many
draws as a comparison takes and with {many}; one number a seed. Of the {len(few)} with few draws {near}
are within {_NEAR} nats of the mean of those with many, from {min(few):+.1f} to {max(few):+.1f} and
{fmean(few):+.1f} in the mean; by Laplace's formula from {min(laplace):+.1f} to {max(laplace):+.1f}.

| base law | errors | force | Laplace | as in a comparison | many draws | best listed | CPU seconds |
| --- | --- | --- | --- | --- | --- | --- | --- |
{rows}"""


def _force_row(row: dict[str, Any]) -> str:
    few, many = (", ".join(f"{value:.1f}" for value in row[key]) for key in ("usual", "many"))
    cells = [row["base_model"], row["errors"], row["force"], f"{row['laplace']:.1f}", few, many]
    return f"| {' | '.join([*cells, f'{row["best_listed"]:.1f}', f'{row["cpu_seconds"]:.1f}'])} |\n"


def alarm() -> str:
    """How often clean campaigns pass the alarm's limit."""
    found = read(RESULTS / "alarm.json")
    rows = "".join(
        f"| {'plain' if name == 'nothing' else name} | {' | '.join(map(str, row.values()))} |\n"
        for name, row in found["counted"].items()
    )
    return f"""
## The alarm on clean campaigns

`python -m studies.thresholds.alarm --n {len(found["trials"])}`, seeds from {found["seed"]}, code
{", ".join(found["commits"])}: the statistic of the recordings is the log odds by the whole comparison, that
of simulated campaigns comes from one shape of each mechanism (`skred.diagnosis.check.by_fronts`).

| clean campaigns | n | alarms | p at most 0.01 | p at most 0.1 |
| --- | --- | --- | --- | --- |
{rows}"""


def nothing_at_most() -> str:
    """What limits of the probability of nothing make of the record's alarms."""
    found = read(RESULTS / "nothing_at_most.json")
    rows = "".join(
        f"| {name} | {row['limit']:g} | "
        + " | ".join(f"{row[key]['hits']} of {row[key]['n']}" for key in ("false", "found", "found_weak"))
        + " |\n"
        for name, part in found["parts"].items()
        for row in part
    )
    return f"""
## How probable nothing may be beside an alarm

`python -m studies.thresholds.nothing_at_most`: the alarms of the {found["batches"]} batches of the record, by
the checks of their time, and how many of them would stay if nothing had to be less probable than a limit.
Found: effects at a signal-to-noise of {found["from_snr"]} and more; weaker: all others.

| recordings | nothing below | false alarms | found | weaker ones found |
| --- | --- | --- | --- | --- |
{rows}"""


def tie_rules() -> str:
    """What ties across groups make of the record."""
    found = read(RESULTS / "tie_rules.json")
    rows = "".join(_tie_row(part, row) for part in _TIE_PARTS for row in found["parts"][part])
    return f"""
## Ties across groups

`python -m studies.thresholds.tie_rules`: the stated probabilities of the {len(found["batches"])} batches of
the record that were sealed before ids of other groups were tied with a name, under several limits; 0 nats is
what was answered. A tie with `unlisted` holds a force that is in no list. Sets of more than three names,
right sets of at most three at a signal-to-noise of 6 to 8.5 and single names over the linearised ceiling
(asked: at least 0.6) are what wider ties cost. 2 nats, a factor of 7.4, is what the method document says of
the evidence of ties that stay; these figures were seen before it was taken for stated probabilities, so what
speaks for it is what was sealed after (batch {", ".join(found["after"])}).

{_TIE_HEAD}{rows}"""


def _tie_row(part: str, row: dict[str, Any]) -> str:
    cells = [part, f"{row['nats']:.0f} nats"]
    shares = ("right_where_named", "set_holds_truth_where_tied", "right_set_of_3_around_7")
    cells += [f"{row[key]['hits']} of {row[key]['n']} ({row[key]['share']:.2f})" for key in shares]
    cells += [str(row["sets_of_4_and_more"]), f"{row['named_over_ceiling']['value']:.2f}"]
    lost = row["no_longer_alone_was_right"]
    return f"| {' | '.join([*cells, f'{lost["hits"]} of {lost["n"]}'])} |\n"
