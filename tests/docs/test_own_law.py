"""The page of laws from other packages: its code is a law that runs, is found, and may be sampled."""

from __future__ import annotations

import ast
import re
import runpy
import tomllib
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from skred.inference.sampling import sample_prior
from skred.physics.geometry import WEAKENING_SPEED_M_S
from skred.physics.law import Law
from skred.physics.laws import GROUP, law_ids, load_law
from skred.physics.mechanisms import coulomb_friction, mechanisms

PAGE = (Path(__file__).parents[2] / "docs" / "own-law.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", PAGE, re.M | re.S)


CODE = "\n\n".join(blocks("python"))


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> EntryPoint:
    """The page's package, as an installer leaves it."""
    project = tomllib.loads("".join(blocks("toml")))["project"]
    ((name, value),) = project["entry-points"][GROUP].items()
    entry = EntryPoint(name, value, GROUP)
    file = tmp_path / Path(*entry.module.split(".")).with_suffix(".py")
    file.parent.mkdir()
    file.write_text(CODE, encoding="utf-8")
    metadata = tmp_path / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n", encoding="utf-8"
    )
    (metadata / "entry_points.txt").write_text(f"[{GROUP}]\n{name} = {value}\n", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    return entry


@pytest.fixture
def law(installed: EntryPoint) -> Law:
    assert installed.name in law_ids()
    return load_law(installed.name)


def test_the_law_is_found_by_its_id(installed: EntryPoint, law: Law) -> None:
    assert law.id == installed.name
    assert f"--models pcm,{law.id}" in PAGE and f"--base-model {law.id}" in PAGE


def test_its_front_runs(law: Law, problem: Any) -> None:
    def readings(time_s: float) -> Any:
        rows = np.array([law.strengths(0.25, time_s)])
        return problem.simulate(law.mechanisms, rows)[0, 0]

    usual, weak = readings(20.0), readings(200.0)
    assert np.isfinite(usual).all() and (usual > 0.0).all()
    assert (weak > usual).all()


@pytest.mark.slow
def test_its_prior_and_its_density(law: Law, problem: Any) -> None:
    model = law.build(problem)
    assert [variable.name for variable in model.free_RVs] == law.parameter_names
    prior = sample_prior(model, law, 0, draws=200)
    rows = law.strength_rows({name: prior[name].values for name in law.parameter_names})
    assert rows.shape == (200, len(law.mechanisms)) and (rows > 0.0).all()
    back = law.parameter_rows(rows)
    for name in law.parameter_names:
        np.testing.assert_allclose(back[name], prior[name].values.ravel())
    assert np.isfinite(model.compile_logp()(model.initial_point()))


def test_it_runs_as_a_program(tmp_path: Path, capsys: pytest.CaptureFixture[str], problem: Any) -> None:
    file = tmp_path / "program.py"
    file.write_text(CODE, encoding="utf-8")
    runpy.run_path(str(file), run_name="__main__")
    assert len(capsys.readouterr().out.strip("[] \n").split()) == problem.campaign.n_sensors


def test_the_law_takes_under_40_lines_of_code() -> None:
    law = CODE.partition("if __name__")[0]
    said = [
        node.body[0] for node in ast.walk(ast.parse(law)) if isinstance(node, ast.FunctionDef | ast.Module)
    ]
    docstrings = {line for node in said for line in range(node.lineno, (node.end_lineno or 0) + 1)}
    lines = enumerate(law.splitlines(), start=1)
    assert sum(bool(line.strip()) and number not in docstrings for number, line in lines) < 40


def test_the_table_lists_what_a_law_can_be_made_of() -> None:
    can = {f"{name}.MECHANISM" for name, one in mechanisms().items() if one.column is not None}
    assert coulomb_friction.WITHOUT_CURVATURE.column is not None
    can |= {"coulomb_friction.WITHOUT_CURVATURE"}
    assert set(re.findall(r"^\| `(\w+\.\w+)` \|", PAGE, re.M)) == can
    assert f"U_c = {WEAKENING_SPEED_M_S:g} m/s" in PAGE
