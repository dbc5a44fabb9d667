"""The command line of the proof: ``skred prove``, and ``seal``, ``run``, ``reveal`` and ``show`` alone.

Everything heavy is imported inside the functions, so that ``--help`` is instant.
"""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import App, Parameter, validators

from skred.cli.exit_codes import DONE
from skred.cli.options import Json, Quiet
from skred.cli.output import write_json
from skred.errors import InputError

if TYPE_CHECKING:
    from skred.prove.folder import ProofFolder
    from skred.prove.plan import Plan
    from skred.prove.pool import WorkerPool

QUICK_TRIALS = 12
_SHARE = validators.Number(gte=0.0, lte=1.0)
Folder = Annotated[Path, Parameter(name="folder", help="Folder of the proof.")]
ProofOut = Annotated[
    Path | None,
    Parameter(help="Folder of the proof: new, empty, or one to go on with; by default new in skred-out."),
]
ShownOut = Annotated[
    Path | None, Parameter(help="Folder of the proof; by default the one in skred-out that was sealed last.")
]
Shown = Annotated[str, Parameter(name="trial", help="A trial: trial-0007, or 7.")]
TimeLimit = Annotated[
    float,
    Parameter(
        validator=validators.Number(gt=0.0, lte=1e6),
        help="Seconds a diagnosis may take; one that takes longer is ended, and that is a wrong answer.",
    ),
]
Partial = Annotated[
    bool,
    Parameter(name="--partial", negative="", help="Score also if trials have no answer yet, and say so."),
]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Sealing:
    """What to hide: options of the commands that seal."""

    trials: Annotated[
        int | None,
        Parameter(
            validator=validators.Number(gte=1, lte=100_000),
            help="Number of trials; with --quick 12 if not given.",
        ),
    ] = None
    seed: Annotated[
        int | None,
        Parameter(
            validator=validators.Number(gte=0, lt=2**31),
            help="Seed of the first trial, the next has the next; by default a random one. At least 1000000, "
            "because smaller ones were developed on, except with --quick.",
        ),
    ] = None
    kind: Annotated[
        Literal["sparse", "dense", "mixed"],
        Parameter(help="What is recorded: few speeds of many avalanches, many of few, or each in turn."),
    ] = "mixed"
    nothing_share: Annotated[
        float | None,
        Parameter(
            validator=_SHARE,
            help="Share of trials, to the nearest whole number, that hide nothing, half of them contaminated "
            "(by a bad reading, say); by default each is drawn so with probability 0.35.",
        ),
    ] = None
    unlisted_share: Annotated[
        float | None,
        Parameter(
            validator=_SHARE,
            help="Share of the trials that hide something in which it is in no list; by default 2 in 13.",
        ),
    ] = None
    masked_share: Annotated[
        float,
        Parameter(
            validator=_SHARE,
            help="Share of the trials with one listed mechanism in which the base law hides it on average.",
        ),
    ] = 0.1
    quick: Annotated[
        bool,
        Parameter(
            name="--quick", negative="", help="12 trials, each diagnosed as by `skred diagnose --quick`."
        ),
    ] = False

    def check(self) -> None:
        """Refuse a seed of development, before a folder is made."""
        from skred.prove.plan import Plan

        Plan(self.trials or 1, self.seed if self.seed is not None else 2**20, quick=self.quick)

    def plan(self, folder: "ProofFolder") -> "Plan":
        """As sealing wants it; number and seed of a folder that was begun are kept where none are given."""
        from skred.prove.plan import Plan, random_seed
        from skred.prove.seal import planned

        kept = planned(folder)
        n = self.trials or (kept.n if kept else QUICK_TRIALS if self.quick else None)
        if n is None:
            raise InputError("--trials: how many? (or --quick for 12)")
        seed = self.seed if self.seed is not None else kept.seed if kept else random_seed()
        return Plan(
            n, seed, self.kind, self.masked_share, self.nothing_share, self.unlisted_share, self.quick
        )


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Working:
    """Who does the work: options of the commands that have much to do."""

    workers: Annotated[
        int,
        Parameter(
            validator=validators.Number(gte=1, lte=1000), help="Trials at a time, each on one processor here."
        ),
    ] = 2
    scheduler: Annotated[
        str | None,
        Parameter(
            help="Address of a Dask scheduler to use instead; its workers need the same source and see "
            "the folder under the same path."
        ),
    ] = None

    def worker_pool(self) -> "WorkerPool":
        """As sealing and running want it."""
        from skred.prove.pool import WorkerPool

        return WorkerPool(self.workers, self.scheduler)


SEALING, WORKING = Sealing(), Working()
prove_app = App(
    name="prove",
    help="Prove the diagnosis on concealed trials: sealed before, opened after, scored. "
    "Without a command: seal, run and reveal.",
)


