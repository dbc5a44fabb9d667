"""One diagnosis, alone: ``python -m skred.prove.task BASE_LAW SETTINGS`` in a folder that holds a campaign.

All that this process is told is the law it is asked about and how much to compute; all that it may open is
its own folder, Python, the package and caches of compiled code (`sandbox`). It writes ``verdict.json`` there.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

from skred.prove.sandbox import shut

Answer = dict[str, Any]
CAMPAIGN, VERDICT = "campaign", "verdict.json"
_WATCH_SECONDS = 0.5


def diagnose_campaign(campaign: Path, base_model: str, settings: dict[str, Any]) -> Answer:
    """Verdict on a campaign, by the same steps as ``skred diagnose``.

    Parameters
    ----------
    campaign : Path
        Its folder.
    base_model : str
        Law that something may be missing from.
    settings : dict
        As `skred.prove.plan.diagnosis_settings` gives them.
    """
    from skred.campaign import read_campaign
    from skred.diagnosis.diagnose import diagnose
    from skred.diagnosis.effort import Effort
    from skred.diagnosis.verdict.document import verdict
    from skred.diagnosis.verdict.predictors import predictors, promised_gain
    from skred.inference.hierarchical.problem import hierarchical_problem
    from skred.inference.sampling import SamplerSettings
    from skred.physics.laws import load_law

    problem = hierarchical_problem(
        read_campaign(campaign), error_model=settings["errors"], smoothing_m=settings["smoothing_m"]
    )
    sampler, effort = SamplerSettings(**settings["sampler"]), Effort(**settings["effort"])
    found = diagnose(problem, load_law(base_model), sampler, effort)
    gain = {"promised": promised_gain(found)}
    return verdict(found) | {"predictors": predictors(found), "gain": gain}


def main(diagnosis: Callable[[Path, str, dict[str, Any]], Answer] = diagnose_campaign) -> None:
    """Diagnose the campaign in the present folder; a crash is an answer.

    Parameters
    ----------
    diagnosis : callable
        What to do with campaign folder, base law and settings.
    """
    own = Path.cwd()
    threading.Thread(target=_end_with_parent, args=(os.getppid(), own), daemon=True).start()
    base_model, settings = sys.argv[1], json.loads(sys.argv[2])
    shut(own)
    try:
        answer = diagnosis(own / CAMPAIGN, base_model, settings)
    except Exception as error:
        answer = {"verdict": "crash", "error": repr(error)[:2000], "traceback": traceback.format_exc()}

    from skred.output import write_json

    write_json(own / VERDICT, answer)


def _end_with_parent(parent: int, own: Path) -> None:
    """End this process and those it started once nobody waits for its answer."""
    while os.getppid() == parent:
        time.sleep(_WATCH_SECONDS)
    shutil.rmtree(own, ignore_errors=True)
    os.killpg(0, signal.SIGKILL)


if __name__ == "__main__":
    main()
