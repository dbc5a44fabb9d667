"""Results that the pages are made of."""

from typing import Any

from benchmarks.files import RESULTS, read


def result_of(name: str) -> Any:
    """Content of a result file."""
    return read(RESULTS / f"{name}.json")
