"""Find a campaign by its folder, or by its name if it is embedded in the package."""

from difflib import get_close_matches
from pathlib import Path

from skred.campaign.cells import LONGEST_WORD
from skred.campaign.problems import CampaignError, Problem

_PACKAGE = Path(__file__).resolve().parents[1]


def _embedded_root() -> Path:
    """Return the folder of the embedded campaigns.

    A wheel carries them inside the package. An editable install does not see what a wheel is built to
    include, so there they are taken from the checkout.
    """
    in_wheel = _PACKAGE / "_campaigns"
    return in_wheel if in_wheel.is_dir() else _PACKAGE.parents[1] / "data"


def embedded_campaigns() -> tuple[str, ...]:
    """Return the names of the embedded campaigns, in alphabetical order."""
    root = _embedded_root()
    if not root.is_dir():
        return ()
    return tuple(sorted(folder.name for folder in root.iterdir() if (folder / "campaign.toml").is_file()))


def find_campaign(name_or_dir: str) -> Path:
    """Find the folder of a campaign.

    Parameters
    ----------
    name_or_dir : str
        Name of an embedded campaign, or a folder. A name means the embedded campaign also where the working
        directory has a folder of that name, so that a command does the same everywhere; ``./name`` is the
        folder.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    CampaignError
        Where there is neither; lists the embedded names.
    """
    name = str(name_or_dir)
    embedded = embedded_campaigns()
    if name in embedded:
        return _embedded_root() / name
    try:
        if name and Path(name).is_dir():
            return Path(name)
    except (OSError, ValueError):
        pass  # not a path at all, such as one with a NUL byte or thousands of characters
    names = ", ".join(embedded) or "none"
    near = get_close_matches(name[:LONGEST_WORD], embedded, n=1)
    meant = f"is '{near[0]}' meant? Otherwise " if near else ""
    message = f"neither a folder nor an embedded campaign; {meant}give a folder, or one of: {names}"
    raise CampaignError([Problem(name or "(empty)", None, None, None, message)])
