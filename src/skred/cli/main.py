"""The command line: ``skred COMMAND``.

A command is a function decorated with ``@app.command`` that returns its exit code: 0 done, 1 the gate failed,
2 bad input. Everything heavy is imported inside the functions, so that ``--help`` is instant.
"""

import os
import sys
from dataclasses import replace
from importlib.metadata import version
from typing import TYPE_CHECKING

from cyclopts import App, CycloptsError

from skred.cli.inputs import campaign_of, hierarchical_of, laws_of, pooled_or_reason, problem_of
from skred.cli.options import (
    DIAGNOSIS_SAMPLING,
    MAX_MECHANISMS,
    SAMPLING,
    BaseModel,
    Campaigns,
    DiagnosedModel,
    Errors,
    ExactHeldOut,
    ExactLoo,
    IdleSeed,
    Json,
    Likelihoods,
    Lock,
    MaxMechanisms,
    MechanismIds,
    Models,
    OuterFolds,
    Quick,
    Quiet,
    Release,
    Samplers,
    Sampling,
    Seed,
    Smoothing,
    TrackFile,
)
from skred.cli.output import OUTPUT, Output, write_json
from skred.cli.prove import prove_app
from skred.errors import InputError

if TYPE_CHECKING:
    from skred.campaign import CampaignError
    from skred.inference.problem import Problem

DONE, GATE_FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130


def _program(name: str, purpose: str) -> App:
    """A command line; `run` decides what an interruption means, the same for every command."""
    return App(
        name=name,
        help=purpose,
        version=lambda: version("skred"),
        result_action="return_value",
        suppress_keyboard_interrupt=False,
    )


app = _program("skred", "Calibrate avalanche models against recordings, and find the physics that they miss.")
app.command(prove_app)


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
    from skred.physics.laws import load_law

    program = _program(f"python -m models.{law_id}", f"Calibrate a law: {load_law(law_id).title}.")

    def calibrate_law(
        *,
        campaign: Campaigns = "ryggfonn",
        likelihood: Likelihoods = "pooled",
        errors: Errors = None,
        sampler: Samplers = "metropolis",
        sampling: Sampling = SAMPLING,
        smoothing: Smoothing = 10.0,
        output: Output = OUTPUT,
    ) -> int:
        """Sample the posterior, check it, and write summary.json, posterior.nc and figures."""
        problem = problem_of(campaign, likelihood, errors, smoothing)
        return _calibrate(law_id, problem, sampling, sampler, output)

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
        write_json({"valid": False, "problems": [problem.as_dict() for problem in error.problems]})
        return BAD_INPUT
    from skred.campaign.summary import campaign_summary, summary_table

    if as_json:
        write_json({"valid": True, "problems": [], **campaign_summary(checked)})
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
    sampling: Sampling = SAMPLING,
    smoothing: Smoothing = 10.0,
    output: Output = OUTPUT,
) -> int:
    """Calibrate several laws and say which one the recordings prefer, and by how much."""
    laws = laws_of(models)
    problem = problem_of(campaign, likelihood, errors, smoothing)
    folder = output.folder("compare")

    from skred.inference.hierarchical.problem import HierarchicalProblem
    from skred.model_selection.compare import compare as compare_pooled
    from skred.model_selection.compare_hierarchical import compare_hierarchical
    from skred.report.shared.tables import comparison_table

    settings, tell = sampling.settings(likelihood), output.tell
    if isinstance(problem, HierarchicalProblem):
        pooled = pooled_or_reason(problem.campaign, smoothing)
        comparison = compare_hierarchical(problem, pooled, laws, settings, folder, tell, exact=exact_loo)
    else:
        comparison = compare_pooled(problem, laws, settings, folder, tell)
    output.show(comparison, comparison_table, comparison["statement"], folder / "report.html")
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
    sampling: Sampling = SAMPLING,
    smoothing: Smoothing = 10.0,
    output: Output = OUTPUT,
) -> int:
    """Say how fast and how far the next avalanche goes, and how sure that is, along a track."""
    from skred.physics.laws import load_law

    law = load_law(base_model)
    problem = hierarchical_of(campaign_of(campaign), errors, smoothing)

    from skred.prediction.predict import predict as predict_avalanches
    from skred.prediction.track import prediction_track
    from skred.report.prediction.figures import prediction_table

    where = prediction_track(problem, track, release)
    folder = output.folder("predict")
    settings = sampling.settings("hierarchical")
    prediction = predict_avalanches(
        problem, law, settings, folder, where, output.tell, progress=output.progress
    )
    output.show(prediction, prediction_table, prediction["statement"], folder)
    return DONE if prediction["gate"]["passed"] else GATE_FAILED


