"""The campaign that `skred init` copies: five filled files, and a README.txt on their columns."""

from importlib.resources import files
from pathlib import Path

from skred.campaign.writing import write_files

FILES = ("campaign.toml", "track.csv", "sensors.csv", "events.csv", "recordings.csv", "README.txt")


def write_template(folder: Path, *, force: bool = False) -> None:
    """Write the template.

    Parameters
    ----------
    folder : Path
        Must not exist, or be empty.
    force : bool
        Replace the campaign that the folder holds.

    Raises
    ------
    CampaignError
        Where the folder is in use.
    """
    own = files(__name__)
    write_files({file: (own / file).read_text(encoding="utf-8") for file in FILES}, folder, force=force)
