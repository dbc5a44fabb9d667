"""A small campaign that has everything the format knows, as text, for tests to break."""

from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

TEXTS = {
    "campaign.toml": (
        "format = 1\n"
        'name = "small"\n'
        'description = "three avalanches"\n'
        'source = "made up"\n'
        'origin = "simulated"\n'
        "reference_s_m = 100.0\n"
    ),
    "track.csv": "x_m,z_m,width_m\n0,300,10\n60,220,12\n120,140,15\n180,110,20\n300,100,30\n",
    "sensors.csv": (
        "sensor,quantity,s_from_m,s_to_m,relative_sd,absolute_sd\n"
        "upper,front_velocity,100,100,0.1,1\n"
        "span,front_velocity,120,200,0.1,1\n"
        "lower,front_velocity,250,250,0.1,0\n"
        "stop,runout,,,0,10\n"
    ),
    "events.csv": (
        "event,release_s_m,release_sd_m,snow_temperature_degC,snow_type\n"
        "first,0,5,-3.5,dry\n"
        "second,10,,,wet\n"
        "third,5,2.5,-8,\n"
    ),
    "recordings.csv": (
        "event,sensor,value,sd,status\n"
        "first,upper,30,,observed\n"
        "first,span,25,3,observed\n"
        "first,lower,10,,observed\n"
        "first,stop,320,,observed\n"
        "second,upper,20,,observed\n"
        "second,span,,,not_reached\n"
        "second,lower,,,not_reached\n"
        "second,stop,180,20,observed\n"
        "third,upper,,,missing\n"
        "third,stop,,,missing\n"
    ),
}

WriteFolder = Callable[[Mapping[str, str | bytes]], Path]


def write_texts(folder: Path, texts: Mapping[str, str | bytes]) -> Path:
    """Write the files of a campaign, as they are, into a folder that may exist."""
    folder.mkdir(exist_ok=True)
    for file, text in texts.items():
        (folder / file).write_bytes(text if isinstance(text, bytes) else text.encode())
    return folder


@pytest.fixture(scope="session")
def texts() -> Mapping[str, str]:
    """Texts of the five files."""
    return dict(TEXTS)


@pytest.fixture
def folder_with(tmp_path: Path) -> WriteFolder:
    """Write the small campaign with some files replaced."""

    def write(replaced: Mapping[str, str | bytes]) -> Path:
        return write_texts(tmp_path / "small", {**TEXTS, **replaced})

    return write


@pytest.fixture
def write_files() -> Callable[[Path, Mapping[str, str | bytes]], Path]:
    """Write any files into a folder."""
    return write_texts
