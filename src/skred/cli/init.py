"""``skred init``: a folder to start from.

Everything heavy is imported inside the function, so that ``--help`` is instant.
"""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from skred.cli.exit_codes import DONE
from skred.cli.options import Quiet, ReplaceCampaign


def init(
    folder: Annotated[Path, Parameter(name="dir", help="Folder for the campaign: new or empty.")],
    /,
    *,
    force: ReplaceCampaign = False,
    quiet: Quiet = False,
) -> int:
    """Write a filled example of a campaign, commented, to replace with your own recordings."""
    from skred.campaign.template import FILES, write_template

    write_template(folder, force=force)
    if not quiet:
        print(f"written: {folder} ({', '.join(FILES)})")
        print(f"It is a filled example. README.txt says what each column is; then: skred validate {folder}")
    return DONE
