"""Result files of the benchmarks."""

import json
from pathlib import Path
from typing import Any

RESULTS = Path(__file__).resolve().parent.parent / "benchmarks" / "results"


def read(name: str) -> Any:
    """Content of a result file."""
    return json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))
