"""The built wheel, outside the checkout: an editable install would hide what it does not carry."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the unpacked wheel."""
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder / "site")
    return folder / "site"


def run(site: Path, *arguments: str) -> str:
    environment = {**os.environ, "PYTHONPATH": str(site)}
    done = subprocess.run(
        [sys.executable, *arguments],
        cwd=site.parent,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_wheel_is_what_runs(installed: Path) -> None:
    code = "import skred, models.pcm; print(skred.__file__); print(models.pcm.__file__)"
    assert all(Path(line).is_relative_to(installed) for line in run(installed, "-c", code).splitlines())


@pytest.mark.parametrize("campaign", ["ryggfonn", "ryggfonn-with-dam"])
def test_embedded_campaigns_travel_along(installed: Path, campaign: str) -> None:
    code = f"from skred.campaign import *; print(find_campaign({campaign!r}))"
    assert Path(run(installed, "-c", code).strip()).is_relative_to(installed)
    said = run(installed, "-m", "skred.cli", "validate", campaign)
    assert f"{campaign} (measured): " in said and "3 of front speed, and the runout" in said


def test_templates_travel_along(installed: Path) -> None:
    assert list((installed / "skred" / "report" / "templates").glob("*.jinja"))


def test_the_example_of_init_travels_along(installed: Path, tmp_path: Path) -> None:
    run(installed, "-m", "skred.cli", "init", str(tmp_path / "new"))
    assert "no problems" in run(installed, "-m", "skred.cli", "validate", str(tmp_path / "new"))


def test_laws_are_registered(installed: Path) -> None:
    code = "from skred.physics.laws import *; print(*[load_law(law).id for law in law_ids()])"
    assert run(installed, "-c", code).split() == ["constant", "coulomb", "pcm", "voellmy"]


def test_models_run_as_programs(installed: Path) -> None:
    assert "--campaign" in run(installed, "-m", "models.pcm", "--help")
