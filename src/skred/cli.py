"""The command line: ``skred COMMAND``.

A command is a function decorated with ``@app.command`` that returns its exit code: 0 done, 1 the gate failed,
2 bad input. Everything heavy is imported inside the functions, so that ``--help`` is instant.
"""

import json
import os
import sys
from importlib.metadata import version
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, CycloptsError, Parameter

if TYPE_CHECKING:
    from skred.campaign import Campaign, CampaignError

DONE, BAD_INPUT, INTERRUPTED = 0, 2, 130

app = App(
    name="skred",
    help="Calibrate avalanche models against recordings, and find the physics that they miss.",
    version=lambda: version("skred"),
    result_action="return_value",
    # main() decides what an interruption means, the same for every command.
    suppress_keyboard_interrupt=False,
)

Quiet = Annotated[bool, Parameter(name="--quiet", negative="")]
Json = Annotated[bool, Parameter(name="--json", negative="")]


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit.

    Parameters
    ----------
    arguments : list of str, optional
        The words after ``skred``; by default those of this process.
    """
    sys.exit(run(sys.argv[1:] if arguments is None else arguments))


def run(arguments: list[str]) -> int:
    """Run one command and return its exit code; what is wrong with the input is told on stderr."""
    try:
        code = app(arguments, exit_on_error=False)
        sys.stdout.flush()
    except CycloptsError:
        return BAD_INPUT  # cyclopts has told what is wrong
    except ValueError as error:
        from skred.campaign.problems import CampaignError

        if not isinstance(error, CampaignError):
            raise
        _tell_problems(error)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        _discard_output()  # its reader, such as `head`, has seen enough
        return DONE
    except OSError as error:
        _discard_output()
        print(f"cannot read or write: {error}", file=sys.stderr)
        return BAD_INPUT
    return code if isinstance(code, int) else DONE


@app.command
def validate(campaign: str, /, *, as_json: Json = False, quiet: Quiet = False) -> int:
    """Check the files of a campaign and list every problem.

    Parameters
    ----------
    campaign
        A folder, or the name of an embedded campaign.
    as_json
        Write the result as JSON to stdout.
    quiet
        Write nothing if all is well.
    """
    from skred.campaign import CampaignError, find_campaign, read_campaign

    try:
        checked = read_campaign(find_campaign(campaign))
    except CampaignError as error:
        if not as_json:
            raise
        _write_json({"valid": False, "problems": [problem.as_dict() for problem in error.problems]})
        return BAD_INPUT
    if as_json:
        _write_json({"valid": True, "problems": [], **_summary(checked)})
    elif not quiet:
        _show_summary(_summary(checked))
    return DONE


def _discard_output() -> None:
    """Send what is still in stdout's buffer nowhere; Python would fail again to write it at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _summary(campaign: "Campaign") -> dict[str, Any]:
    """Count what a campaign holds."""
    from skred.campaign import Status

    return {
        "name": campaign.name,
        "origin": campaign.origin,
        "events": campaign.n_events,
        "sensors": campaign.n_sensors,
        "readings": {status.name.lower(): int((campaign.status == status).sum()) for status in Status},
        "covariates": sorted({name for event in campaign.events for name in event.covariates}),
        "track_points": len(campaign.track.x_m),
        "track_length_m": campaign.track.length_m,
        "reference_s_m": campaign.reference_s_m,
        "fingerprint": campaign.fingerprint(),
    }


def _show_summary(summary: dict[str, Any]) -> None:
    """Show the summary as a table."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    readings = ", ".join(
        f"{count} {status.replace('_', ' ')}" for status, count in summary["readings"].items()
    )
    reference = summary["reference_s_m"]
    rows = {
        "campaign": f"{summary['name']} ({summary['origin']}): no problems",
        "events": str(summary["events"]),
        "sensors": str(summary["sensors"]),
        "readings": readings,
        "covariates": ", ".join(summary["covariates"]) or "none",
        "track": f"{summary['track_length_m']:.1f} m, {summary['track_points']} points",
        "reference": "none" if reference is None else f"s = {reference:.1f} m",
    }
    table = Table(box=None, show_header=False)
    for name, text in rows.items():
        # Text, because names come from a file and may look like rich's markup.
        table.add_row(Text(name, style="bold"), Text(text))
    Console().print(table)


def _tell_problems(error: "CampaignError") -> None:
    """List what is wrong, on stderr."""
    from skred.campaign.problems import problem_lines

    count = len(error.problems)
    print(f"{count} {'problem' if count == 1 else 'problems'}:", file=sys.stderr)
    for line in problem_lines(error.problems):
        print(f"  {line}", file=sys.stderr)


def _write_json(document: dict[str, Any]) -> None:
    """Write a document to stdout, in ASCII so that every terminal and pipe takes it."""
    print(json.dumps(document, indent=2))


if __name__ == "__main__":
    main()
