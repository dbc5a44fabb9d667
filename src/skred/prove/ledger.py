"""The ledger: what was sealed, with which settings and by which source, as published before any diagnosis."""

from __future__ import annotations

import re
from importlib.metadata import version
from typing import Any

from skred.errors import InputError
from skred.prove.folder import TRIAL_NAME, ProofFolder, read_object
from skred.prove.hashes import document_sha256, scorer_sha256, source_sha256

FORMAT = 1
_SHA256 = re.compile(r"[0-9a-f]{64}")
_KEYS: dict[str, type] = {
    "created_utc": str,
    "seed": int,
    "n": int,
    "kind": str,
    "skred_version": str,
    "source_sha256": str,
    "scorer_sha256": str,
    "settings": dict,
    "trials": list,
}


def code_identity() -> dict[str, str]:
    """Version and hashes of the running code, as ledger and sealed trials hold them."""
    return {
        "skred_version": version("skred"),
        "source_sha256": source_sha256(),
        "scorer_sha256": scorer_sha256(),
    }


def code_of(document: dict[str, Any]) -> dict[str, str]:
    """Version and hashes of the code that a document was made by."""
    return {key: document[key] for key in ("skred_version", "source_sha256", "scorer_sha256")}


def read_ledger(folder: ProofFolder) -> dict[str, Any]:
    """Read the ledger of a proof and check its form.

    Raises
    ------
    InputError
        If there is none, or it is of another format.
    """
    if not folder.path.is_dir():
        raise InputError(f"{folder.path}: no such folder; `skred prove seal` makes one")
    if not folder.ledger.is_file():
        unfinished = "sealing was not finished: repeat the command" if folder.plan.is_file() else "begin with"
        raise InputError(f"{folder.path}: no ledger.json here; {unfinished} `skred prove seal`")
    ledger = read_object(folder.ledger)
    if ledger.get("format") != FORMAT:
        found = str(ledger.get("format"))[:20]
        raise InputError(f"{folder.ledger}: expected format {FORMAT}, found {found}")
    for key, kind in _KEYS.items():
        if not isinstance(ledger.get(key), kind):
            raise InputError(f"{folder.ledger}: '{key}' is missing or not what it should be")
    for entry in ledger["trials"]:
        if not _is_entry(entry):
            raise InputError(f"{folder.ledger}: 'trials' holds something that is no trial and its SHA-256")
    names = trial_names(ledger)
    if len(set(names)) != len(names) or len(names) != ledger["n"]:
        raise InputError(f"{folder.ledger}: expected {ledger['n']} trials, each once")
    return ledger


def _is_entry(entry: Any) -> bool:
    """Whether this is a trial's name with its hash."""
    if not isinstance(entry, dict):
        return False
    name, sha256 = entry.get("trial"), entry.get("sha256")
    if not isinstance(name, str) or not isinstance(sha256, str):
        return False
    return bool(TRIAL_NAME.fullmatch(name) and _SHA256.fullmatch(sha256))


def trial_names(ledger: dict[str, Any]) -> list[str]:
    """Names of all trials."""
    return [entry["trial"] for entry in ledger["trials"]]


def ledger_sha256(ledger: dict[str, Any]) -> str:
    """The one number that stands for the whole ledger."""
    return document_sha256(ledger)


def require_same_code(ledger: dict[str, Any], where: str) -> None:
    """Refuse to go on with other code than that which sealed the trials.

    Parameters
    ----------
    ledger : dict
        Or anything else with the keys of `code_identity`.
    where : str
        What says so.

    Raises
    ------
    InputError
        If version or source differ.
    """
    running = code_identity()
    for key, what in (
        ("skred_version", "version"),
        ("source_sha256", "source"),
        ("scorer_sha256", "scorer"),
    ):
        if ledger[key] != running[key]:
            raise InputError(
                f"{where}: sealed with skred {ledger['skred_version']}, {what} {ledger[key][:12]}; running "
                f"is skred {running['skred_version']}, {what} {running[key][:12]}: check out the source that "
                "sealed it"
            )
