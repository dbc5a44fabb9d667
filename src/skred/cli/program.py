"""A program of commands, run to its exit code; what goes wrong is told on stderr, never by a traceback."""

import os
import signal
import sys
import tempfile
import threading
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

from cyclopts import App, CycloptsError

from skred.cli.exit_codes import BAD_INPUT, DONE, FAULT, INTERRUPTED, MEANING, TERMINATED
from skred.cli.terminal import write_what_it_can
from skred.errors import InputError

if TYPE_CHECKING:
    from skred.campaign import CampaignError

TRACEBACK = "traceback.txt"


class Terminated(KeyboardInterrupt):
    """SIGTERM. A run ends as by Ctrl-C: with what it started, and keeping what was finished."""


def new_program(name: str, purpose: str) -> App:
    """A command line; `exit_code_of` decides what an interruption means, the same for every command."""
    return App(
        name=name,
        help=f"{purpose}\n\n{MEANING}",
        version=lambda: version("skred"),
        result_action="return_value",
        suppress_keyboard_interrupt=False,
    )


def run_program(arguments: list[str], program: App) -> int:
    """Run one command and return its exit code; what is wrong is told on stderr."""
    return exit_code_of(lambda: program(arguments, exit_on_error=False))


def exit_code_of(work: Callable[[], object]) -> int:
    """Do something and return what it ends with; whatever goes wrong is told on stderr.

    Parameters
    ----------
    work : callable
        Its result is the exit code, if it is a whole number.
    """
    write_what_it_can(sys.stdout, sys.stderr)
    try:
        with _terminated_by_exception():
            code = work()
        sys.stdout.flush()
    except CycloptsError:
        return BAD_INPUT  # cyclopts has told what is wrong
    except InputError as error:
        _tell_bad_input(error)
        return BAD_INPUT
    except KeyboardInterrupt as error:
        print(f"interrupted{_what_is_left(error)}", file=sys.stderr)
        return TERMINATED if isinstance(error, Terminated) else INTERRUPTED
    except BrokenPipeError:
        _discard_output()  # its reader, such as `head`, has seen enough
        return DONE
    except OSError as error:
        _discard_output()
        print(f"cannot read or write: {error}{_what_is_left(error)}", file=sys.stderr)
        return BAD_INPUT
    except Exception as error:
        _tell_fault(error)
        return FAULT
    return code if isinstance(code, int) else DONE


@contextmanager
def _terminated_by_exception() -> Iterator[None]:
    """Raise what SIGTERM means, so that contexts are left and workers end; by itself it would leave them."""

    def end(number: int, frame: object) -> None:
        raise Terminated

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _tell_bad_input(error: InputError) -> None:
    """Say what is wrong with the input: of a campaign, all of it."""
    from skred.campaign.problems import CampaignError

    if isinstance(error, CampaignError):
        _tell_problems(error)
    else:
        print(f"error: {error}{_what_is_left(error)}", file=sys.stderr)


def _tell_problems(error: "CampaignError") -> None:
    """List what is wrong with a campaign."""
    from skred.campaign.problems import problem_lines

    count = len(error.problems)
    print(f"{count} {'problem' if count == 1 else 'problems'}:", file=sys.stderr)
    for line in problem_lines(error.problems):
        print(f"  {line}", file=sys.stderr)


def _what_is_left(error: BaseException) -> str:
    """Where a run that ended half-way left what it had written."""
    from skred.output import left_by

    left = left_by(error)
    return "" if left is None else f"; what was finished is in {left}"


def _tell_fault(error: Exception) -> None:
    """Say in one line that the fault is ours, and where the rest is."""
    what = " ".join(f"{type(error).__name__}: {error}".split())[:200]
    print(f"a fault of skred, not of the input ({what}); {_written_traceback(error)}", file=sys.stderr)


def _written_traceback(error: Exception) -> str:
    """Write a traceback beside what was finished, otherwise into a temporary file; returns where it is."""
    from skred.output import left_by

    left = left_by(error)
    places = [left / TRACEBACK] if left is not None else []
    text = "".join(traceback.format_exception(error))
    for file in (*places, None):
        try:
            return f"the traceback is in {_write(file, text)}"
        except OSError:
            continue
    return "its traceback could not be written"


def _write(file: Path | None, text: str) -> Path:
    """Write a text, into a new temporary file where no other is given."""
    if file is None:
        number, name = tempfile.mkstemp(prefix="skred-traceback-", suffix=".txt")
        os.close(number)
        file = Path(name)
    file.write_text(text, encoding="utf-8", errors="backslashreplace")
    return file


def _discard_output() -> None:
    """Where stdout cannot be written, send what is in its buffer nowhere; Python would fail again at exit."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