@prove_app.default
def prove(
    *,
    sealing: Sealing = SEALING,
    working: Working = WORKING,
    time_limit: TimeLimit = 900.0,
    out: ProofOut = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Seal, run and reveal; the same command with the folder as --out goes on where it was ended."""
    from skred.prove.folder import ProofFolder

    if out is None and sealing.trials is None and not sealing.quick:
        raise InputError("--trials: how many? (or --quick for 12)")
    silent = quiet or as_json
    sealing.check()
    folder = ProofFolder(out if out is not None and _begun(out) else _new(out))
    if not silent:
        print(
            f"{folder.path}: `skred prove --out {folder.path}` with the same options goes on", file=sys.stderr
        )
    _seal(folder, sealing, working, silent)
    _run(folder, working, time_limit, silent)
    return _reveal(folder, working, False, as_json, quiet)


@prove_app.command
def seal(
    folder: Folder, /, *, sealing: Sealing = SEALING, working: Working = WORKING, quiet: Quiet = False
) -> int:
    """Draw trials, lay the truth aside, and write the ledger with the hashes of all of it."""
    from skred.prove.folder import ProofFolder

    _seal(ProofFolder(folder), sealing, working, quiet)
    return DONE


@prove_app.command
def run(
    folder: Folder,
    /,
    *,
    working: Working = WORKING,
    time_limit: TimeLimit = 900.0,
    quiet: Quiet = False,
) -> int:
    """Diagnose every trial that has no answer yet, each in a process that is given the campaign only."""
    from skred.prove.folder import ProofFolder

    _run(ProofFolder(folder), working, time_limit, quiet)
    return DONE


@prove_app.command
def reveal(
    folder: Folder,
    /,
    *,
    partial: Partial = False,
    working: Working = WORKING,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Check all hashes, open the truth, and write scorecard.json, scorecard.html and figures."""
    from skred.prove.folder import ProofFolder

    return _reveal(ProofFolder(folder), working, partial, as_json, quiet)


@prove_app.command
def show(trial: Shown, /, *, out: ShownOut = None, as_json: Json = False) -> int:
    """Show one opened trial: what was hidden beside what was said."""
    from skred.prove.folder import ProofFolder
    from skred.prove.show import latest_proof, opened_trial, trial_table

    opened = opened_trial(ProofFolder(out) if out is not None else latest_proof(), trial)
    if as_json:
        write_json(opened)
    else:
        from rich.console import Console

        Console().print(trial_table(opened))
    return DONE


def _begun(out: Path) -> bool:
    """Whether a folder holds a proof, sealed or not yet."""
    from skred.prove.folder import ProofFolder

    folder = ProofFolder(out)
    return folder.ledger.exists() or folder.plan.exists()


def _new(out: Path | None) -> Path:
    from skred.output import output_folder

    return output_folder(out, "prove")


def _seal(folder: "ProofFolder", sealing: Sealing, working: Working, silent: bool) -> None:
    """Seal, and say what stands for it."""
    from skred.prove.ledger import ledger_sha256
    from skred.prove.seal import seal as seal_trials

    plan = sealing.plan(folder)
    if not folder.ledger.exists():
        _tell(f"seed {plan.seed}", silent)
    with _Told(silent, plan.n) as told:
        ledger = seal_trials(folder, plan, working.worker_pool(), told.tell, told.advance)
    _tell(f"sealed: {folder.ledger}, SHA-256 {ledger_sha256(ledger)}", silent)


def _run(folder: "ProofFolder", working: Working, time_limit: float, silent: bool) -> None:
    """Diagnose, and say how many."""
    from skred.prove.ledger import read_ledger
    from skred.prove.run import Limits
    from skred.prove.run import run as run_trials

    n = read_ledger(folder)["n"]
    with _Told(silent, n) as told:
        counts = run_trials(folder, working.worker_pool(), told.tell, told.advance, Limits(time_limit))
    failed = f"{counts['crashed']} crashed, {counts['late']} ran out of time"
    _tell(f"answered: {counts['answered']} now, {counts['before']} before; of those now {failed}", silent)


def _reveal(folder: "ProofFolder", working: Working, partial: bool, as_json: bool, quiet: bool) -> int:
    """Open and score, and say where the scores are."""
    from skred.prove.reveal import reveal as reveal_trials
    from skred.report.folders import write_reports

    pool, silent = working.worker_pool(), quiet or as_json
    scorecard = reveal_trials(folder, pool, lambda line: _tell(line, silent), partial=partial)
    write_reports(folder.path)
    if as_json:
        write_json(scorecard)
    elif not quiet:
        print(f"written: {folder.path / 'scorecard.html'}")
    return DONE


def _tell(line: str, silent: bool) -> None:
    """Tell of one stage, on stderr."""
    if not silent:
        print(line, file=sys.stderr, flush=True)


class _Told:
    """What goes on, on stderr: a bar on a terminal, otherwise a line for each trial."""

    def __init__(self, silent: bool, total: int) -> None:
        self.silent, self.total = silent, total
        self.bar: Any = None

    def __enter__(self) -> "_Told":
        if sys.stderr.isatty() and not self.silent:
            from rich.console import Console
            from rich.progress import Progress

            self.bar = Progress(console=Console(stderr=True), transient=True)
            self.bar.start()
            self.task = self.bar.add_task("", total=self.total)
        return self

    def __exit__(self, *error: object) -> None:
        if self.bar is not None:
            self.bar.stop()

    def tell(self, line: str) -> None:
        """Say what begins."""
        if self.bar is not None:
            self.bar.update(self.task, description=line)
        else:
            _tell(line, self.silent)

    def advance(self, line: str) -> None:
        """One trial is done."""
        if self.bar is not None:
            self.bar.advance(self.task)
        else:
            _tell(line, self.silent)
