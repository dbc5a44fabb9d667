"""Run: every sealed campaign diagnosed once, by a process that cannot know what it hides."""

from __future__ import annotations

import shutil
import uuid
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from skred.errors import InputError
from skred.output import alone_in
from skred.prove.child import MODULE, answer_of
from skred.prove.folder import ProofFolder, read_object, write_once
from skred.prove.ledger import code_of, ledger_sha256, read_ledger, require_same_code, trial_names
from skred.prove.pool import WorkerPool
from skred.prove.sandbox import allowed_roots, within

Tell = Callable[[str], None]
Advance = Callable[[str], None]
TIME_LIMIT_S = 900.0
ATTEMPTS = 2
"""A trial whose worker died is given to another once."""


@dataclass(frozen=True)
class Limits:
    """What a diagnosis may take, and what is run.

    Attributes
    ----------
    time_limit_s : float
        Seconds a trial.
    module : str
        Module, or Python file, that diagnoses.
    """

    time_limit_s: float = TIME_LIMIT_S
    module: str = MODULE


def run(
    folder: ProofFolder, pool: WorkerPool, tell: Tell, advance: Advance, limits: Limits | None = None
) -> dict[str, int]:
    """Diagnose every trial that has no answer yet.

    Parameters
    ----------
    folder : ProofFolder
        Sealed.
    pool : WorkerPool
    tell, advance : callable
        Is told of stages, and of each trial as it is answered.
    limits : Limits, optional

    Returns
    -------
    dict
        How many trials were answered now, were answered before, crashed, and ran out of time.

    Raises
    ------
    InputError
        If the folder is not sealed, or by other source than is running.
    """
    ledger = read_ledger(folder)
    require_same_code(ledger, str(folder.ledger))
    if within(folder.path, allowed_roots()):
        raise InputError(
            f"{folder.path}: a diagnosis may read there, and so the truth; choose a folder outside of "
            "Python, the package and their caches"
        )
    with alone_in(folder.path, "`skred prove`"):
        jobs = _jobs(folder, ledger, limits or Limits())
        before = ledger["n"] - len(jobs)
        tell(f"diagnosing {len(jobs)} of {ledger['n']} trials")
        waiting = {job["trial"] for job in jobs}
        for name in trial_names(ledger):
            if name not in waiting:
                advance(name)
        verdicts = []

        def done(job: dict[str, Any], result: dict[str, Any]) -> None:
            verdicts.append(result["verdict"])
            advance(f"{job['trial']}: {result['verdict']}, {result['wall_seconds']:.0f} s")

        def lost(job: dict[str, Any]) -> None:
            done(job, _store(folder, job, _worker_died()))

        pool.carry_out(diagnose_trial, jobs, done, lost)
        shutil.rmtree(folder.path / "attempts", ignore_errors=True)
    counts = {"crashed": verdicts.count("crash"), "late": verdicts.count("timeout")}
    return {"answered": len(jobs), "before": before, **counts}


def _jobs(folder: ProofFolder, ledger: dict[str, Any], limits: Limits) -> list[dict[str, Any]]:
    """What is left to do, as plain data for a worker."""
    shared = {
        "folder": str(folder.path.resolve()),
        "run": uuid.uuid4().hex,
        "ledger_sha256": ledger_sha256(ledger),
        "code": code_of(ledger),
        "settings": ledger["settings"].get("diagnosis", {}),
        "time_limit_s": limits.time_limit_s,
        "module": limits.module,
    }
    names = [name for name in trial_names(ledger) if not folder.answer(name).exists()]
    for name in names:
        if not folder.campaign(name).is_dir() or not folder.request(name).is_file():
            raise InputError(f"{folder.trial(name)}: its campaign is not there; restore it as it was sealed")
    return [{"trial": name, **shared} for name in names]


def diagnose_trial(job: dict[str, Any]) -> dict[str, Any]:
    """Have one trial diagnosed and store its answer; done by a worker.

    Parameters
    ----------
    job : dict
        ``trial``, ``folder`` and what else `run` says of it.

    Returns
    -------
    dict
        Verdict and seconds.
    """
    folder, name = ProofFolder(Path(job["folder"])), job["trial"]
    if folder.answer(name).exists():
        return _in_short(read_object(folder.answer(name)))
    if _begun_before(folder, job) >= ATTEMPTS:
        return _store(folder, job, _worker_died())
    require_same_code(job["code"], f"{folder.ledger}, on this worker")
    base_model = str(read_object(folder.request(name)).get("base_model"))
    answer = answer_of(folder.campaign(name), base_model, job["settings"], job["time_limit_s"], job["module"])
    # Again: the source may have been edited while the diagnosis read it.
    require_same_code(job["code"], f"{folder.ledger}, on this worker")
    return _store(folder, job, answer)


def _begun_before(folder: ProofFolder, job: dict[str, Any]) -> int:
    """How often this run has begun this trial before; counted on disk, because workers die."""
    attempts = folder.path / "attempts" / job["run"]
    attempts.mkdir(parents=True, exist_ok=True)
    with (attempts / job["trial"]).open("a+", encoding="utf-8") as marks:
        marks.seek(0)
        before = len(marks.readlines())
        marks.write("begun\n")
    return before


def _worker_died() -> dict[str, Any]:
    """The answer where nobody survived to give one."""
    return {
        "verdict": "crash",
        "error": "worker died twice",
        "traceback": "",
        "wall_seconds": 0.0,
        "cpu_seconds": 0.0,
    }


def _store(folder: ProofFolder, job: dict[str, Any], answer: dict[str, Any]) -> dict[str, Any]:
    """Store an answer; the first one counts."""
    name = job["trial"]
    about = {
        "trial": name,
        "ledger_sha256": job["ledger_sha256"],
        "time_limit_s": job["time_limit_s"],
    }
    if write_once(folder.answer(name), answer | about, indent=None):
        return _in_short(answer)
    return _in_short(read_object(folder.answer(name)))


def _in_short(answer: dict[str, Any]) -> dict[str, Any]:
    """What is said of an answer as it comes."""
    return {
        "verdict": str(answer.get("verdict"))[:40],
        "wall_seconds": float(answer.get("wall_seconds", 0.0)),
    }
