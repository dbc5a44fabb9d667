"""Write the comparison with the paper: ``python -m studies.reproduction``.

Every number of ``docs/reproduction.md`` and of its figures is computed here, in a few minutes.
"""

import platform
import sys
import time
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter, validators

DEFAULT_OUT = Path(__file__).resolve().parents[2] / "docs" / "reproduction.md"
PACKAGES = ("skred", "pymc", "pytensor", "arviz", "numba", "numpy", "scipy")

app = App(help="Compare the pooled calibration on Ryggfonn with the paper's statements.")


@app.default
def main(
    *,
    out: Path = DEFAULT_OUT,
    seed: Annotated[int, Parameter(validator=validators.Number(gte=0, lt=2**27))] = 0,
    quick: Annotated[bool, Parameter(name="--quick", negative="")] = False,
) -> None:
    """Compute everything and write the page and its figures.

    Parameters
    ----------
    out
        The page; its figures go to a folder ``figures`` beside it. Both are replaced.
    seed
        Seed of the chains. The grids need none.
    quick
        Coarser grids and fewer draws, to try things out.
    """
    # Here, so that --help does not wait for PyMC.
    from skred.output import write_text
    from studies.files import shrink
    from studies.reproduction.figures import save_reproduction_figures
    from studies.reproduction.page import page
    from studies.reproduction.study import run_study

    started = time.monotonic()

    def tell(line: str) -> None:
        print(f"{time.monotonic() - started:6.1f} s  {line}", file=sys.stderr, flush=True)

    study = run_study(seed, quick=quick, tell=tell)
    out.parent.mkdir(parents=True, exist_ok=True)
    tell("figures")
    for picture in save_reproduction_figures(study, out.parent / "figures"):
        shrink(picture)
    command = f"python -m studies.reproduction --seed {seed}" + (" --quick" if quick else "")
    versions = {"python": platform.python_version(), **{name: version(name) for name in PACKAGES}}
    text = page(study, command=command, seed=seed, versions=versions, seconds=time.monotonic() - started)
    write_text(out, text)
    tell(f"wrote {out}")


if __name__ == "__main__":
    app()
