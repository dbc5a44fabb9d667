"""``skred import``: tables as people keep them become a campaign.

Everything heavy is imported inside the functions, so that ``--help`` is instant.
"""

import sys
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from skred.cli.exit_codes import DONE
from skred.cli.options import Json, Quiet, ReplaceCampaign
from skred.cli.output import write_json
from skred.errors import InputError

if TYPE_CHECKING:
    from skred.importing import Files, Imported, Mapping, Question, Unclear

LONGEST_KEY = 500
Silences = Literal["missing", "not_reached"]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Declared:
    """Options that say what the tables do not."""

    mapping: Annotated[
        Path | None, Parameter(help="Mapping file of an earlier import (import.toml): declares the rest.")
    ] = None
    track: Annotated[
        Path | None, Parameter(help="The track of a wide table: x_m and z_m, or a profile of a GIS.")
    ] = None
    sensors: Annotated[
        Path | None, Parameter(help="Sensors of a wide table, as sensors.csv; columns have their ids.")
    ] = None
    column: Annotated[
        tuple[str, ...],
        Parameter(
            negative="",
            show_default=False,
            help="NAME=MEANING of a column, such as 'v1=front_velocity at=1650 unit=km/h'. Meanings: event, "
            "release, release_sd, front_velocity, runout, sd, covariate, ignore. May be repeated.",
        ),
    ] = ()
    blank: Annotated[Silences | None, Parameter(help="What a blank cell says of a velocity.")] = None
    dash: Annotated[Silences | None, Parameter(help="What a dash says of a velocity.")] = None
    word: Annotated[
        tuple[str, ...],
        Parameter(negative="", show_default=False, help="WORD=missing or WORD=not_reached. May be repeated."),
    ] = ()
    runout: Annotated[
        Literal["s", "x", "altitude", "reference"] | None,
        Parameter(help="How runouts are given; reference: as distance along the track from there."),
    ] = None
    reference: Annotated[float | None, Parameter(help="The reference, arc length s, m.")] = None
    encoding: Annotated[str | None, Parameter(help="Of texts that are not UTF-8, such as latin-1.")] = None
    separator: Annotated[
        str | None, Parameter(help="Between columns, where the first row does not tell.")
    ] = None
    decimal: Annotated[str | None, Parameter(help="Decimal sign, where the numbers do not tell.")] = None
    sheet: Annotated[
        tuple[str, ...],
        Parameter(
            negative="", show_default=False, help="Of a workbook with several; * for all. May be repeated."
        ),
    ] = ()
    name: Annotated[str | None, Parameter(help="The campaign's name; by default the file's.")] = None
    set_: Annotated[
        tuple[str, ...],
        Parameter(
            name="--set",
            negative="",
            show_default=False,
            help="KEY=VALUE of the mapping file, such as velocity.absolute_sd=1. May be repeated.",
        ),
    ] = ()

    def values(self) -> dict[tuple[str, ...], Any]:
        """What the options declare, by the mapping file's keys."""
        own = {
            ("cells", "blank"): self.blank,
            ("cells", "dash"): self.dash,
            ("runout", "place"): self.runout,
            ("campaign", "reference_s_m"): self.reference,
            ("campaign", "name"): self.name,
            ("table", "encoding"): self.encoding,
            ("table", "separator"): self.separator.replace("\\t", "\t") if self.separator else None,
            ("table", "decimal"): self.decimal,
            ("table", "sheet"): list(self.sheet) or None,
        }
        found: dict[tuple[str, ...], Any] = {k: value for k, value in own.items() if value is not None}
        if self.encoding is not None:
            found["track", "encoding"] = self.encoding
        for text in self.word:
            word, sign, value = text.rpartition("=")  # a word may be a sign, such as >=
            if not sign or not word:
                raise InputError(f"--word '{text}': expected WORD=missing or WORD=not_reached")
            found["cells", "words", word] = value
        for text in self.set_:
            key, value = _pair(text, "--set")
            found[_parts(key)] = value
        return found


def _parts(key: str) -> tuple[str, ...]:
    """The parts of a mapping file's key; parts with points in them stand in quotes, as in TOML."""
    try:
        content: Any = tomllib.loads(f"{key} = 0") if len(key) <= LONGEST_KEY and "\n" not in key else {}
    except tomllib.TOMLDecodeError:
        content = {}
    parts = list[str]()
    while isinstance(content, dict) and content:
        [(part, content)] = content.items()
        parts.append(part)
    if not parts:
        raise InputError(f"--set {key[:LONGEST_KEY]}: expected a key of a mapping file, such as release.s_m")
    return tuple(parts)


