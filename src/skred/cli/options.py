"""Options that commands share, each with its check and its help."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter, validators

if TYPE_CHECKING:
    from skred.diagnosis.effort import Effort
    from skred.inference.sampling import SamplerSettings
    from skred.prediction.wanted import Wanted

Campaigns = Annotated[str, Parameter(help="A folder, or the name of an embedded campaign.")]
Models = Annotated[str, Parameter(help="Laws, separated by commas.")]
BaseModel = Annotated[str | None, Parameter(help="The law to predict with; by default pcm.")]
PredictedCampaign = Annotated[
    str | None,
    Parameter(help="A folder, or the name of an embedded campaign; by default ryggfonn. Not with --from."),
]
DiagnosedModel = Annotated[str, Parameter(help="The law that something may be missing from.")]
MechanismIds = Annotated[
    str | None, Parameter(name="mechanism", help="Id of the one to show in full; by default all, in a table.")
]
MaxMechanisms = Annotated[
    int | None,
    Parameter(
        validator=validators.Number(gte=1, lte=2),
        help="Mechanisms added at most, one after the other; by default 2, with --quick 1.",
    ),
]
Quick = Annotated[
    bool,
    Parameter(
        name="--quick",
        negative="",
        help="One mechanism at most, and no second comparison for another.",
    ),
]
TrackFile = Annotated[
    Path | None,
    Parameter(help="Track to predict on: a table like a campaign's track.csv; by default the campaign's."),
]
From = Annotated[
    Path | None,
    Parameter(
        name="--from",
        help="Folder of skred calibrate, predict or diagnose: predict with that, and sample nothing.",
    ),
]
Releases = Annotated[
    list[str] | None,
    Parameter(
        name="--release",
        negative="",
        help="Where fronts start, S or S:WEIGHT, m; repeat it for several. By default as recorded, on another"
        " track its first point.",
    ),
]
Places = Annotated[
    list[str] | None,
    Parameter(
        name="--at",
        negative="",
        help="A place to predict at, NAME=S; repeat it. S is the length along the slope from the track's"
        " first point, m, not the distance on the map. By default the sensors and the reference.",
    ),
]
SpeedThresholds = Annotated[
    list[float] | None,
    Parameter(
        name="--speed", negative="", help="Front speed to exceed, m/s; repeat it. By default 10, 20 and 30."
    ),
]
PressureThresholds = Annotated[
    list[float] | None,
    Parameter(name="--pressure", negative="", help="Impact pressure to exceed, kPa; repeat it."),
]
Density = Annotated[
    str,
    Parameter(
        help="LOW,HIGH of the density of the flow, kg/m3, each value in between as likely; or one, exact."
    ),
]
DragCoefficient = Annotated[
    str,
    Parameter(
        help="LOW,HIGH of the obstacle's drag coefficient, each value in between as likely; or one, exact."
    ),
]
PerYear = Annotated[
    str | None,
    Parameter(
        help="RATE (exact) or RATE,SD of avalanches like those recorded, per year: adds probabilities in a"
        " year and return periods."
    ),
]
ReturnPeriods = Annotated[
    list[float] | None,
    Parameter(
        name="--return-period",
        negative="",
        consume_multiple=True,
        help="Years, one or several: the runout that is passed once in that time on average. Needs"
        " --per-year.",
    ),
]
Samplers = Annotated[
    Literal["metropolis", "nuts", "smc"],
    Parameter(help="PyMC's Metropolis with joint adapted proposals, NUTS, or sequential Monte Carlo."),
]
Draws = Annotated[
    int, Parameter(validator=validators.Number(gte=4, lte=1_000_000), help="Draws kept per chain.")
]
Tune = Annotated[
    int | None,
    Parameter(
        validator=validators.Number(gte=1, lte=1_000_000),
        help="Adaptation draws before them; by default 500, hierarchical 1000.",
    ),
]
Chains = Annotated[int, Parameter(validator=validators.Number(gte=2, lte=100), help="Number of chains.")]
Likelihoods = Annotated[
    Literal["pooled", "hierarchical"],
    Parameter(help="Pooled: one parameter vector for the path. Hierarchical: every avalanche has its own."),
]
Errors = Annotated[
    Literal["robust", "normal", "student", "correlated", "scaled"] | None,
    Parameter(help="Hierarchical: errors of readings around what each front does; robust by default."),
]
ExactLoo = Annotated[
    bool,
    Parameter(
        name="--exact-loo",
        negative="",
        help="Hierarchical: refit without every event, not only where importance sampling is unreliable.",
    ),
]
ExactHeldOut = Annotated[
    bool,
    Parameter(
        name="--exact-loo",
        negative="",
        help="Refit without every event, not only where importance sampling is unreliable.",
    ),
]
Lock = Annotated[
    int | None,
    Parameter(
        validator=validators.Number(gte=1, lte=10_000),
        help="Avalanches set aside by chance before anything is looked at, and opened once at the end.",
    ),
]
OuterFolds = Annotated[
    int | None,
    Parameter(
        validator=validators.Number(gte=2, lte=10_000),
        help="Repeat the whole diagnosis so often, each time without some avalanches, to predict those.",
    ),
]
Priors = Annotated[
    Path | None,
    Parameter(
        help="A TOML file with other scales of priors, such as: dry_friction = 0.3; told in every result."
    ),
]
IdleSeed = Annotated[
    int,
    Parameter(validator=validators.Number(gte=0, lt=2**31), help="Without effect: nothing is random here."),
]
Seed = Annotated[int, Parameter(validator=validators.Number(gte=0, lt=2**31), help="Seed of all randomness.")]
Smoothing = Annotated[
    float | None,
    Parameter(
        validator=validators.Number(gte=0.0, lte=1000.0),
        help="Smoothing length of the terrain, m; by default 10, in proportion less on tracks below 600 m.",
    ),
]
Out = Annotated[
    Path | None,
    Parameter(
        help="Folder for the results: new, empty, or with --force; by default a fresh one in skred-out."
    ),
]
Force = Annotated[
    bool,
    Parameter(
        name="--force",
        negative="",
        help="Use a folder that holds files, and replace or remove what the same command wrote there before. "
        "The earlier results stay until the run is done.",
    ),
]
ReplaceCampaign = Annotated[
    bool,
    Parameter(
        name="--force",
        negative="",
        help="Replace the campaign that the folder holds; other files in it are kept.",
    ),
]
Quiet = Annotated[bool, Parameter(name="--quiet", negative="", help="Write nothing but errors.")]
Json = Annotated[bool, Parameter(name="--json", negative="", help="Write the result as JSON to stdout.")]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Sampling:
    """Options of a command that samples: ``sampling: Sampling = SAMPLING`` gives it all of them."""

    draws: Draws = 1000
    tune: Tune = None
    chains: Chains = 4
    seed: Seed = 0

    def settings(self, likelihood: str, sampler: Samplers = "metropolis") -> "SamplerSettings":
        """As the sampler wants them, for a likelihood."""
        from skred.inference.sampling import TUNE, SamplerSettings

        tune = self.tune or TUNE[likelihood]
        return SamplerSettings(sampler, self.draws, tune, self.chains, self.seed)


SAMPLING = Sampling()
"""How a command samples unless told otherwise."""


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Hierarchical:
    """Options of a command for which every avalanche has its own parameters."""

    errors: Errors = None
    smoothing: Smoothing = None


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Likelihood:
    """Options of a command that takes both likelihoods."""

    likelihood: Likelihoods = "pooled"
    errors: Errors = None
    smoothing: Smoothing = None


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Diagnosing:
    """How much a diagnosis does."""

    max_mechanisms: MaxMechanisms = None
    exact_loo: ExactHeldOut = False
    outer_folds: OuterFolds = None
    lock: Lock = None
    quick: Quick = False
    seed: Seed = 0

    def settings(self) -> "SamplerSettings":
        """As the sampler wants them."""
        from skred.diagnosis.effort import SAMPLING

        return replace(SAMPLING, seed=self.seed)

    def effort(self) -> "Effort":
        """As the diagnosis wants it."""
        from skred.diagnosis.effort import effort_of

        effort = replace(effort_of(self.quick), exact_loo=self.exact_loo)
        if self.max_mechanisms is None:
            return effort
        return replace(effort, max_mechanisms=self.max_mechanisms)


HIERARCHICAL, LIKELIHOOD, DIAGNOSING = Hierarchical(), Likelihood(), Diagnosing()
"""What a command does unless told otherwise."""


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Asked:
    """What is asked of a prediction."""

    at: Places = None
    speed: SpeedThresholds = None
    pressure: PressureThresholds = None
    density: Density = "100,300"
    drag_coefficient: DragCoefficient = "1,2"
    per_year: PerYear = None
    return_period: ReturnPeriods = None

    def wanted(self) -> "Wanted":
        """The same, checked."""
        from skred.prediction.wanted import Rate, Wanted, numbers_of, place_of

        low_high = [
            numbers_of(option, text, 2)
            for option, text in (("--density", self.density), ("--drag-coefficient", self.drag_coefficient))
        ]
        density, drag = ((values[0], values[-1]) for values in low_high)
        rate = None if self.per_year is None else Rate(*numbers_of("--per-year", self.per_year, 2))
        speeds = {} if self.speed is None else {"speeds_m_s": tuple(self.speed)}
        return Wanted(
            places=tuple(place_of(text) for text in self.at or ()),
            pressures_kpa=tuple(self.pressure or ()),
            density_kg_m3=density,
            drag_coefficient=drag,
            rate=rate,
            return_periods_years=tuple(self.return_period or ()),
            **speeds,
        )


ASKED = Asked()
"""What is asked unless told otherwise."""
