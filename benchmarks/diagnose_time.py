"""How long `skred diagnose` takes by the clock, loading packages included: to its verdict, and to its report.

``python -m benchmarks.diagnose_time [--json FILE]`` runs the command on the 22 avalanches of Ryggfonn, one
base law after the other, and on campaigns of the development seeds, each with the base law that its trial
asks about: dense ones, and many avalanches at few sensors. Asked on two cores: 40 s for 22 sparse avalanches,
60 s for 15 with 40 gates, 5 minutes for 200 and 25 for 1000 sparse ones, and 4 GB at most. First each law is
run once and not counted, so that everything is compiled. Both cores must be free. ``--json`` is written after
each campaign, and keeps those that it has; ``--least`` and ``--largest`` say which are diagnosed.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated, Any

import cyclopts

from benchmarks.commit import commit
from benchmarks.files import write
from skred.campaign import Campaign, find_campaign, read_campaign, write_campaign
from skred.simulator.draw import draw_trial
from skred.simulator.fresh import draw_fresh

app = cyclopts.App(help=__doc__)
LAWS = ("coulomb", "pcm", "constant", "voellmy")
DENSE = ((1701, "nothing"), (1702, "obstacle"), (1703, "turbulent_drag"), (1704, "sensor_bias"))
"""Seeds of dense trials, and what they hide."""
MANY = ((200, "coulomb"), (200, "pcm"), (200, "constant"), (200, "voellmy"), (1000, "pcm"))
"""How many avalanches at few sensors, and the base law; what is hidden is friction on a stretch."""
MANY_SEED = 1705


def timed(name: str, campaign: Path | str, law: str, out: Path) -> dict[str, Any]:
    """Seconds and memory of one diagnosis, and what it says."""
    command = ["diagnose", str(campaign), "--base-model", law, "--out", str(out), "--force"]
    started, clock = time.monotonic(), time.time()
    process = subprocess.Popen([sys.executable, "-m", "skred.cli", *command], stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    seconds = time.monotonic() - started
    if status != 0:
        raise SystemExit(f"skred {' '.join(command)} ended with status {os.waitstatus_to_exitcode(status)}")
    file = out / "verdict.json"  # written first, before report and figures
    verdict, told = json.loads(file.read_text(encoding="utf-8")), file.stat().st_mtime - clock
    found = read_campaign(find_campaign(str(campaign)))
    row = {
        "campaign": name,
        "events": found.n_events,
        "sensors": len(found.sensors),
        "base_model": law,
        "seconds": seconds,
        "verdict_seconds": told,
        "cpu_seconds": used.ru_utime + used.ru_stime,
        "memory_gb": used.ru_maxrss / 1024.0**2,
        "stages": verdict["seconds"],
        "verdict": verdict["verdict"],
        "names": [one for one in (verdict["mechanism"], *verdict["indistinguishable"]) if one],
    }
    print(
        f"{name} {law}: {row['events']} events, {row['sensors']} sensors, verdict after {told:.1f} s,"
        f" all after {seconds:.1f} s, {row['memory_gb']:.1f} GB, {row['verdict']}",
        flush=True,
    )
    return row


def simulated(largest: int) -> list[tuple[str, Campaign, str]]:
    """Campaigns of the development seeds: what they are, recordings, base law."""
    found = []
    for seed, hidden in DENSE:
        trial = draw_trial(seed, kind="dense", hidden=hidden)
        found.append((f"dense, {hidden}", trial.campaign, trial.truth["base_model"]))
    for n, law in MANY:
        if n <= largest:
            trial = draw_trial(MANY_SEED, kind="sparse", hidden="segment_friction", base=law)
            found.append((f"sparse, {n} avalanches", draw_fresh(trial.source, n), law))
    return found


@app.default
def main(
    *,
    least: Annotated[int, cyclopts.Parameter(help="Avalanches of a campaign at least.")] = 1,
    largest: Annotated[int, cyclopts.Parameter(help="Avalanches of a campaign at most.")] = 1000,
    out: Annotated[Path | None, cyclopts.Parameter(name="--json", help="File for the figures.")] = None,
) -> None:
    """Measure; figures of other campaigns that the file has already are kept."""
    kept = json.loads(out.read_text(encoding="utf-8"))["runs"] if out is not None and out.exists() else []
    rows = {(row["campaign"], row["base_model"]): row for row in kept}
    with tempfile.TemporaryDirectory(prefix="diagnose-") as scratch:
        folder = Path(scratch)
        for law in LAWS:
            timed("not counted: Ryggfonn", "ryggfonn", law, folder / "report")
        campaigns: list[tuple[str, Path | str, str]] = [("Ryggfonn", "ryggfonn", law) for law in LAWS]
        for number, (name, campaign, law) in enumerate(simulated(largest)):
            write_campaign(campaign, folder / f"{number}")
            campaigns.append((name, folder / f"{number}", law))
        for name, place, law in campaigns:
            if least <= read_campaign(find_campaign(str(place))).n_events <= largest:
                rows[name, law] = timed(name, place, law, folder / "report") | {"commit": commit()}
                if out is not None:
                    write(out, {"runs": list(rows.values())})


if __name__ == "__main__":
    app()
