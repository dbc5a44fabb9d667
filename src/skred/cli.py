"""The command line: ``skred COMMAND``.

A command is a function decorated with ``@app.command`` that returns its exit code: 0 done, 1 the gate failed,
2 bad input. Everything heavy is imported inside the functions, so that ``--help`` is instant.
"""

import json
import os
import sys
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cyclopts import App, CycloptsError

from skred.cli_options import (
    TUNE,
    BaseModel,
    Campaigns,
    Chains,
    Draws,
    Errors,
    ExactLoo,
    Force,
    Json,
    Likelihoods,
    Models,
    Out,
    Quiet,
    Release,
    Samplers,
    Seed,
    Smoothing,
    TrackFile,
    Tune,
)
from skred.errors import InputError

if TYPE_CHECKING:
    from skred.campaign import Campaign, CampaignError
    from skred.inference.hierarchical import HierarchicalProblem
    from skred.inference.problem import PooledProblem, Problem
    from skred.physics.law import Law

DONE, GATE_FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130

app = App(
    name="skred",
    help="Calibrate avalanche models against recordings, and find the physics that they miss.",
    version=lambda: version("skred"),
    result_action="return_value",
    # main() decides what an interruption means, the same for every command.
    suppress_keyboard_interrupt=False,
)


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit.

    Parameters
    ----------
    arguments : list of str, optional
        The words after ``skred``; by default those of this process.
    """
    sys.exit(run(sys.argv[1:] if arguments is None else arguments))


def run_model(law_id: str) -> None:
    """Run a law of the pack as a program: ``python -m models.pcm``."""
    from skred.laws import load_law

    program = App(
        name=f"python -m models.{law_id}",
        help=f"Calibrate a law: {load_law(law_id).title}.",
        version=lambda: version("skred"),
        result_action="return_value",
        suppress_keyboard_interrupt=False,
    )

    def calibrate_law(
        *,
        campaign: Campaigns = "ryggfonn",
        likelihood: Likelihoods = "pooled",
        errors: Errors = None,
        sampler: Samplers = "metropolis",
        draws: Draws = 1000,
        tune: Tune = None,
        chains: Chains = 4,
        seed: Seed = 0,
        smoothing: Smoothing = 10.0,
        out: Out = None,
        force: Force = False,
        as_json: Json = False,
        quiet: Quiet = False,
    ) -> int:
        """Sample the posterior, check it, and write summary.json, posterior.nc and figures."""
        settings = {
            "sampler": sampler,
            "draws": draws,
            "tune": tune or TUNE[likelihood],
            "chains": chains,
            "seed": seed,
        }
        problem = _problem(campaign, likelihood, errors, smoothing)
        return _calibrate(law_id, problem, settings, out, force, as_json, quiet)

    program.default(calibrate_law)
    sys.exit(run(sys.argv[1:], program))


def run(arguments: list[str], program: App = app) -> int:
    """Run one command and return its exit code; what is wrong with the input is told on stderr."""
    try:
        code = program(arguments, exit_on_error=False)
        sys.stdout.flush()
    except CycloptsError:
        return BAD_INPUT  # cyclopts has told what is wrong
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return BAD_INPUT
    except ValueError as error:
        from skred.campaign.problems import CampaignError

        if not isinstance(error, CampaignError):
            raise
        _tell_problems(error)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        _discard_output()  # its reader, such as `head`, has seen enough
        return DONE
    except OSError as error:
        _discard_output()
        print(f"cannot read or write: {error}", file=sys.stderr)
        return BAD_INPUT
    return code if isinstance(code, int) else DONE


@app.command
def validate(campaign: Campaigns, /, *, as_json: Json = False, quiet: Quiet = False) -> int:
    """Check the files of a campaign and list every problem."""
    from skred.campaign import CampaignError, find_campaign, read_campaign

    try:
        checked = read_campaign(find_campaign(campaign))
    except CampaignError as error:
        if not as_json:
            raise
        _write_json({"valid": False, "problems": [problem.as_dict() for problem in error.problems]})
        return BAD_INPUT
    from skred.work.campaign_summary import campaign_summary, summary_table

    if as_json:
        _write_json({"valid": True, "problems": [], **campaign_summary(checked)})
    elif not quiet:
        from rich.console import Console

        Console().print(summary_table(campaign_summary(checked)))
    return DONE


@app.command
def compare(
    campaign: Campaigns = "ryggfonn",
    /,
    *,
    models: Models = "coulomb,pcm,constant,voellmy",
    likelihood: Likelihoods = "pooled",
    errors: Errors = None,
    exact_loo: ExactLoo = False,
    draws: Draws = 1000,
    tune: Tune = None,
    chains: Chains = 4,
    seed: Seed = 0,
    smoothing: Smoothing = 10.0,
    out: Out = None,
    force: Force = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Calibrate several laws and say which one the recordings prefer, and by how much."""
    from skred.work.output import output_folder, plain

    laws = _laws(models)
    problem = _problem(campaign, likelihood, errors, smoothing)
    folder = output_folder(out, "compare", force=force)

    from skred.inference.hierarchical import HierarchicalProblem
    from skred.inference.sampling import SamplerSettings
    from skred.report.tables import comparison_table
    from skred.work.compare import compare as compare_pooled
    from skred.work.compare_hierarchical import compare_hierarchical

    settings = SamplerSettings("metropolis", draws, tune or TUNE[likelihood], chains, seed)
    tell = _teller(quiet or as_json)
    if isinstance(problem, HierarchicalProblem):
        pooled = _pooled_or_reason(problem.campaign, smoothing)
        comparison = compare_hierarchical(problem, pooled, laws, settings, folder, tell, exact=exact_loo)
    else:
        comparison = compare_pooled(problem, laws, settings, folder, tell)
    if as_json:
        _write_json(plain(comparison))
    elif not quiet:
        _show(comparison_table(comparison), comparison["statement"], folder / "report.html")
    return DONE if all(model["gate"]["passed"] for model in comparison["models"]) else GATE_FAILED


