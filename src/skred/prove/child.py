"""A diagnosis in a process and a folder of its own: started, watched, timed, and its answer read."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import uuid
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from skred.errors import InputError
from skred.output import alone_in
from skred.prove.folder import read_object
from skred.prove.hashes import package_folder
from skred.prove.task import CAMPAIGN, MARKER, TOKEN, VERDICT

MODULE = "skred.prove.task"
_KEPT = (
    "PATH", "HOME", "LANG", "LC_ALL", "LC_CTYPE", "LD_LIBRARY_PATH", "PYTHONPATH", "PYTHONDONTWRITEBYTECODE",
    "NUMBA_CACHE_DIR", "MPLCONFIGDIR", "PYTENSOR_FLAGS",
)  # fmt: skip
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
_POLL_SECONDS = 0.05
_PREFIX = "campaign-"
_TAIL = 4000
"""Characters of what a crashed process had to say."""


@dataclass(frozen=True)
class Ended:
    """How a process ended.

    Attributes
    ----------
    code : int or None
        Exit code, negative for a signal; None where its time was up.
    wall_seconds, cpu_seconds : float
        The latter of it and of all that it started.
    """

    code: int | None
    wall_seconds: float
    cpu_seconds: float


def answer_of(
    campaign: Path, base_model: str, settings: dict[str, Any], time_limit_s: float, module: str = MODULE
) -> dict[str, Any]:
    """Have a campaign diagnosed by a process that is given a copy of it, and nothing else.

    Parameters
    ----------
    campaign : Path
        Folder of the campaign.
    base_model : str
        The law it is asked about.
    settings : dict
        Of the diagnosis.
    time_limit_s : float
        After so long it is ended, and that is its answer.
    module : str
        What to run: a module, or a Python file.

    Returns
    -------
    dict
        Its verdict, or ``crash`` or ``timeout``, with the seconds it took.
    """
    _remove_abandoned()
    own = Path(tempfile.mkdtemp(prefix=_PREFIX)).resolve()
    with alone_in(own, "diagnosis"):
        try:
            (own / MARKER).write_text(uuid.uuid4().hex, encoding="utf-8")
            shutil.copytree(campaign, own / CAMPAIGN)
            (own / "tmp").mkdir()
            what = [module] if module.endswith(".py") else ["-m", module]
            ended = _run([sys.executable, "-P", *what, base_model, json.dumps(settings)], own, time_limit_s)
            answer = _answer(own, ended)
        finally:
            shutil.rmtree(own, ignore_errors=True)
    return answer | {"wall_seconds": ended.wall_seconds, "cpu_seconds": ended.cpu_seconds}


def _remove_abandoned() -> None:
    """Remove folders of trials whose worker was killed: marked by a worker, and in use by none."""
    for folder in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*"):
        with suppress(OSError, InputError):
            if (folder / MARKER).is_file() and folder.stat().st_uid == os.getuid():
                with alone_in(folder, "diagnosis"):
                    shutil.rmtree(folder, ignore_errors=True)


def _environment(own: Path) -> dict[str, str]:
    """What a diagnosis may know of the world: where Python and its caches are."""
    kept = {key: os.environ[key] for key in _KEPT if key in os.environ}
    if "PYTHONPATH" in kept:  # relative to another folder than its own
        kept["PYTHONPATH"] = os.pathsep.join(
            os.path.abspath(one) for one in kept["PYTHONPATH"].split(os.pathsep)
        )
    token = (own / MARKER).read_text(encoding="utf-8")
    told = {"TMPDIR": str(own / "tmp"), "PYTHONHASHSEED": "0", TOKEN: token}
    return kept | dict.fromkeys(_ONE_THREAD, "1") | told


def _run(command: list[str], own: Path, time_limit_s: float) -> Ended:
    """Run a command in its folder and end it, with all that it started, when its time is up."""
    started = time.monotonic()
    with (own / "output.txt").open("wb") as output:
        process = subprocess.Popen(
            command,
            cwd=own,
            env=_environment(own),
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
    late = False
    try:
        while True:
            pid, status, usage = os.wait4(process.pid, os.WNOHANG)
            if pid:
                break
            if not late and time.monotonic() - started > time_limit_s:
                late = True
                _kill_group(process.pid)
            time.sleep(_POLL_SECONDS)
        process.returncode = os.waitstatus_to_exitcode(status)
    finally:
        _kill_group(process.pid)
    wall = time.monotonic() - started
    return Ended(None if late else process.returncode, wall, usage.ru_utime + usage.ru_stime)


def _kill_group(pid: int) -> None:
    """End a process and those it started, as far as they still run."""
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(pid, signal.SIGKILL)


def _answer(own: Path, ended: Ended) -> dict[str, Any]:
    """What a process answered, or how it failed to."""
    if ended.code is None:
        return {"verdict": "timeout"}
    said = (own / "output.txt").read_text(encoding="utf-8", errors="replace")[-_TAIL:]
    if ended.code != 0:
        error = f"ended with code {ended.code}"
        return _without_paths({"verdict": "crash", "error": error, "traceback": said}, own)
    try:
        answer = read_object(own / VERDICT)
    except InputError as error:
        answer = {"verdict": "crash", "error": str(error), "traceback": said}
    if not isinstance(answer.get("verdict"), str):
        answer = {"verdict": "crash", "error": f"{VERDICT}: no verdict", "traceback": said}
    return _without_paths(answer, own) if answer["verdict"] == "crash" else answer


def _without_paths(crash: dict[str, Any], own: Path) -> dict[str, Any]:
    """A crash without the names of this machine's folders: it is published."""
    folders = {str(own): "<own>", str(package_folder("skred").parent): "<skred>"}
    folders |= {sys.prefix: "<python>", sys.base_prefix: "<python>"}
    told = dict(crash)
    for folder in sorted(folders, key=len, reverse=True):
        told |= {key: str(told[key]).replace(folder, folders[folder]) for key in ("error", "traceback")}
    return told
