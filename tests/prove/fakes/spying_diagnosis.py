"""Tries all that Python offers to get at what is behind the trial; the settings say where that is."""

import glob
import os
import runpy
import shutil
import socket
import sqlite3
import subprocess
import sys
from pathlib import Path

from skred.prove.task import main


def attempts(secret, ledger, campaign):
    """Name and deed; a deed that returns something has succeeded."""
    own = campaign.parent
    outside = os.path.relpath(secret, own)
    parent = f"/proc/{os.getppid()}"
    return {
        "open": lambda: open(secret).read(),
        "io.open": lambda: open(secret, "rb").read(),
        "Path": lambda: Path(secret).read_text(),
        "os.open": lambda: os.read(os.open(secret, os.O_RDONLY), 100),
        "relative": lambda: open(outside).read(),
        "through /proc/self/root": lambda: open(f"/proc/self/root{secret}").read(),
        "of the parent's folder": lambda: open(f"{parent}/cwd/sealed/trial-0001.json").read(),
        "parent's words": lambda: open(f"{parent}/cmdline").read(),
        "parent's environment": lambda: open(f"{parent}/environ").read(),
        "parent's files": lambda: os.listdir(f"{parent}/fd"),
        "ledger": lambda: open(ledger).read(),
        "link": lambda: [os.symlink(secret, own / "link"), open(own / "link").read()],
        "hard link": lambda: [os.link(secret, own / "hard"), open(own / "hard").read()],
        "copy": lambda: shutil.copy(secret, own / "copy"),
        "move": lambda: os.rename(secret, own / "moved"),
        "overwrite": lambda: open(secret, "w"),
        "remove": lambda: [os.remove(secret), "gone"],
        "list": lambda: os.listdir(os.path.dirname(secret)),
        "scan": lambda: list(os.scandir(os.path.dirname(secret))),
        "walk": lambda: [files for _, _, files in os.walk(os.path.dirname(secret)) if files],
        "glob": lambda: glob.glob(os.path.join(os.path.dirname(ledger), "*", "*.json")),
        "parents": lambda: [one for folder in own.parents for one in glob.glob(f"{folder}/*")],
        "cat": lambda: subprocess.run(["cat", secret], capture_output=True, check=True).stdout,
        "python": lambda: (
            subprocess.run(
                [sys.executable, "-c", f"print(open({secret!r}).read())"], capture_output=True, check=True
            ).stdout
        ),
        "shell": lambda: os.system(f"cp {secret} {own}/shell") == 0,
        "fork": lambda: os.fork(),
        "spawn": lambda: os.posix_spawn("/bin/cat", ["cat", secret], {}),
        "run": lambda: runpy.run_path(secret),
        "database": lambda: sqlite3.connect(secret),
        "network": lambda: socket.create_connection(("127.0.0.1", 8786), timeout=1.0),
        "import the simulator": lambda: __import__("skred.simulator.draw"),
        "draw the trial again": lambda: runpy.run_module("skred.simulator.draw"),
        "environment": lambda: [key for key, value in os.environ.items() if os.path.dirname(ledger) in value],
        "words": lambda: [word for word in sys.argv[:2] if os.path.dirname(ledger) in word],
        "own folder": lambda: [str(file) for file in own.rglob("*") if "trial" in file.name],
    }


def answer(campaign, base_model, settings):
    reached, refused = {}, []
    for name, deed in attempts(settings["secret"], settings["ledger"], campaign).items():
        try:
            result = deed()
        except BaseException as error:
            refused.append(f"{name}: {type(error).__name__}")
            continue
        if result:
            reached[name] = str(result)[:200]
    able = open(campaign / "track.csv").read(4) == "x_m,"
    return {"verdict": "cannot_tell", "reached": reached, "refused": refused, "able": able}


main(answer)