@app.command
def predict(
    campaign: Campaigns = "ryggfonn",
    /,
    *,
    base_model: BaseModel = "pcm",
    track: TrackFile = None,
    release: Release = None,
    errors: Errors = None,
    draws: Draws = 1000,
    tune: Tune = None,
    chains: Chains = 4,
    seed: Seed = 0,
    smoothing: Smoothing = 10.0,
    out: Out = None,
    force: Force = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Say how fast and how far the next avalanche goes, and how sure that is, along a track."""
    from skred.laws import load_law
    from skred.work.output import output_folder, plain

    law = load_law(base_model)
    problem = _hierarchical(_campaign(campaign), errors, smoothing)

    from skred.inference.sampling import SamplerSettings
    from skred.report.predicting import prediction_table
    from skred.work.predict import predict as predict_avalanches
    from skred.work.predict_track import prediction_track

    where = prediction_track(problem, track, release)
    folder = output_folder(out, "predict", force=force)
    settings = SamplerSettings("metropolis", draws, tune or TUNE["hierarchical"], chains, seed)
    silent = quiet or as_json
    progress = sys.stderr.isatty() and not silent
    prediction = predict_avalanches(problem, law, settings, folder, where, _teller(silent), progress=progress)
    if as_json:
        _write_json(plain(prediction))
    elif not quiet:
        _show(prediction_table(prediction), prediction["statement"], folder)
    return DONE if prediction["gate"]["passed"] else GATE_FAILED


def _calibrate(
    law_id: str,
    problem: "Problem",
    settings: dict[str, Any],
    out: Path | None,
    force: bool,
    as_json: bool,
    quiet: bool,
) -> int:
    """Calibrate one law and tell what came out."""
    from skred.laws import load_law
    from skred.work.output import output_folder, plain

    law = load_law(law_id)
    folder = output_folder(out, law_id, force=force)
    tell = _teller(quiet or as_json)
    tell(f"{law_id}: sampling")

    from skred.inference.sampling import SamplerSettings
    from skred.report.tables import summary_table
    from skred.work.calibrate import calibrate, write_calibration

    progress = sys.stderr.isatty() and not (quiet or as_json)
    calibration = calibrate(problem, law, SamplerSettings(**settings), progress=progress)
    tell(f"{law_id}: writing {folder}")
    write_calibration(calibration, folder)
    entry, gate = calibration.entry(), calibration.gate
    if as_json:
        _write_json(plain(entry))
    elif not quiet:
        verdict = "the chains can be trusted" if gate.passed else "THE GATE FAILED: do not use this result"
        measured = f"r-hat at most {gate.r_hat_max:.3f}, effective draws at least {gate.ess_bulk_min:.0f}"
        _show(summary_table(entry), [f"{verdict} ({measured})", *gate.problems], folder)
    return DONE if gate.passed else GATE_FAILED


def _laws(names: str) -> "list[Law]":
    """Laws from a list of names; each once."""
    from skred.laws import load_law

    wanted = list(dict.fromkeys(name.strip() for name in names.split(",") if name.strip()))
    if not wanted:
        raise InputError("--models: expected names of laws separated by commas, found none")
    return [load_law(name) for name in wanted]


def _campaign(name: str) -> "Campaign":
    """A campaign that passed every check."""
    from skred.campaign import find_campaign, read_campaign

    return read_campaign(find_campaign(name))


def _problem(
    campaign: str, likelihood: str, errors: str | None, smoothing: float
) -> "PooledProblem | HierarchicalProblem":
    """The problem of a campaign, or what is wrong with it."""
    checked = _campaign(campaign)
    if likelihood == "hierarchical":
        return _hierarchical(checked, errors, smoothing)
    if errors is not None:
        raise InputError(
            "--errors: only with --likelihood hierarchical; pooled errors come from the recordings"
        )
    problem = _pooled_or_reason(checked, smoothing)
    if isinstance(problem, str):
        raise InputError(f"campaign {checked.name}: {problem}")
    return problem


def _hierarchical(campaign: "Campaign", errors: str | None, smoothing: float) -> "HierarchicalProblem":
    """The hierarchical problem of a campaign, or what is wrong with it."""
    from skred.inference.error_model import DEFAULT_ERRORS
    from skred.inference.hierarchical import hierarchical_problem

    try:
        return hierarchical_problem(campaign, error_model=errors or DEFAULT_ERRORS, smoothing_m=smoothing)
    except ValueError as error:
        raise InputError(f"campaign {campaign.name}: {error}") from error


def _pooled_or_reason(campaign: "Campaign", smoothing: float) -> "PooledProblem | str":
    """The pooled problem of a campaign, or why there is none."""
    from skred.inference.problem import pooled_problem

    try:
        problem = pooled_problem(campaign, smoothing_m=smoothing)
        _ = problem.arrays
    except ValueError as error:
        return str(error)
    return problem


def _teller(silent: bool) -> Any:
    """One line for each stage, on stderr."""
    return (lambda line: None) if silent else (lambda line: print(line, file=sys.stderr, flush=True))


def _show(table: Any, sentences: list[str], where: Path) -> None:
    """A table, what it says, and where the rest is."""
    from rich.console import Console
    from rich.text import Text

    console = Console()
    console.print(table)
    for sentence in sentences:
        console.print(Text(sentence))
    console.print(Text(f"\nwritten: {where}"), soft_wrap=True)


def _discard_output() -> None:
    """Send what is still in stdout's buffer nowhere; Python would fail again to write it at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _tell_problems(error: "CampaignError") -> None:
    """List what is wrong, on stderr."""
    from skred.campaign.problems import problem_lines

    count = len(error.problems)
    print(f"{count} {'problem' if count == 1 else 'problems'}:", file=sys.stderr)
    for line in problem_lines(error.problems):
        print(f"  {line}", file=sys.stderr)


def _write_json(document: dict[str, Any]) -> None:
    """Write a document to stdout, in ASCII so that every terminal and pipe takes it."""
    print(json.dumps(document, indent=2))


if __name__ == "__main__":
    main()
