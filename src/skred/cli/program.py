"""A program of commands, run to its exit code; what goes wrong is told on stderr, never by a traceback."""

import os
import sys
from importlib.metadata import version
from typing import TYPE_CHECKING

from cyclopts import App, CycloptsError

from skred.cli.exit_codes import BAD_INPUT, DONE, INTERRUPTED
from skred.errors import InputError

if TYPE_CHECKING:
    from skred.campaign import CampaignError


def new_program(name: str, purpose: str) -> App:
    """A command line; `run_program` decides what an interruption means, the same for every command."""
    return App(
        name=name,
        help=purpose,
        version=lambda: version("skred"),
        result_action="return_value",
        suppress_keyboard_interrupt=False,
    )


def run_program(arguments: list[str], program: App) -> int:
    """Run one command and return its exit code; what is wrong with the input is told on stderr."""
    try:
        code = program(arguments, exit_on_error=False)
        sys.stdout.flush()
    except CycloptsError:
        return BAD_INPUT  # cyclopts has told what is wrong
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return BAD_INPUT
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


def _discard_output() -> None:
    """Send what is still in stdout's buffer nowhere; Python would fail again to write it at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _tell_problems(error: "CampaignError") -> None:
    """List what is wrong, on stderr."""
    from skred.campaign.problems import problem_lines

    count = len(error.problems)
    print(f"{count} {'problem' if count == 1 else 'problems'}:", file=sys.stderr)
    for line in problem_lines(error.problems):
        print(f"  {line}", file=sys.stderr)
