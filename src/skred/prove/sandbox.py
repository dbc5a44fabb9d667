"""What the process that diagnoses may open: its own folder, Python, the package and caches; nothing else.

The sandbox is an audit hook of Python. It stops what Python code opens, lists, links or starts, and so every
accident and every plain attempt to look behind the trial. It is not a wall against hostile machine code: a C
extension may open files without telling Python. The simulator of trials is out of reach as well: a diagnosis
that could redraw trials would not need to open any file.
"""

from __future__ import annotations

import importlib.util
import os
import re
import site
import sys
import sysconfig
from collections.abc import Callable
from contextlib import suppress
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

_SYSTEM = ("/etc", "/lib", "/lib64", "/sys", "/usr", "/dev/null", "/dev/random", "/dev/urandom", "/dev/zero")
_HOME = (
    ".pytensor",
    ".pytensorrc",
    ".cache/matplotlib",
    ".cache/numba",
    ".config/matplotlib",
    ".config/arviz",
)
_OF_ITSELF = ("cgroup", "maps", "mountinfo", "mounts", "stat", "statm", "status")
_OF_ALL = ("cpuinfo", "loadavg", "meminfo", "stat", "uptime", "version")
_PROGRAMS = re.compile(r"([\w.+-]*-)?(g\+\+|gcc|c\+\+|cc|clang|clang\+\+|ld|ldconfig|lscpu|uname)(-\d+)?")
"""Compilers and what looks for them."""
_NEVER = frozenset(
    "os.exec os.fork os.forkpty os.posix_spawn os.spawn os.startfile os.system pty.spawn "
    "socket.bind socket.connect socket.getaddrinfo socket.sendmsg socket.sendto".split()
)
_PATHS: dict[str, tuple[int, ...]] = {
    "open": (0,),
    "os.link": (0, 1),
    "os.mkdir": (0,),
    "os.remove": (0,),
    "os.rename": (0, 1),
    "os.rmdir": (0,),
    "os.truncate": (0,),
    "sqlite3.connect": (0,),
}
"""Which arguments of an event are paths."""


def allowed_roots() -> list[Path]:
    """Folders and files, beside its own folder, that a diagnosis may open."""
    roots = [Path(one) for one in (sys.prefix, sys.base_prefix, sys.exec_prefix, *_SYSTEM)]
    roots += [Path(one) for one in sysconfig.get_paths().values()]
    roots += [Path(one) for one in (*site.getsitepackages(), site.getusersitepackages())]
    packages = {"skred", *(entry.module.partition(".")[0] for entry in entry_points(group="skred.laws"))}
    for name in sorted(packages):
        spec = importlib.util.find_spec(name)
        roots += [Path(one) for one in (spec.submodule_search_locations or ()) if spec] if spec else []
    roots += [Path.home() / one for one in _HOME]
    roots += _cache_folders()
    return sorted({_real(one) for one in roots} - {_real("/")})


def _cache_folders() -> list[Path]:
    """Where compiled code goes, if that was decided."""
    folders = [os.environ[key] for key in ("NUMBA_CACHE_DIR", "MPLCONFIGDIR") if os.environ.get(key)]
    for flag in os.environ.get("PYTENSOR_FLAGS", "").split(","):
        key, _, value = flag.partition("=")
        if key.strip() in ("base_compiledir", "compiledir") and value.strip():
            folders.append(os.path.expanduser(value.strip()))
    return [Path(one) for one in folders]


def _real(path: str | Path) -> Path:
    """A path without links; what does not exist is as it is written."""
    return Path(os.path.realpath(path))


def within(path: str | Path, roots: list[Path]) -> bool:
    """Whether a path, all links followed, lies in one of the folders."""
    real = _real(path)
    return any(real.is_relative_to(root) for root in roots)


class Sandbox:
    """An audit hook; folders of caches are made before it is at work, for those above them are out of bounds.

    Parameters
    ----------
    own : Path
        The process's own folder.
    """

    def __init__(self, own: Path) -> None:
        for folder in _cache_folders():
            with suppress(OSError):  # a cache that cannot be is an error where it is used
                folder.mkdir(parents=True, exist_ok=True)
        process = f"/proc/{os.getpid()}"
        files = [f"{process}/{name}" for name in _OF_ITSELF] + [f"/proc/{name}" for name in _OF_ALL]
        self.roots = [_real(own), *allowed_roots(), *(Path(one) for one in files)]
        self.listable = {_real(one) for one in sys.path if one}
        self.never = _real(Path(__file__).parents[1] / "simulator")

    def __call__(self, event: str, arguments: tuple[Any, ...]) -> None:
        """Let an event pass or raise."""
        if event in _PATHS:
            for number in _PATHS[event]:
                self.check(event, arguments[number])
        elif event in ("os.listdir", "os.scandir"):
            if arguments[0] is not None and not self._may_list(arguments[0]):
                self._refuse(event, arguments[0])
        elif event == "os.symlink":
            beside = os.path.dirname(os.path.abspath(os.fsdecode(arguments[1])))
            self.check(event, os.path.join(beside, os.fsdecode(arguments[0])))
        elif event == "subprocess.Popen":
            if not _PROGRAMS.fullmatch(os.path.basename(os.fsdecode(arguments[0]))):
                self._refuse(event, arguments[0])
        elif event in _NEVER:
            self._refuse(event, arguments[0] if arguments else "")

    def check(self, event: str, path: Any) -> None:
        """Raise where a path is out of bounds; a number stands for a file that is open already."""
        if isinstance(path, int):
            return
        text = os.fsdecode(path)
        if text == ":memory:" or (within(text, self.roots) and not within(text, [self.never])):
            return
        self._refuse(event, path)

    def _may_list(self, path: Any) -> bool:
        """Python lists the folders of `sys.path` when it looks for modules."""
        if isinstance(path, int):
            return True
        text = os.fsdecode(path)
        return (within(text, self.roots) and not within(text, [self.never])) or _real(text) in self.listable

    def _refuse(self, event: str, what: Any) -> None:
        raise PermissionError(f"{event}: a diagnosis may not reach {str(what)[:200]!r}")


def shut(own: Path) -> None:
    """Sandbox this process from now on; there is no way back."""
    sandbox: Callable[[str, tuple[Any, ...]], None] = Sandbox(own)
    sys.addaudithook(sandbox)
