"""Seal: draw the trials, lay the truth aside, and publish the hashes of all before the first diagnosis."""

from __future__ import annotations

import json
import secrets
import shutil
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from skred.errors import InputError
from skred.output import alone_in, write_text
from skred.prove.folder import ProofFolder, read_object, trial_name, write_once
from skred.prove.hashes import document_sha256, file_sha256, files_sha256
from skred.prove.ledger import FORMAT, code_identity, read_ledger, require_same_code
from skred.prove.plan import Plan, asked, diagnosis_settings
from skred.prove.pool import WorkerPool

if TYPE_CHECKING:
    from skred.simulator.draw import Trial

Tell = Callable[[str], None]
Advance = Callable[[str], None]
_MOST_DRAWS = 8


def seal(folder: ProofFolder, plan: Plan, pool: WorkerPool, tell: Tell, advance: Advance) -> dict[str, Any]:
    """Draw and seal every trial that is not sealed yet, then publish the ledger.

    Parameters
    ----------
    folder : ProofFolder
        New, or with the same plan begun and not finished.
    plan : Plan
    pool : WorkerPool
    tell, advance : callable
        Is told of stages, and of each trial as it is sealed.

    Returns
    -------
    dict
        The ledger.

    Raises
    ------
    InputError
        If the folder holds something else, or the source changed since sealing was begun.
    """
    folder.path.mkdir(parents=True, exist_ok=True)
    with alone_in(folder.path, "`skred prove`"):
        if folder.ledger.exists():
            return _published(folder, plan)
        begun = _begin(folder, plan)
        names = [trial_name(number + 1) for number in range(plan.n)]
        jobs = [
            {"folder": str(folder.path.resolve()), "trial": name, "asked": what, **begun}
            for name, what in zip(names, asked(plan), strict=True)
            if not folder.sealed(name).exists()
        ]
        tell(f"sealing {len(jobs)} of {plan.n} trials")
        to_do = {job["trial"] for job in jobs}
        for name in names:
            if name not in to_do:
                advance(name)
        pool.carry_out(seal_trial, jobs, lambda job, _: advance(job["trial"]), _lost)
        ledger = _ledger(folder, plan, begun, names)
        if not write_once(folder.ledger, ledger):
            raise InputError(f"{folder.ledger}: there already; a ledger is never changed")
        folder.plan.unlink(missing_ok=True)
    return read_ledger(folder)


def planned(folder: ProofFolder) -> Plan | None:
    """What a folder was begun with, sealed or not; None for a folder that holds no proof."""
    if folder.ledger.exists():
        kept = read_ledger(folder)["settings"].get("plan")
    elif folder.plan.exists():
        kept = read_object(folder.plan).get("settings", {}).get("plan")
    else:
        return None
    try:
        return Plan(**kept)
    except TypeError:
        raise InputError(f"{folder.path}: its plan is not one that this version can read") from None


def _published(folder: ProofFolder, plan: Plan) -> dict[str, Any]:
    """The ledger that is there, if it is of this plan."""
    if planned(folder) != plan:
        raise InputError(f"{folder.path}: sealed already with other options; choose another folder")
    return read_ledger(folder)


def _begin(folder: ProofFolder, plan: Plan) -> dict[str, Any]:
    """Settings and code of a sealing, the same when it is begun again."""
    kept = planned(folder)
    if kept is None:
        if (folder.path / "trials").exists() or (folder.path / "sealed").exists():
            raise InputError(f"{folder.path}: holds trials of something else; choose another folder")
        settings = {"plan": plan.as_dict(), "diagnosis": diagnosis_settings(plan.quick)}
        write_once(folder.plan, {"settings": settings, "code": code_identity()})
    elif kept != plan:
        raise InputError(f"{folder.path}: begun with other options; repeat those or choose another folder")
    begun = read_object(folder.plan)
    require_same_code(begun["code"], str(folder.plan))
    return begun


def _lost(job: dict[str, Any]) -> None:
    raise InputError(f"{job['trial']}: the workers that drew it died; see to memory, and repeat the command")


def seal_trial(job: dict[str, Any]) -> dict[str, Any]:
    """Draw one trial and write it; the sealed file last, because it says that all is there.

    Parameters
    ----------
    job : dict
        ``folder``, ``trial``, ``asked`` (seed, kind, hidden), ``settings`` and ``code``.

    Returns
    -------
    dict
        The name of the trial.
    """
    require_same_code(job["code"], f"{job['folder']}, on this worker")
    folder, name = ProofFolder(Path(job["folder"])), job["trial"]
    trial, what = _drawn(job["asked"], job["settings"]["plan"]["n"], folder, name)
    request = {"base_model": trial.truth["base_model"]}
    write_text(folder.request(name), json.dumps(request) + "\n")
    write_once(folder.sealed(name), _sealed(folder, name, job, what, trial.truth))
    return {"trial": name}


def _drawn(what: dict[str, Any], n: int, folder: ProofFolder, name: str) -> tuple[Trial, dict[str, Any]]:
    """A trial with its campaigns written; else the next seed that belongs to no other trial.

    A seed may allow nothing plausible. Or a reading may be so far off that no campaign may have it, such as
    one of heavy tails above the speed of a free fall.
    """
    from skred.campaign import CampaignError
    from skred.simulator.draw import draw_trial

    for number in range(_MOST_DRAWS):
        seed = what["seed"] + number * n
        try:
            trial = draw_trial(seed, kind=what["kind"], hidden=what["hidden"])
            _write(trial, folder, name)
            return trial, what | {"seed": seed}
        except (RuntimeError, CampaignError) as error:
            if number + 1 == _MOST_DRAWS or not _is_bad_luck(error):
                raise
    raise AssertionError


def _is_bad_luck(error: Exception) -> bool:
    """Whether it says that nothing plausible was drawn, or readings that no campaign may have."""
    from skred.campaign import CampaignError
    from skred.campaign.rules import RECORDINGS

    return not isinstance(error, CampaignError) or all(one.file == RECORDINGS for one in error.problems)


def _write(trial: Trial, folder: ProofFolder, name: str) -> None:
    """The campaign, and the further avalanches that gains are measured by."""
    from skred.campaign import write_campaign

    for unfinished in (folder.trial(name), folder.fresh(name)):
        shutil.rmtree(unfinished, ignore_errors=True)
    write_campaign(trial.campaign, folder.campaign(name))
    fresh = getattr(trial, "fresh", None)
    if fresh is not None:
        write_campaign(fresh, folder.fresh(name))


def _sealed(
    folder: ProofFolder, name: str, job: dict[str, Any], what: dict[str, Any], truth: dict[str, Any]
) -> dict[str, Any]:
    """What is hashed for one trial."""
    return {
        "trial": name,
        "salt": secrets.token_hex(32),
        "asked": what,
        "truth": truth,
        "campaign": files_sha256(folder.campaign(name)),
        "request": file_sha256(folder.request(name)),
        "fresh": files_sha256(folder.fresh(name)),
        "settings": job["settings"],
        **job["code"],
    }


def _ledger(folder: ProofFolder, plan: Plan, begun: dict[str, Any], names: list[str]) -> dict[str, Any]:
    """The ledger, once all trials are sealed."""
    trials = [{"trial": name, "sha256": document_sha256(read_object(folder.sealed(name)))} for name in names]
    return {
        "format": FORMAT,
        "created_utc": datetime.now(UTC).isoformat(timespec="seconds"),
        "seed": plan.seed,
        "n": plan.n,
        "kind": plan.kind,
        **begun["code"],
        "settings": begun["settings"],
        "trials": trials,
    }
