"""Who works on a proof in tests, and what diagnoses."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from skred.prove.plan import Plan
from skred.prove.pool import WorkerPool

FAKES = Path(__file__).parent / "fakes"
PLAN = Plan(3, 1_234_567, "sparse", nothing_share=1.0)


class Alone(WorkerPool):
    """Does everything itself, here."""

    def carry_out(self, work: Any, jobs: Any, done: Any, lost: Any) -> None:
        for job in jobs:
            done(job, work(job))


def silent(line: str) -> None:
    """Hears nothing."""


def fake(name: str) -> str:
    """A diagnosis to run instead."""
    return str(FAKES / f"{name}_diagnosis.py")
