"""The command line: ``skred COMMAND``.

A command is a function in a file of its own that returns its exit code, and one line here. What is heavy is
imported inside the functions, so that ``--help`` is instant.
"""

import sys

from skred.cli.calibrate import calibrate
from skred.cli.compare import compare
from skred.cli.dashboard import dashboard
from skred.cli.diagnose import diagnose
from skred.cli.identify import identify
from skred.cli.import_tables import import_
from skred.cli.init import init
from skred.cli.mechanisms import mechanisms
from skred.cli.predict import predict
from skred.cli.program import new_program, run_program
from skred.cli.prove import prove_app
from skred.cli.report import report
from skred.cli.track import track
from skred.cli.validate import validate

app = new_program(
    "skred", "Calibrate avalanche models against recordings, and find the physics that they miss."
)
app.command(init)
app.command(import_, name="import")
app.command(validate)
app.command(calibrate)
app.command(compare)
app.command(track)
app.command(predict)
app.command(diagnose)
app.command(identify)
app.command(mechanisms)
app.command(report)
app.command(dashboard)
app.command(prove_app)


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit.

    Parameters
    ----------
    arguments : list of str, optional
        The words after ``skred``; by default those of this process.
    """
    sys.exit(run(sys.argv[1:] if arguments is None else arguments))


def run(arguments: list[str]) -> int:
    """Run one command and return its exit code."""
    return run_program(arguments, app)


if __name__ == "__main__":
    main()