DECLARED = Declared()


def import_(
    *files: Annotated[
        Path, Parameter(help="One or several tables, or files of the campaign format, or their folder.")
    ],
    out: Annotated[
        Path | None, Parameter(help="Folder for the campaign; without it nothing is written.")
    ] = None,
    declared: Declared = DECLARED,
    yes: Annotated[
        bool, Parameter(name=["--yes", "-y"], negative="", help="Write what is shown, without asking.")
    ] = False,
    force: ReplaceCampaign = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Make a campaign from CSV or Excel tables; shows what was understood before it writes.

    A wide table has a row for each avalanche and a column for each sensor. Several tables become one
    campaign, and rows of one avalanche belong together. Beside the campaign a mapping file is written: with
    --mapping the next table imports without questions.
    """
    from skred.campaign.writing import require_free
    from skred.importing import Files, write_imported

    if not files:
        raise InputError("no files; give a table, or a folder with files of the campaign format")
    if out is not None:
        require_free(out.resolve(), force)  # before anybody is asked anything
    imported = _answered(Files(files, declared.track, declared.sensors, declared.mapping), declared)
    if as_json:
        from skred.campaign.summary import campaign_summary

        written = None if out is None else str(out)
        write_json(
            {
                **imported.understanding.as_dict(),
                "campaign": campaign_summary(imported.campaign),
                "out": written,
            }
        )
    elif not quiet:
        from rich.console import Console

        Console().print(imported.understanding.tables())
    if out is None:
        _tell("nothing was written; add --out FOLDER", quiet or as_json)
        return DONE
    if imported.understanding.guessed and not yes:
        _require_yes(imported)
    write_imported(imported, out, force=force)
    _tell(
        f"written: {out} (mapping file: {out / 'import.toml'}); next: skred validate {out}", quiet or as_json
    )
    return DONE


def _tell(line: str, silent: bool) -> None:
    if not silent:
        print(f"\n{line}")


def _pair(text: str, option: str) -> tuple[str, str]:
    """A ``KEY=VALUE`` of the command line."""
    key, sign, value = text.partition("=")
    if not sign or not key:
        raise InputError(f"{option} '{text}': expected KEY=VALUE")
    return key, value


def _answered(files: "Files", options: Declared) -> "Imported":
    """Import; what is not clear is asked about where somebody can answer."""
    from skred.importing import Mapping, Unclear, import_tables, read_mapping

    declared = Mapping() if files.mapping is None else read_mapping(files.mapping)
    declared = declared.with_values(options.values())
    while True:
        try:
            return import_tables(files, declared, options.column)
        except Unclear as unclear:
            if not _can_ask():
                raise
            declared = _asked(unclear, declared)


def _can_ask() -> bool:
    return sys.stdin.isatty() and sys.stderr.isatty()


def _asked(unclear: "Unclear", declared: "Mapping") -> "Mapping":
    """Ask every question."""
    for question in unclear.questions:
        declared = _asked_one(question, declared)
    return declared


def _asked_one(question: "Question", declared: "Mapping") -> "Mapping":
    """Ask until there is an answer that can be used."""
    from rich.console import Console
    from rich.prompt import Prompt
    from rich.text import Text

    console = Console(stderr=True)
    choices = list(question.choices) or None
    while True:
        console.print(Text(f"{question.where}: {question.text}"))
        if question.example:
            console.print(Text(f"  for example: {question.example.strip(chr(34))}"))
        answer = _answer(lambda: Prompt.ask("  answer", console=console, choices=choices))
        try:
            return declared.with_values({question.key: answer})
        except InputError as error:
            console.print(Text(f"  {error}"))


def _answer[T](ask: Callable[[], T]) -> T:
    """An answer of a person; where the input ends instead, nothing goes on."""
    try:
        return ask()
    except EOFError:
        raise InputError("no answer; nothing was written") from None


def _require_yes(imported: "Imported") -> None:
    """Have somebody look at what was only taken from names."""
    names = ", ".join(f"'{column.column}'" for column in imported.understanding.guessed)
    options = dict.fromkeys(column.declaration for column in imported.understanding.guessed)
    if not _can_ask():
        raise InputError(
            f"the meaning of {names} was only taken from their names (see above); add --yes if it is right, "
            f"or say what is ({', '.join(options)}); nothing was written"
        )
    from rich.console import Console
    from rich.prompt import Confirm

    if not _answer(lambda: Confirm.ask("Is this right?", console=Console(stderr=True), default=False)):
        raise InputError(f"nothing was written; say what is otherwise: {', '.join(options)}")
