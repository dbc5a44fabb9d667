"""What a comparison leaves aside as too far behind: the same comparison, in which hardly anything is.

Mechanisms, shapes, kinds of force and error models more than `COUNTS` nats behind are neither refined nor
computed again, and a shape is parted from `_HOLDS_MUCH` of its mechanism's evidence on. Here all of that goes
on to a multiple of those nats and a fraction of that share.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from importlib import import_module
from typing import Any
from unittest.mock import patch

from benchmarks.reference.engine import fitted_base
from benchmarks.reference.pairs import Drawn
from skred.diagnosis.compare.comparison import Comparison, compare
from skred.diagnosis.compare.refinement import _HOLDS_MUCH
from skred.diagnosis.evidence.tolerance import COUNTS
from skred.inference.hierarchical.problem import hierarchical_problem
from skred.physics.laws import load_law

FACTOR = 3.0
_ROOMS = (
    "compare.between",
    "compare.recomputed",
    "compare.refinement",
    "compare.candidate",
    "compare.comparison",
    "compare.residue",
    "compare.screening",
    "discrepancy.explored",
)


def look(drawn: Drawn) -> dict[str, Any] | None:
    """Probabilities and log Bayes factors as a comparison states them, and with hardly anything cut."""
    base = fitted_base(hierarchical_problem(drawn.campaign), load_law(drawn.base))
    usual = compare(base)
    with hardly_anything_cut():
        more = compare(base)
    return {
        "usual": _said(usual),
        "more": _said(more),
        "apart": 0.5 * sum(abs(usual.probability[name] - more.probability[name]) for name in usual.odds),
    }


def _said(compared: Comparison) -> dict[str, Any]:
    return {"log_factors": compared.log_factors, "probability": compared.probability}


@contextmanager
def hardly_anything_cut() -> Iterator[None]:
    """Within it, comparisons go on with what is farther behind."""
    with ExitStack() as stack:
        for room in _ROOMS:
            module = import_module(f"skred.diagnosis.{room}")
            stack.enter_context(patch.object(module, "COUNTS", FACTOR * COUNTS))
        module = import_module("skred.diagnosis.compare.refinement")
        stack.enter_context(patch.object(module, "_HOLDS_MUCH", _HOLDS_MUCH / FACTOR))
        yield
