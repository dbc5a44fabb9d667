"""What a prediction is made from, when it is made from a folder of results: which of its calibrations."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from skred.documents import AGAIN, read_document
from skred.errors import InputError
from skred.inference.stored import Stored, read_stored
from skred.prediction.diagnosis_cautions import diagnosis_cautions

_KINDS = {"verdict.json": "diagnosis", "prediction.json": "prediction", "summary.json": "calibration"}
_WITHOUT = ("base_same_errors.nc", "base.nc")
"""The base law without what was added, under the same error model: the first that there is."""
_NO_PROFILE = (
    "the verdict is `unexplained`: a force that is in no list is missing, and the folder has no draws of it"
    " (profile.nc); diagnose again"
)


@dataclass(frozen=True, eq=False)
class Source:
    """A calibration from a folder.

    Attributes
    ----------
    stored : Stored
    kind : str
        ``calibration``, ``prediction`` or ``diagnosis``.
    folder, file : str
        Where it is from.
    verdict : str or None
        Of a diagnosis.
    without : Stored or None
        Where something was added: the base law calibrated under the same error model.
    without_file : str or None
        Where that is from.
    cautions : tuple of str
        Where something was added: what the diagnosis says against itself.
    recorded : dict or None
        ``description`` and ``source`` of the campaign, where the folder has them.
    """

    stored: Stored
    kind: str
    folder: str
    file: str
    verdict: str | None = None
    without: Stored | None = None
    without_file: str | None = None
    cautions: tuple[str, ...] = ()
    recorded: dict[str, str] | None = None

    @property
    def told(self) -> str:
        """Which calibration this is, in a sentence."""
        law = self.stored.calibration.law.id
        added = sorted({term.title for term in self.stored.added})
        what = f"the law {law} with {' and '.join(added)}" if added else f"the law {law}, nothing added"
        verdict = f" (verdict: {self.verdict})" if self.verdict else ""
        return f"Nothing was sampled again: from the {self.kind}{verdict} in {self.folder}, {what}."

    def as_dict(self) -> dict[str, Any]:
        """As plain data."""
        named = {"kind": self.kind, "folder": self.folder, "file": self.file, "verdict": self.verdict}
        return named | {"told": self.told, "cautions": list(self.cautions)}


def source_of(folder: Path) -> Source:
    """The calibration that a folder's answer rests on.

    Of a diagnosis the law with what was added to it; where nothing was, its base law.

    Raises
    ------
    InputError
        If the folder is not of ``skred calibrate``, ``predict`` or ``diagnose``, or of another version.
    """
    if not folder.is_dir():
        raise InputError(f"--from {folder}: no such folder")
    for document, kind in _KINDS.items():
        if (folder / document).is_file():
            return _source(folder, document, kind)
    if (folder / "compare.json").is_file():
        raise InputError(f"--from {folder}: a comparison of laws; give the folder of one of them inside it")
    raise InputError(
        f"--from {folder}: expected a folder written by skred calibrate, predict or diagnose:"
        f" it holds none of {', '.join(_KINDS)}"
    )


def _source(folder: Path, document: str, kind: str) -> Source:
    file, verdict, without, without_file = "posterior.nc", None, None, None
    cautions: list[str] = []
    try:
        content = read_document(folder / document)
        if kind == "diagnosis":
            verdict = str(content.get("verdict"))
            file = _file_of_diagnosis(folder, verdict)
        stored = read_stored(folder / file)
        if kind == "diagnosis" and stored.added:
            without_file = next((name for name in _WITHOUT if (folder / name).is_file()), None)
            without = None if without_file is None else read_stored(folder / without_file)
        if stored.added:
            cautions = _cautions(folder / document, content)
    except InputError as error:
        raise InputError(f"--from {error}") from error
    return Source(
        stored,
        kind,
        folder.name or str(folder),
        file,
        verdict,
        without,
        without_file,
        tuple(cautions),
        _recorded(content),
    )


def _cautions(file: Path, content: dict[str, Any]) -> list[str]:
    """What a verdict says against itself; a prediction passes on what it took from one."""
    try:
        if "from" in content:
            return [str(line) for line in content["from"]["cautions"]] if content["from"] else []
        return diagnosis_cautions(content)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        lacks = f"{type(error).__name__}: {error}"
        raise InputError(f"{file}: not as skred writes it ({lacks:.80}); {AGAIN}") from error


def _recorded(content: dict[str, Any]) -> dict[str, str] | None:
    """What a campaign says of itself: a diagnosis' report has it, and a prediction."""
    for holder in (content.get("report"), content):
        campaign = holder.get("campaign") if isinstance(holder, dict) else None
        if isinstance(campaign, dict) and "description" in campaign:
            return {key: str(campaign.get(key) or "") for key in ("description", "source")}
    return None


def _file_of_diagnosis(folder: Path, verdict: str) -> str:
    for file in ("augmented.nc", "profile.nc"):
        if (folder / file).is_file():
            return file
    if verdict == "unexplained":
        raise InputError(f"{folder}: {_NO_PROFILE}")
    if not (folder / "base.nc").is_file():
        raise InputError(f"{folder}: this diagnosis has no calibration: it ended before one")
    return "base.nc"
