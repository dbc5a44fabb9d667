"""What fresh avalanches make of the predictors in the answers: computed once the trials are opened."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from skred.errors import InputError
from skred.prove.folder import ProofFolder, read_object, write_once
from skred.prove.hashes import file_sha256
from skred.prove.ledger import code_of, require_same_code
from skred.prove.pool import WorkerPool

Answers = dict[str, dict[str, Any]]
Tell = Callable[[str], None]


def with_gains(
    folder: ProofFolder, ledger: dict[str, Any], answers: Answers, pool: WorkerPool, tell: Tell
) -> Answers:
    """The answers, with the gain on fresh avalanches realised where they hold predictors before and after.

    Parameters
    ----------
    folder : ProofFolder
        Opened: what is sealed in it has been verified.
    ledger : dict
    answers : dict
        By method, then by trial.
    pool : WorkerPool
    tell : callable
        Is told how many there are.

    Returns
    -------
    dict
        The same, with ``gain`` added to: ``realised``, ``se`` and ``n_fresh``, or ``error``.
    """
    shared = {"folder": str(folder.path.resolve()), "code": code_of(ledger)}
    jobs = [
        {"trial": name, "method": method, **shared}
        for method, given in answers.items()
        for name, answer in given.items()
        if _predicts(answer) and folder.fresh(name).is_dir() and not _known(folder, method, name)
    ]
    if jobs:
        tell(f"scoring fresh avalanches of {len(jobs)} trials")
    pool.carry_out(realise, jobs, lambda job, result: None, _lost)
    return {
        method: {name: answer | _gain(folder, method, name, answer) for name, answer in given.items()}
        for method, given in answers.items()
    }


def _predicts(answer: dict[str, Any]) -> bool:
    """Whether an answer holds predictors before and after."""
    predictors = answer.get("predictors")
    return isinstance(predictors, dict) and predictors.get("after") is not None


def _file(folder: ProofFolder, method: str, name: str) -> Path:
    return folder.path / "gains" / method / f"{name}.json"


def _known(folder: ProofFolder, method: str, name: str) -> bool:
    """Whether the gain of this very answer is there; that of another one is removed."""
    file = _file(folder, method, name)
    if not file.exists():
        return False
    if read_object(file).get("answer_sha256") == file_sha256(folder.answer(name, method)):
        return True
    file.unlink()
    return False


def _gain(folder: ProofFolder, method: str, name: str, answer: dict[str, Any]) -> dict[str, Any]:
    """Promised and realised gain as the scorer wants them; nothing where nothing was predicted."""
    if not _predicts(answer) or not _known(folder, method, name):
        return {}
    promised = answer.get("gain") if isinstance(answer.get("gain"), dict) else {}
    return {"gain": {**(promised or {}), **read_object(_file(folder, method, name))["gain"]}}


def realise(job: dict[str, Any]) -> dict[str, Any]:
    """Score an answer's predictors on its trial's fresh avalanches; done by a worker.

    Parameters
    ----------
    job : dict
        ``folder``, ``trial``, ``method`` and ``code``.

    Returns
    -------
    dict
        The name of the trial.
    """
    from skred.campaign import read_campaign
    from skred.diagnosis.predict.gain import realised_gain

    require_same_code(job["code"], f"{job['folder']}, on this worker")
    folder, method, name = ProofFolder(Path(job["folder"])), job["method"], job["trial"]
    file = folder.answer(name, method)
    try:
        gain = realised_gain(read_object(file)["predictors"], read_campaign(folder.fresh(name))) or {}
    except InputError as error:
        gain = {"error": str(error)}
    write_once(_file(folder, method, name), {"answer_sha256": file_sha256(file), "gain": gain})
    return {"trial": name}


def _lost(job: dict[str, Any]) -> None:
    raise InputError(
        f"{job['trial']}: the workers that scored it died; see to memory, and repeat the command"
    )