@app.command
def diagnose(
    campaign: Campaigns = "ryggfonn",
    /,
    *,
    base_model: DiagnosedModel = "pcm",
    max_mechanisms: MaxMechanisms = None,
    exact_loo: ExactHeldOut = False,
    outer_folds: OuterFolds = None,
    lock: Lock = None,
    quick: Quick = False,
    errors: Errors = None,
    seed: Seed = 0,
    smoothing: Smoothing = 10.0,
    output: Output = OUTPUT,
) -> int:
    """Say what physics a law leaves out, where and how surely, model it, and show what that improves."""
    from skred.parallel.processes import helpers

    recorded = campaign_of(campaign)
    with helpers("skred.diagnosis.diagnose"):  # they load packages while this process loads its own
        from skred.physics.laws import load_law

        law = load_law(base_model)
        problem = hierarchical_of(recorded, errors, smoothing)
        folder = output.folder("diagnose")

        from skred.diagnosis.diagnose import QUICK_REPLICAS, Effort
        from skred.diagnosis.run import diagnose_to
        from skred.report.diagnosis.report import diagnosis_table

        replicas = QUICK_REPLICAS if quick else Effort.replicas
        effort = Effort(replicas, max_mechanisms or MAX_MECHANISMS[quick], exact_loo)
        settings = replace(DIAGNOSIS_SAMPLING, seed=seed).settings("hierarchical")
        document = diagnose_to(
            problem, law, settings, effort, folder, output.tell, lock=lock or 0, folds=outer_folds or 0
        )
    output.show(document, diagnosis_table, [], folder)  # the statement is in the table
    return DONE if document["reason"] is None else GATE_FAILED


@app.command
def identify(
    campaign: Campaigns = "ryggfonn",
    /,
    *,
    base_model: DiagnosedModel = "pcm",
    errors: Errors = None,
    seed: IdleSeed = 0,
    smoothing: Smoothing = 10.0,
    output: Output = OUTPUT,
) -> int:
    """Say what these recordings can tell at all: from what strength on each mechanism would be seen."""
    from skred.physics.laws import load_law

    law = load_law(base_model)
    problem = hierarchical_of(campaign_of(campaign), errors, smoothing)
    folder = output.folder("identify")

    from skred.diagnosis.detect.run import identify_table, identify_to

    document = identify_to(problem, law, folder, output.tell)
    output.show(document, identify_table, document["statement"], folder)
    return DONE if document["reason"] is None else GATE_FAILED


@app.command
def mechanisms(mechanism: MechanismIds = None, /, *, as_json: Json = False, quiet: Quiet = False) -> int:
    """List the mechanisms that a law may lack, or show one of them in full."""
    from skred.physics.laws import law_ids, load_law
    from skred.physics.mechanisms import mechanisms as library
    from skred.report.mechanisms import mechanism_document, mechanism_table, mechanisms_table

    known = library()
    if mechanism is not None and mechanism not in known:
        raise InputError(f"no mechanism named {mechanism!r}; there are: {', '.join(sorted(known))}")
    laws = [load_law(law_id) for law_id in law_ids()]
    documents = [mechanism_document(known[name], laws) for name in sorted(known)]
    chosen = next((one for one in documents if one["id"] == mechanism), None)
    if as_json:
        write_json({"mechanisms": documents} if chosen is None else chosen)
    elif not quiet:
        from rich.console import Console

        n_laws = len(laws)
        table = mechanisms_table(documents, n_laws) if chosen is None else mechanism_table(chosen, n_laws)
        Console().print(table)
    return DONE


def _calibrate(law_id: str, problem: "Problem", sampling: Sampling, sampler: Samplers, output: Output) -> int:
    """Calibrate one law and tell what came out."""
    from skred.physics.laws import load_law

    law = load_law(law_id)
    folder = output.folder(law_id)
    output.tell(f"{law_id}: sampling")

    from skred.inference.calibrate import calibrate, write_calibration
    from skred.report.calibration.figures import save_model_figures
    from skred.report.shared.tables import summary_table

    settings = sampling.settings(problem.likelihood, sampler)
    calibration = calibrate(problem, law, settings, progress=output.progress)
    output.tell(f"{law_id}: writing {folder}")
    write_calibration(calibration, folder)
    save_model_figures(calibration.tree, law, problem, folder)
    gate = calibration.gate
    verdict = "the chains can be trusted" if gate.passed else "THE GATE FAILED: do not use this result"
    measured = f"r-hat at most {gate.r_hat_max:.3f}, effective draws at least {gate.ess_bulk_min:.0f}"
    output.show(calibration.entry(), summary_table, [f"{verdict} ({measured})", *gate.problems], folder)
    return DONE if gate.passed else GATE_FAILED


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


if __name__ == "__main__":
    main()
