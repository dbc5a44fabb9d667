"""One opened trial: what was hidden beside what was said."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.table import Table
from rich.text import Text

from skred.errors import InputError
from skred.prove.folder import METHOD, TRIAL_NAME, ProofFolder, read_object, trial_name
from skred.prove.ledger import read_ledger, trial_names
from skred.prove.reveal import verified


def opened_trial(folder: ProofFolder, which: str) -> dict[str, Any]:
    """Truth and answer of a trial, once the trials are opened.

    Parameters
    ----------
    folder : ProofFolder
        Revealed.
    which : str
        ``trial-0007``, or ``7``.

    Returns
    -------
    dict
        ``trial``, ``truth``, and ``answer``: None where there is none.
    """
    ledger = read_ledger(folder)
    name = trial_name(int(which)) if which.isdecimal() and len(which) < 10 else which
    if not TRIAL_NAME.fullmatch(name) or name not in trial_names(ledger):
        last = trial_names(ledger)[-1] if trial_names(ledger) else "none"
        raise InputError(f"no trial {which[:40]!r} in {folder.path}; the last is {last}")
    if not folder.scorecard.exists():
        raise InputError(f"{folder.path}: still sealed; `skred prove reveal {folder.path}` opens it")
    entries = [entry for entry in ledger["trials"] if entry["trial"] == name]
    (opened,) = verified(folder, ledger | {"trials": entries})
    file = folder.answer(name)
    return opened | {"answer": read_object(file) if file.exists() else None}


def latest_proof(parent: Path = Path("skred-out")) -> ProofFolder:
    """The proof that was sealed last in the folder for results."""
    found = [file for file in parent.glob("prove-*/ledger.json")]
    if not found:
        raise InputError(f"no proof in {parent}; say which with --out")
    return ProofFolder(max(found, key=lambda file: file.stat().st_mtime).parent)


def trial_table(opened: dict[str, Any]) -> Table:
    """Truth beside answer, as a table for the terminal."""
    truth, answer = opened["truth"], opened["answer"]
    title = f"{opened['trial']}: {truth.get('kind', '')}, base law {truth.get('base_model', '')}"
    table = Table("", "hidden", f"said by {METHOD}", title=Text(title))
    told = _told(answer) if answer is not None else {"what": "no answer"}
    hidden = _hidden(truth)
    for row in ("what", "names", "strength", "place", "sureness", "statement"):
        if hidden.get(row) or told.get(row):
            table.add_row(row, Text(hidden.get(row, "")), Text(told.get(row, "")))
    return table


def _hidden(truth: dict[str, Any]) -> dict[str, str]:
    """The truth in words, by row."""
    effects = truth.get("mechanisms", [])
    what = str(truth.get("hidden", "")).replace("_", " ")
    if truth.get("nasty"):
        what += f" ({str(truth['nasty']).replace('_', ' ')})"
    return {
        "what": what,
        "names": _lines(_name(one) for one in effects),
        "strength": _lines(_amount(one, one.get("strength")) for one in effects),
        "place": _lines(_stretch(one) for one in effects),
        "sureness": f"signal-to-noise {truth['snr']:.1f}" if effects else "",
    }


def _told(answer: dict[str, Any]) -> dict[str, str]:
    """An answer in words, by row."""
    effects = answer.get("mechanisms") or []
    first = answer.get("mechanism")
    names = [_name(one) for one in effects] or [name for name in [first] if name]
    ties = answer.get("indistinguishable") or []
    tied = [f"or {name}" for name in ties]
    return {
        "what": str(answer.get("verdict", "")).replace("_", " "),
        "names": _lines([*names, *tied]),
        "strength": _lines(_posterior(one.get("strength")) for one in effects),
        "place": _lines(_stretch(one.get("location") or {}) for one in effects)
        or _stretch(answer.get("location") or {}),
        "sureness": _sureness(answer, [first, *ties]),
        "statement": str(answer.get("statement") or answer.get("error") or ""),
    }


def _sureness(answer: dict[str, Any], names: list[str | None]) -> str:
    """Probabilities of what was named, and of nothing and of a force not in the list."""
    probability = answer.get("probability") or {}
    shown = [name for name in (*names, "nothing", "unlisted") if name and name in probability]
    lines = [f"{name} {probability[name]:.2f}" for name in dict.fromkeys(shown)]
    seconds = answer.get("wall_seconds")
    return _lines([*lines, f"after {seconds:.0f} s" if seconds is not None else ""])


def _name(effect: dict[str, Any]) -> str:
    """Id with the sensor or covariate that it is about."""
    about = effect.get("sensor") or effect.get("covariate")
    return f"{effect.get('id')} ({about})" if about else str(effect.get("id"))


def _amount(effect: dict[str, Any], value: float | None) -> str:
    """A strength with its unit, if it has one."""
    if value is None:
        return ""
    unit = effect.get("unit")
    return f"{effect.get('parameter')} = {value:.3g}" + (f" {unit}" if unit not in (None, "", "1") else "")


def _posterior(strength: dict[str, Any] | None) -> str:
    if not strength:
        return ""
    return f"{_amount(strength, strength['mean'])} (sd {strength['sd']:.2g})"


def _stretch(effect: dict[str, Any]) -> str:
    """Where something is, m along the track."""
    start, end = effect.get("s_from_m"), effect.get("s_to_m")
    if start is None or end is None:
        return ""
    return f"{start:.0f} m" if abs(end - start) < 1.0 else f"{start:.0f} to {end:.0f} m"


def _lines(words: Any) -> str:
    """What is not empty, one to a line."""
    return "\n".join(word for word in words if word)
