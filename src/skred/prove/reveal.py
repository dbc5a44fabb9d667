"""Reveal: check every hash against the ledger, open the truth, and have the answers scored."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from skred.errors import InputError
from skred.output import alone_in
from skred.prove.folder import METHOD, TRIAL_NAME, ProofFolder, read_object
from skred.prove.gains import with_gains
from skred.prove.hashes import document_sha256, file_sha256, files_sha256
from skred.prove.ledger import ledger_sha256, read_ledger, require_same_code, trial_names
from skred.prove.pool import WorkerPool

Scorer = Callable[[Path, dict[str, Any], list[dict[str, Any]], dict[str, dict[str, Any]]], dict[str, Any]]
Tell = Callable[[str], None]
_SEALED_BY_ALL = ("settings", "skred_version", "source_sha256", "scorer_sha256")


def reveal(
    folder: ProofFolder, pool: WorkerPool, tell: Tell, *, partial: bool = False, score: Scorer | None = None
) -> dict[str, Any]:
    """Verify what was sealed, then score.

    Parameters
    ----------
    folder : ProofFolder
        Sealed and diagnosed.
    pool : WorkerPool
        Who scores fresh avalanches.
    tell : callable
        Is told of stages.
    partial : bool
        Score also where trials have no answer yet.
    score : callable, optional
        What scores: given the folder, the ledger, the trials with their truth, and the answers by method.

    Returns
    -------
    dict
        The scorecard.

    Raises
    ------
    InputError
        If anything differs from what was sealed, or answers are missing.
    """
    ledger = read_ledger(folder)
    require_same_code(ledger, str(folder.ledger))
    with alone_in(folder.path, "`skred prove`"):
        answers = read_answers(folder, ledger)
        missing = ledger["n"] - len(answers.get(METHOD, {}))
        if missing and not partial:
            raise InputError(
                f"{folder.path}: {missing} of {ledger['n']} trials have no answer yet; "
                f"`skred prove run {folder.path}` goes on, --partial scores what is there"
            )
        tell(f"verifying {ledger['n']} trials")
        trials = verified(folder, ledger)
        if missing:
            tell(f"partial: {missing} of {ledger['n']} trials have no answer yet")
        answers = with_gains(folder, ledger, answers, pool, tell)
        return (score or _scorer())(folder.path, ledger, trials, answers)


def _scorer() -> Scorer:
    from skred.prove.scorecard import write_scorecard

    return write_scorecard


def verified(folder: ProofFolder, ledger: dict[str, Any]) -> list[dict[str, Any]]:
    """The truth of every trial, if nothing of it differs from what was sealed.

    Raises
    ------
    InputError
        Naming the first trial and file that does.
    """
    return [
        {"trial": entry["trial"], "truth": _opened(folder, ledger, entry)["truth"]}
        for entry in ledger["trials"]
    ]


def _opened(folder: ProofFolder, ledger: dict[str, Any], entry: dict[str, Any]) -> dict[str, Any]:
    """One sealed trial, all its hashes checked."""
    name = entry["trial"]
    file = folder.sealed(name)
    sealed = read_object(file)
    if document_sha256(sealed) != entry["sha256"]:
        raise _differs(name, file)
    if sealed.get("trial") != name:
        raise InputError(f"{file}: this is the truth of {sealed.get('trial')}, not of {name}")
    for key in _SEALED_BY_ALL:
        if sealed.get(key) != ledger[key]:
            raise InputError(f"{folder.ledger}: its '{key}' is not the one that {name} was sealed with")
    if not folder.request(name).is_file() or file_sha256(folder.request(name)) != sealed["request"]:
        raise _differs(name, folder.request(name))
    for part, where in (("campaign", folder.campaign(name)), ("fresh", folder.fresh(name))):
        found = files_sha256(where)
        for changed in sorted(found.keys() | sealed[part].keys()):
            if found.get(changed) != sealed[part].get(changed):
                raise _differs(name, where / changed)
    return sealed


def _differs(name: str, file: Path) -> InputError:
    state = "changed since it was sealed" if file.exists() else "missing"
    return InputError(f"{name}: {file} is {state}: nothing is scored; restore the files as they were sealed")


def read_answers(folder: ProofFolder, ledger: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Answers of every method, by trial.

    Raises
    ------
    InputError
        If an answer is none, or to another ledger.
    """
    return {method: _answers_of(folder, ledger, method) for method in folder.methods()}


def _answers_of(folder: ProofFolder, ledger: dict[str, Any], method: str) -> dict[str, Any]:
    """Answers of one method, by trial, in the order of the ledger."""
    files = folder.answer("any", method).parent.glob("trial-*.json")
    names = {file.stem for file in files if TRIAL_NAME.fullmatch(file.stem)}
    unknown = sorted(names - set(trial_names(ledger)))
    if unknown:
        raise InputError(
            f"{folder.answer(unknown[0], method)}: an answer to a trial that is not in the ledger"
        )
    sha256 = ledger_sha256(ledger)
    answers = {}
    for name in trial_names(ledger):
        if name in names:
            answers[name] = answer = read_object(folder.answer(name, method))
            where = folder.answer(name, method)
            if not isinstance(answer.get("verdict"), str) or answer.get("trial", name) != name:
                raise InputError(f"{where}: expected the answer to {name}, found something else")
            if answer.get("ledger_sha256", sha256) != sha256:
                raise InputError(
                    f"{where}: the answer to another ledger; the trials were sealed again after it"
                )
    return answers
