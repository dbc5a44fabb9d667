"""Write the exact versions of all dependencies into pyproject.toml.

``python -m uv lock --upgrade && python scripts/pin.py``

They go to ``[tool.uv] constraint-dependencies``, which names no index, unlike a lock file.
"""

import re
import subprocess
import sys
from pathlib import Path

PYPROJECT = Path(__file__).resolve().parent.parent / "pyproject.toml"
BLOCK = re.compile(r"(?<=# pins: written by scripts/pin.py\n)constraint-dependencies = \[\n.*?\n\]\n", re.S)


def resolved() -> list[str]:
    """Every resolved requirement, with its marker where it has one."""
    command = [sys.executable, "-m", "uv", "export", "--all-groups", "--no-emit-project", "--no-hashes"]
    listed = subprocess.run(
        [*command, "--no-annotate", "--no-header"], check=True, capture_output=True, text=True
    ).stdout
    return sorted(line.strip() for line in listed.splitlines() if "==" in line)


def main() -> None:
    """Replace the pins."""
    text = PYPROJECT.read_text(encoding="utf-8")
    quoted = "".join(f'  "{requirement}",\n' for requirement in resolved())
    block = "constraint-dependencies = [\n" + quoted + "]\n"
    new, count = BLOCK.subn(lambda _: block, text)
    if count != 1:
        sys.exit("pyproject.toml: the block of pins was not found")
    PYPROJECT.write_text(new, encoding="utf-8")


if __name__ == "__main__":
    main()
