"""Files as they are given: bounded, opened once, and told apart by their names."""

import stat
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from difflib import get_close_matches
from itertools import islice
from pathlib import Path

from skred.campaign.cells import LONGEST_WORD
from skred.campaign.problems import CampaignError, Problem, shown
from skred.campaign.tables import LARGEST_FILE_BYTES

CAMPAIGN = "campaign.toml"
TABLES = ("track", "sensors", "events", "recordings")
"""The tables of the campaign format, as files and as sheets of a workbook."""
MOST_NAMES = 1000
"""So many names of a folder are compared with one that is not there."""
_OLD_EXCEL = b"\xd0\xcf\x11\xe0"
_ZIP = b"PK\x03\x04"


@dataclass(frozen=True)
class Source:
    """One file's bytes.

    Attributes
    ----------
    name : str
        As messages tell it; with its folder's where several files have the same.
    content : bytes
    """

    name: str
    content: bytes

    @property
    def key(self) -> str:
        """The table's name in a mapping file: the file's, without its ending."""
        return self.name.rpartition(".")[0] or self.name

    @property
    def is_workbook(self) -> bool:
        """Whether it is an Excel workbook (.xlsx)."""
        return self.content.startswith(_ZIP)


@dataclass(frozen=True)
class Sources:
    """What was given: files of the campaign format by their names, and tables of any other name."""

    of_format: dict[str, Source]
    others: tuple[Source, ...]


def refuse(file: str, message: str, row: int | None = None, column: str | None = None) -> CampaignError:
    """An error with one problem."""
    return CampaignError([Problem(file, row, column, None, message)])


def open_source(path: Path, inside: Path | None = None) -> Source:
    """Read one file.

    Parameters
    ----------
    path : Path
    inside : Path, optional
        A folder that the file must not lead out of, by a link or by ``..``.

    Raises
    ------
    CampaignError
        If it cannot be read, is larger than 20 MB, or is no table.
    """
    name = path.name or str(path)  # "." has no name
    try:
        place = path.resolve(strict=True)
        if inside is not None and not place.is_relative_to(inside.resolve(strict=True)):
            raise refuse(name, "the file lies outside the folder that names it; put a copy there")
        if not stat.S_ISREG(place.stat().st_mode):
            raise refuse(name, "expected an ordinary file; correct the path")
        with place.open("rb") as opened:
            content = opened.read(LARGEST_FILE_BYTES + 1)
    except FileNotFoundError:
        raise refuse(str(path), f"there is no such file; {_nearest(path)}") from None
    except (OSError, RuntimeError, ValueError) as error:
        if isinstance(error, CampaignError):
            raise
        raise refuse(name, f"the file cannot be opened ({error}); check it") from None
    if len(content) > LARGEST_FILE_BYTES:
        raise refuse(name, f"the file is larger than {LARGEST_FILE_BYTES / 1e6:g} MB; shorten it")
    if content.startswith(_OLD_EXCEL):
        raise refuse(name, "an old or locked Excel file; save it as .xlsx without a password, or as CSV")
    if content.startswith(_ZIP) and b"opendocument" in content[:200]:
        raise refuse(name, "an OpenDocument table; save it as .xlsx or as CSV")
    if not content.strip():
        raise refuse(name, "the file is empty")
    return Source(name, content)


def _nearest(path: Path) -> str:
    """What to do about a file that is not there: the most similar name beside it, if there is one."""
    with suppress(OSError):
        names = [one.name for one in islice(path.parent.iterdir(), MOST_NAMES)]
        near = get_close_matches(path.name, names, n=1)
        if near:
            return f"is '{shown(str(path.parent / near[0]), LONGEST_WORD)}' meant?"
    return "correct the path"


def sort_out(files: Sequence[Path]) -> Sources:
    """Open what was given; a folder stands for the campaign files in it.

    Parameters
    ----------
    files : sequence of Path
        Files, or folders with files of the campaign format.

    Raises
    ------
    CampaignError
        If a file cannot be read, or one of the format's files is given twice.
    """
    of_format = dict[str, Source]()
    others = list[tuple[Source, Path]]()
    for path in files:
        for file, inside in _files_of(path):
            source = open_source(file, inside)
            key = file.stem.lower() if file.name.lower() != CAMPAIGN else CAMPAIGN
            if key not in (*TABLES, CAMPAIGN):
                others.append((source, file))
            elif key in of_format:
                raise refuse(source.name, "given twice; leave one of them out")
            else:
                of_format[key] = source
    return Sources(of_format, _told_apart(others))


def _told_apart(others: Sequence[tuple[Source, Path]]) -> tuple[Source, ...]:
    """Tables, those of one name with the names of their folders."""
    count = Counter(source.name for source, _ in others)
    named = [
        source
        if count[source.name] == 1
        else replace(source, name=f"{file.resolve().parent.name}/{file.name}")
        for source, file in others
    ]
    for name, times in Counter(source.name for source in named).items():
        if times > 1:
            raise refuse(
                name, "given twice, or another file and folder of the same names; rename one of them"
            )
    return tuple(named)


def _files_of(path: Path) -> list[tuple[Path, Path | None]]:
    """A file, or the campaign files of a folder."""
    if not path.is_dir():
        return [(path, None)]
    names = [CAMPAIGN, *(f"{table}.csv" for table in TABLES)]
    found: list[tuple[Path, Path | None]] = [(path / name, path) for name in names if (path / name).exists()]
    if not found:
        raise refuse(str(path), f"the folder holds none of {', '.join(names)}; name the files themselves")
    return found
