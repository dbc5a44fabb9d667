"""What every command does with its results: options for it, and the telling."""

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cyclopts import Parameter

from skred.cli.options import Force, Json, Out, Quiet

if TYPE_CHECKING:
    from skred.output import ResultsFolder

REPORT = "report.html"
"""The page of a folder of results."""


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Output:
    """Options of a command that writes a folder: ``output: Output = OUTPUT`` gives it all of them."""

    out: Out = None
    force: Force = False
    as_json: Json = False
    quiet: Quiet = False

    @property
    def silent(self) -> bool:
        """Whether stages and progress are kept from stderr."""
        return self.quiet or self.as_json

    @property
    def progress(self) -> bool:
        """Whether a sampler shows its progress."""
        return sys.stderr.isatty() and not self.silent

    @contextmanager
    def results(self, command: str, name: str | None = None) -> "Iterator[ResultsFolder]":
        """Where the results go; see `skred.output.results_folder`."""
        from skred.output import results_folder

        with results_folder(self.out, command, force=self.force, name=name) as results:
            yield results

    def tell(self, line: str) -> None:
        """Tell of one stage, on stderr."""
        if not self.silent:
            print(line, file=sys.stderr, flush=True)

    def show(
        self,
        result: dict[str, Any],
        table: Callable[[Any], Any],
        sentences: list[str],
        where: Path,
        first: Sequence[str] = (),
    ) -> None:
        """Write a result to stdout: as JSON, or as its table, what it says, and where the rest is.

        Of the sentences, those to be read `first` stand before the table.
        """
        from skred.output import plain

        if self.as_json:
            write_json(plain(result))
        elif not self.quiet:
            show_table(table(result), sentences, where, first)


OUTPUT = Output()
"""What a command does unless told otherwise."""


def show_table(table: Any, sentences: list[str], where: Path, first: Sequence[str] = ()) -> None:
    """A table, what it says, and where the rest is."""
    from rich.console import Console
    from rich.text import Text

    console = Console()
    for sentence in first:
        console.print(Text(sentence, style="bold"))
    console.print(table)
    for sentence in sentences:
        if sentence not in first:
            console.print(Text(sentence))
    page = where / REPORT
    console.print(Text(f"\nwritten: {page if page.is_file() else where}"), soft_wrap=True)


def write_json(document: dict[str, Any]) -> None:
    """Write a document to stdout, in ASCII so that every terminal and pipe takes it."""
    print(json.dumps(document, indent=2))
