"""No circle of imports in a room, not even one that is hidden inside functions."""

from __future__ import annotations

import ast
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import skred
from skred.inference.calibrate import calibrate
from skred.inference.hierarchical.problem import HierarchicalProblem
from skred.inference.pooled.problem import PooledProblem
from skred.inference.results import predictive, summary

PACKAGE = Path(skred.__file__).resolve().parent


def imports_of(file: Path) -> set[str]:
    """Modules that a file imports, anywhere in it."""
    found = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            found |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return found


@pytest.mark.parametrize("room", ["inference", "model_selection", "prediction", "diagnosis/augment"])
def test_imports_of_a_room_have_an_order(room: str) -> None:
    files = {
        ".".join(("skred", *file.relative_to(PACKAGE).with_suffix("").parts)): file
        for file in (PACKAGE / room).rglob("*.py")
        if file.name != "__init__.py"
    }
    assert len(files) > 3
    graph = {name: (imports_of(file) & files.keys()) - {name} for name, file in files.items()}
    assert set(TopologicalSorter(graph).static_order()) == files.keys()  # raises where there is a circle


def test_results_are_registered_with_the_calibration() -> None:
    assert calibrate.__module__ == "skred.inference.calibrate"
    for generic in (predictive, summary):
        assert {PooledProblem, HierarchicalProblem} <= generic.registry.keys()
    with pytest.raises(TypeError, match="of type str"):
        summary("no problem", None, None)


def test_an_augmented_problem_is_not_taken_for_a_hierarchical_one() -> None:
    from skred.diagnosis.augment.augmented import augmented_problem
    from skred.diagnosis.augment.problem import AugmentedProblem

    assert augmented_problem.__module__ == "skred.diagnosis.augment.augmented"
    assert predictive.dispatch(AugmentedProblem) is not predictive.dispatch(HierarchicalProblem)
