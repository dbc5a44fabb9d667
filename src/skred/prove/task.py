"""One diagnosis, alone: ``python -m skred.prove.task BASE_LAW SETTINGS`` in a folder that holds a campaign.

All that this process is told is the law it is asked about and how much to compute; all that it may open is
its own folder, Python, the package and caches of compiled code (`sandbox`). It writes ``verdict.json`` there.

It is a part of ``skred prove run`` (`child`), which makes the folder, marks it and removes it. In any other
folder it refuses to work. It removes nothing itself.
"""

from __future__ import annotations

import json
import os
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
MARKER, TOKEN = ".skred-prove", "SKRED_PROVE_TOKEN"
"""A file in the folder, and a variable of the environment, in which the parent writes the same word."""
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

    Exits with code 2 in a folder that was not made for it.

    Parameters
    ----------
    diagnosis : callable
        What to do with campaign folder, base law and settings.
    """
    own, parent = Path.cwd(), os.getppid()
    if not _made_for_this(own):
        print(
            "this is a part of `skred prove run`, which starts it in a folder of its own; nothing was "
            "touched; run `skred prove` or `skred diagnose` instead",
            file=sys.stderr,
        )
        sys.exit(2)
    threading.Thread(target=_end_with_parent, args=(parent,), daemon=True).start()
    base_model, settings = sys.argv[1], json.loads(sys.argv[2])
    shut(own)
    try:
        answer = diagnosis(own / CAMPAIGN, base_model, settings)
    except Exception as error:
        answer = {"verdict": "crash", "error": repr(error)[:2000], "traceback": traceback.format_exc()}

    from skred.output import write_json

    write_json(own / VERDICT, answer)


def _made_for_this(own: Path) -> bool:
    """Whether the process that started this one made and marked the folder."""
    token = os.environ.get(TOKEN)
    try:
        return bool(token) and (own / MARKER).read_text(encoding="utf-8") == token
    except (OSError, ValueError):
        return False


def _end_with_parent(parent: int) -> None:
    """End this process and those it started once nobody waits for its answer."""
    while os.getppid() == parent:
        time.sleep(_WATCH_SECONDS)
    os.killpg(0, signal.SIGKILL)  # the parent started it in a group of its own


if __name__ == "__main__":
    main()
