"""Sections of studies/README.md about masked and open effects."""

from typing import Any

from studies.files import RESULTS, read


def sections() -> str:
    """All of them."""
    return masked_open() + masked_ceiling()


def masked_open() -> str:
    """Masked and open effects of like signal-to-noise."""
    found = read(RESULTS / "masked_open.json")
    tables = "".join(
        f"\n{title}:\n\n| signal-to-noise | all | sparse | dense |\n| --- | --- | --- | --- |\n"
        + "".join(
            f"| {span} | {' | '.join(kinds.values())} |\n" for span, kinds in found["summary"][arm].items()
        )
        for arm, title in (
            ("any", "Masked ones beside an open effect of any listed mechanism"),
            ("same", "Masked ones beside an open effect of the same mechanism"),
        )
    )
    before = "".join(
        f"| {one['source']} | {one['seed']} | {kinds['all']} | {kinds['sparse']} | {kinds['dense']} |\n"
        for one in read(RESULTS / "alarms_before.json")["masked_open"]
        for kinds in (one["summary"]["5.5 to 12"], one["summary"]["2 to 12, evenly"])
        if "too few" not in kinds["sparse"]
    )
    seen = read(RESULTS / "alarms_before.json")["masked_open"][1]["looks"]
    weak = sum(name < "1000" for name in found["trials"])
    strong = len(found["trials"]) - weak
    return f"""
## Masked and open effects

`python -m studies.masked.open weak --n {weak}` and `python -m studies.masked.open strong --n {strong}`
(seeds from {found["seed"]}, code {", ".join(found["commits"])}): simulated campaigns with a masked effect
(the calibrated law is right on average at every sensor), and beside each two with an open effect of the
signal-to-noise that the masked one turned out to have: one of any listed mechanism, and one of the same, of
the same base law and a track of the same family. (Masked ones have a place or a covariate to be looked for.
Of the open ones of any mechanism from 2 to 5.5, {_counted(found["weak_open"]["alike everywhere"])} that act
alike everywhere were found, {_counted(found["weak_open"]["a place or a covariate"])} of the others.) Found is
where the alarm is raised; then the share of masked ones found less that of open ones (95 % by bootstrap;
asked: within 0.10), in the last two rows as if spread evenly over their signal-to-noise, part by part.
Nothing was tuned on these. Signal-to-noise is measured over readings with errors
(`skred.simulator.detectability.over_noise`).
{tables}
{_masked_by(found)}
Signal-to-noise over what the simulator sets it by, from exact readings and a prior of the spread: one in ten
is below the first, half below the second, nine in ten below the last. Sealed batches are binned by what the
simulator sets.

{_over_exact(found)}
Sets before, by earlier code; trials of the first two showed what is mended since: effects that begin
above the first sensor, the limit of the next section, and populations narrower than nodes. First of 5.5 to
12, then evenly; open ones are of any listed mechanism and of the signal-to-noise that the masked ones were
asked for, in the last two sets of what they turned out to have. The first two go by what the simulator set;
the second was ended early, after {seen} looks. All were diagnosed with a limit of 0.1 or less.

| code | seeds from | all | sparse | dense |
| --- | --- | --- | --- | --- |
{before}"""


def masked_ceiling() -> str:
    """What masked effects are found less often by at best."""
    found = read(RESULTS / "masked_ceiling.json")
    rows = "".join(
        f"| {kind} | {span} | {' | '.join(row.values())} |\n"
        for kind, spans in found["summary"].items()
        for span, row in spans.items()
    )
    return f"""
### What masked effects are found less often by at best

`python -m studies.masked.ceiling` ({found["campaigns"]} campaigns as those above, code {found["commit"]}):
effects hidden in the linear model itself, candidates of the diagnosis with their own shapes and of exactly
the signal-to-noise drawn, evenly from 2 to 12. Odds of anything against nothing are in closed form there,
with the diagnosis's prior odds and its limit, so nothing is lost by templates, curved likelihoods or
numerics: what is left is the price of what has to be looked for besides. Shares found, and those of masked
effects less those of open ones (95 %, over campaigns).

| recordings | signal-to-noise | masked | open, any | open, the same | less any | less the same |
| --- | --- | --- | --- | --- | --- | --- |
{rows}"""


def _masked_by(found: dict[str, Any]) -> str:
    rows = "".join(
        f"| {row['by']} | {row['kind']} | {row['found']} of {row['trials']}"
        f" | {row['strong_found']} of {row['strong']} |\n"
        for row in found["masked_by"]
    )
    return f"""| masked by | recordings | found | found from 5.5 on |
| --- | --- | --- | --- |
{rows}"""


def _counted(pair: list[int]) -> str:
    return f"{pair[0]} of {pair[1]}"


def _over_exact(found: dict[str, Any]) -> str:
    names = {"masked": "masked", "any": "open, of any mechanism", "same": "open, of the same mechanism"}
    rows = "".join(
        f"| {names[row['hidden']]} | {row['kind']} | {', '.join(f'{q:.2f}' for q in row['quantiles'])} |\n"
        for row in found["over_exact"]
    )
    return f"""| effect | recordings | over what the simulator sets |
| --- | --- | --- |
{rows}"""
