"""What the dashboard is given, read: folders of results and netCDF files; what cannot be shown is told."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from skred.documents import FORMAT, TREE_FORMAT, check_size
from skred.errors import InputError
from skred.report.explore.plain_json import plain_json
from skred.report.explore.run import Run, numbered, shown

if TYPE_CHECKING:
    import xarray as xr

_AGAIN = "run the command that wrote it again"
_LARGEST_JSON = 50_000_000
_LARGEST_FILE = 2_000_000_000
"""Bytes of a file."""
_MOST_RUNS = 24
_OF_A_DIAGNOSIS = {
    "base.nc": "base law",
    "base_same_errors.nc": "base law, same errors",
    "augmented.nc": "augmented law",
}


@dataclass(frozen=True)
class Trouble:
    """A folder or file that cannot be shown.

    Attributes
    ----------
    source : str
    message : str
        What is wrong, and what to do.
    """

    source: str
    message: str


@dataclass(frozen=True, eq=False)
class Given:
    """All that was given.

    Attributes
    ----------
    runs : tuple of Run
    troubles : tuple of Trouble
    """

    runs: tuple[Run, ...]
    troubles: tuple[Trouble, ...]


@dataclass(frozen=True)
class _Found:
    """A netCDF file, what it is called, its kind, and the document beside it."""

    file: Path
    title: str
    kind: str
    document: Path | None = None
    key: str = "format"


def read_given(places: Sequence[Path]) -> Given:
    """Read folders of results, and netCDF files with ArviZ's groups.

    Parameters
    ----------
    places : sequence of Path
        Folders of ``skred diagnose``, ``compare``, ``calibrate`` or of other netCDF files, and such files.

    Raises
    ------
    InputError
        If one is not there, or holds nothing that could be shown.
    """
    found = [(place, one) for place in places for one in _found(place)]
    runs, troubles = list[Run](), list[Trouble]()
    for place, one in found:
        if len(runs) == _MOST_RUNS:
            troubles.append(Trouble(shown(place, 80), f"only {_MOST_RUNS} runs are shown at a time"))
            break
        try:
            document = {} if one.document is None else _document(one.document, one.key)
            tree = _tree(one.file, of_ours=one.kind != "arviz")
            ours = one.kind == "arviz" and "law" in tree.attrs and tree.attrs.get("format") == TREE_FORMAT
            kind = "calibration" if ours else one.kind
            runs.append(Run(f"r{len(runs) + 1}", _title(one, tree), kind, str(place), tree, document))
        except InputError as error:
            troubles.append(Trouble(shown(place, 80), str(error)))
    return Given(_apart(runs), tuple(dict.fromkeys(troubles)))


def _found(place: Path) -> Iterator[_Found]:
    """The netCDF files of a place."""
    if place.is_file():
        if place.suffix.lower() not in (".nc", ".netcdf", ".h5"):
            raise InputError(f"{place}: neither a folder of results nor a netCDF file (.nc)")
        yield _Found(place, place.stem, "arviz")
        return
    if not place.is_dir():
        raise InputError(f"{place}: no such folder or file")
    name = place.resolve().name
    if (place / "verdict.json").is_file():
        yield _Found(place / "diagnosis.nc", f"{name}: diagnosis", "diagnosis", place / "verdict.json")
        for file, words in _OF_A_DIAGNOSIS.items():
            if (place / file).is_file():
                yield _Found(place / file, f"{name}: {words}", "calibration")
        return
    if (place / "compare.json").is_file():
        files = sorted((*place.glob("*/posterior.nc"), *place.glob("pooled/*/posterior.nc")))
        for posterior in files or [place / "posterior.nc"]:  # where there is none, that is told
            words = " ".join(posterior.parent.relative_to(place).parts[::-1]).replace("pooled", "(pooled)")
            yield _Found(posterior, f"{name}: {words}", "calibration", place / "compare.json")
        return
    if (place / "posterior.nc").is_file():
        summary = place / "summary.json"
        yield _Found(place / "posterior.nc", name, "calibration", summary if summary.is_file() else None)
        return
    files = sorted(place.glob("*.nc"))
    if not files:
        raise InputError(
            f"{place}: nothing to show; expected a folder written by skred calibrate, compare or diagnose,"
            " or one with netCDF files (.nc) of ArviZ"
        )
    yield from (_Found(file, f"{name}: {file.stem}", "arviz") for file in files)


def _document(file: Path, key: str) -> dict[str, Any]:
    """A JSON document of the format that this version reads."""
    if file.stat().st_size > _LARGEST_JSON:
        raise InputError(f"{file}: larger than {_LARGEST_JSON // 1_000_000} MB, which no result is")
    try:
        document = plain_json(file.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, ValueError, RecursionError) as error:
        raise InputError(f"{file}: not a JSON document ({str(error):.80})") from error
    found = document.get(key) if isinstance(document, dict) else None
    if found != FORMAT:
        raise InputError(
            f"{file}: written by another version of skred, {key} {found!r:.20} instead of {FORMAT}; {_AGAIN}"
        )
    return dict(document)


def _tree(file: Path, *, of_ours: bool) -> xr.DataTree:
    """A netCDF file, read as a whole if it is not too large; variables of objects would need pickle."""
    import xarray as xr

    if not file.is_file():
        raise InputError(f"{file}: not there; {_AGAIN}")
    if file.stat().st_size > _LARGEST_FILE:
        raise InputError(f"{file}: larger than {_LARGEST_FILE // 10**9} GB; thin its draws")
    try:
        with xr.open_datatree(file, engine="h5netcdf") as opened:
            if of_ours and opened.attrs.get("format") != TREE_FORMAT:
                told = f"format {opened.attrs.get('format')!r:.20} instead of {TREE_FORMAT}"
                raise InputError(f"{file}: written by another version of skred, {told}; {_AGAIN}")
            _check_tree(file, opened)
            return opened.load() if of_ours else _cleaned(opened.load())
    except InputError:
        raise
    except Exception as error:  # whatever a library says of a file that is not what it seems
        what = " ".join(f"{type(error).__name__}: {error}".split())
        raise InputError(f"{file}: not a netCDF file that can be read ({what:.120})") from error


def _cleaned(tree: xr.DataTree) -> xr.DataTree:
    """Groups of draws with numbers only, and with numbers of chains and draws: what ArviZ computes with."""
    import xarray as xr

    groups = {}
    for name, node in tree.children.items():
        data = node.to_dataset()
        if name != "constant_data":
            data = data[[key for key, values in data.data_vars.items() if values.dtype.kind in "iufb"]]
        groups[str(name)] = numbered(data)
    cleaned = xr.DataTree.from_dict(groups)
    cleaned.attrs = dict(tree.attrs)
    return cleaned


def _check_tree(file: Path, tree: xr.DataTree) -> None:
    """Refuse what would not fit into memory, and what holds nothing to show."""
    check_size(file, tree)
    if not {"posterior", "observed_data", "constant_data", "prior"} & set(tree.children):
        raise InputError(
            f"{file}: has none of ArviZ's groups, such as posterior; expected a file that ArviZ wrote"
        )


def _title(one: _Found, tree: xr.DataTree) -> str:
    """What a run is called: where it is from, its law and its likelihood."""
    said = [str(tree.attrs[key]) for key in ("law", "likelihood") if key in tree.attrs]
    words = [shown(f"({', '.join(said)})", 40)] if said and one.kind == "calibration" else []
    return " ".join((shown(one.title, 48), *words))


def _apart(runs: Sequence[Run]) -> tuple[Run, ...]:
    """Runs with titles that differ."""
    titles = [run.title for run in runs]
    return tuple(
        replace(run, title=f"{run.title} [{k + 1}]") if titles.count(run.title) > 1 else run
        for k, run in enumerate(runs)
    )
