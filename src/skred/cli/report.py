"""``skred report``: page and figures of a folder of results, made anew from its documents.

Everything heavy is imported inside the function, so that ``--help`` is instant.
"""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from skred.cli.exit_codes import DONE
from skred.cli.options import Json, Quiet
from skred.cli.output import write_json

Results = Annotated[
    Path,
    Parameter(
        help="A folder written by diagnose, compare, predict, prove, a law that was calibrated, or track."
    ),
]


def report(folder: Results, /, *, as_json: Json = False, quiet: Quiet = False) -> int:
    """Make the report and the figures of a folder of results anew, from the documents in it."""
    from skred.report.folders import write_reports

    written = write_reports(folder)
    if as_json:
        write_json({"written": [str(file) for file in written]})
    elif not quiet:
        for file in written:
            print(file)
    return DONE
