"""``skred dashboard``: results of several runs in one page, served on this machine or written as a file.

Everything heavy is imported inside the function, so that ``--help`` is instant.
"""

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter, validators

from skred.cli.exit_codes import DONE
from skred.cli.options import Quiet
from skred.errors import InputError

Shown = Annotated[
    Path,
    Parameter(
        help="Folders of calibrate, compare or diagnose, folders of netCDF files of ArviZ, or such files.",
    ),
]
Export = Annotated[
    Path | None,
    Parameter(help="Write one page that needs neither network nor server, instead of serving it."),
]
Port = Annotated[
    int,
    Parameter(validator=validators.Number(gte=0, lte=65535), help="Port to serve on; 0 for any free one."),
]
Replace = Annotated[
    bool, Parameter(name="--force", negative="", help="Replace the file of --export, where it is there.")
]
NoOpen = Annotated[bool, Parameter(name="--no-open", negative="", help="Do not open a browser.")]


def dashboard(
    *places: Shown,
    export: Export = None,
    force: Replace = False,
    port: Port = 0,
    no_open: NoOpen = False,
    quiet: Quiet = False,
) -> int:
    """Show results of several runs in one page: draws, checks, comparisons, speeds, candidates.

    The page is served to this machine only, until Ctrl-C. One event can be followed through all views.
    Needs the extra `dashboard`: pip install 'skred[dashboard]'.
    """
    from skred.extras import require

    if not places:
        raise InputError("nothing to show; give folders of results, or netCDF files of ArviZ")
    require("dashboard")
    from skred.dashboard.export import check_target
    from skred.dashboard.export import export as write_page
    from skred.dashboard.reading import read_given

    if export is not None:
        check_target(export, force=force)
    given = read_given(places)
    tell = (lambda line: None) if quiet else _tell
    for trouble in given.troubles:
        tell(f"not shown: {trouble.message}")
    if export is not None:
        print(write_page(given, export, tell, force=force))
        return DONE
    from skred.dashboard.serve import serve

    serve(given, port=port, open_browser=not no_open, tell=tell)
    return DONE


def _tell(line: str) -> None:
    print(line, file=sys.stderr)
