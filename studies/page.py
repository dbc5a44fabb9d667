"""Write studies/README.md from the result files: ``python -m studies.page``."""

import cyclopts

from skred.output import write_text
from studies.another_hand import page as another_hand
from studies.files import ROOT
from studies.masked import page as masked
from studies.thresholds import page as thresholds

HEAD = """# Studies

What was done once: the reproduction of the paper, the limits of the diagnosis and what they were set by,
Ryggfonn, and the record of concealed trials. What is measured again is in
[benchmarks](../benchmarks/README.md). `python -m studies.page` wrote this page from `studies/results/`.

| command | what it does |
| --- | --- |
| `python -m studies.reproduction` | computes every number of [the reproduction](../docs/reproduction.md) |
| `python -m studies.ryggfonn` | diagnoses [Ryggfonn](../docs/ryggfonn.md) under each base law |
| `python -m studies.ryggfonn.build_campaigns` | builds the embedded campaigns from the raw figures |
| `python -m studies.proof` | writes [the record](../docs/proof.md) of trials; `--add DIR` adds some |
| `python -m studies.another_hand` | diagnoses campaigns that were simulated by another hand |
| `python -m studies.thresholds.alarm` | how often clean campaigns pass the alarm's limit |
| `python -m studies.thresholds.nothing_at_most` | how probable nothing may be beside an alarm |
| `python -m studies.thresholds.tie_rules` | which names are tied with the leading one |
| `python -m studies.thresholds.compared_again` | compares opened trials again with the present code |
| `python -m studies.thresholds.calibrate_odds` | chooses the tempering exponent by those |
| `python -m studies.thresholds.strength_forms` | what the form of a term adds to its uncertainty |
| `python -m studies.thresholds.line_nodes` | quadrature points of one free coefficient |
| `python -m studies.thresholds.event_nodes` | quadrature points of several free coefficients |
| `python -m studies.thresholds.unseen_nodes` | quadrature points of a held-out avalanche |
| `python -m studies.thresholds.free_force_draws` | draws for the evidence of a force not in the list |
| `python -m studies.thresholds.left_out` | three ways to the left-out score of a base law |
| `python -m studies.masked.open` | how often masked and open effects are found |
| `python -m studies.masked.ceiling` | how often they could be found at best |
| `python -m studies.masked.relief` | what an unknown place costs a masked effect |
"""
app = cyclopts.App(help=__doc__)


@app.default
def main() -> None:
    """Write the page."""
    write_text(
        ROOT / "studies" / "README.md",
        HEAD + another_hand.sections() + thresholds.sections() + masked.sections(),
    )


if __name__ == "__main__":
    app()
