"""The alternatives under which the calibration on Ryggfonn is repeated, one change at a time."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from skred.campaign import Campaign, Status, find_campaign, read_campaign
from skred.inference.pooled.density import PooledArrays, pooled_arrays
from skred.inference.pooled.problem import PooledProblem, pooled_problem
from skred.physics.laws import load_law
from skred.physics.mechanisms import Mechanism, coulomb_friction
from skred.physics.terrain import build_terrain
from studies.reproduction.quadrature import GridPosterior, grid_posterior
from studies.ryggfonn.campaigns import build

FloatArray = NDArray[np.float64]
LAWS = ("coulomb", "pcm", "constant")
SHORT = {"coulomb": "M1", "pcm": "M2", "constant": "M3"}
BASELINE = "baseline"
_PLACE_OF_SENSOR = {"LC": "midpoint_LC", "CD": "midpoint_CD", "b": "upstream_foot"}


@dataclass(frozen=True, eq=False)
class Case:
    """One way to calibrate.

    Attributes
    ----------
    key, group, title : str
        For code; heading in the tables; what is changed, in words.
    problem : PooledProblem
    prior_factor : float
        Multiplies the scale of every prior.
    curvature : bool
        Whether dry friction feels the track's curvature.
    """

    key: str
    group: str
    title: str
    problem: PooledProblem
    prior_factor: float = 1.0
    curvature: bool = True

    def mechanisms(self, law_id: str) -> tuple[Mechanism, ...]:
        """Mechanisms of a law in this case."""
        summands = load_law(law_id).mechanisms
        if self.curvature:
            return summands
        flat, curved = coulomb_friction.WITHOUT_CURVATURE, coulomb_friction.MECHANISM
        return tuple(flat if mechanism.id == curved.id else mechanism for mechanism in summands)


@dataclass(frozen=True, eq=False)
class Outcome:
    """Posterior of one law in one case.

    Attributes
    ----------
    case : Case
    law_id : str
    posterior : GridPosterior
    response, response_sd : (n_sensors,) arrays, m/s and m
        Mean response: posterior mean and standard deviation.
    """

    case: Case
    law_id: str
    posterior: GridPosterior
    response: FloatArray
    response_sd: FloatArray


class StatedErrorsProblem(PooledProblem):
    """The pooled problem without event-to-event spread: each reading has its stated error only.

    A sensor that was not reached has no reading to state an error of; its latent one gets that of
    the mean recorded there.
    """

    @cached_property
    def arrays(self) -> PooledArrays:
        """As in `PooledProblem`, from a diagonal covariance for each event."""
        campaign = self.campaign
        usual = np.nanmean(self.values, axis=0)
        relative = np.array([sensor.relative_sd for sensor in campaign.sensors])
        absolute = np.array([sensor.absolute_sd for sensor in campaign.sensors])
        sd = np.where(self.observed, campaign.reading_sd(), np.hypot(relative * usual, absolute))
        rows = []
        for event in range(campaign.n_events):
            one = slice(event, event + 1)
            rows.append(
                pooled_arrays(
                    self.values[one],
                    self.observed[one],
                    self.not_reached[one],
                    self.release_of_event[one],
                    np.diag(sd[event] ** 2),
                )
            )
        return PooledArrays(*(np.concatenate(arrays) for arrays in zip(*rows, strict=True)))


def baseline_case() -> Case:
    """The calibration as the pack does it."""
    return Case(BASELINE, "", "baseline", pooled_problem(read_campaign(find_campaign("ryggfonn"))))


def all_cases(base: Case) -> list[Case]:
    """The baseline and every alternative, in the order of the tables."""
    raw = find_campaign("ryggfonn") / "raw"
    cases = [base, *_covariances(base), *_places(base, raw), *_terrains(base), *_others(base, raw)]
    return [*cases, *_priors(base), _together(raw)]


def outcome(case: Case, law_id: str, cells: int | None = None) -> Outcome:
    """Posterior of a law in a case, by quadrature."""
    mechanisms, problem = case.mechanisms(law_id), case.problem
    scales = [case.prior_factor * mechanism.strength.prior_scale for mechanism in mechanisms]
    posterior = grid_posterior(
        lambda rows: np.asarray(problem.log_density(mechanisms, rows).sum(axis=1)), scales, cells
    )
    readings = problem.simulate(mechanisms, posterior.nodes).mean(axis=1)
    return Outcome(case, law_id, posterior, *posterior.expect(readings))


def complete(problem: PooledProblem) -> NDArray[np.bool_]:
    """Which events have a reading of every sensor."""
    return np.asarray(problem.observed.all(axis=1))


def only_events(campaign: Campaign, keep: NDArray[np.bool_], name: str) -> Campaign:
    """A campaign without the other events."""
    return replace(
        campaign,
        name=name,
        events=tuple(event for event, kept in zip(campaign.events, keep, strict=True) if kept),
        values=campaign.values[keep],
        status=campaign.status[keep],
        stated_sd=campaign.stated_sd[keep],
    )


def _without(campaign: Campaign, sensors: NDArray[np.bool_]) -> Campaign:
    """A campaign that knows nothing of some sensors, which stay there to be predicted."""
    status = np.where(sensors, np.int8(Status.MISSING), campaign.status)
    return replace(campaign, status=status, values=np.where(sensors, np.nan, campaign.values))


def _covariances(base: Case) -> Iterator[Case]:
    problem, group = base.problem, "recordings"
    diagonal = replace(problem, covariance=np.diag(np.diag(problem.covariance)))
    yield Case("diagonal", group, "Sigma: variances only, no correlation", diagonal)
    full = complete(problem)
    from_complete = np.cov(problem.values[full].T, ddof=0)
    title = f"Sigma: from the {full.sum()} complete events, all events used"
    yield Case("sigma_complete", group, title, replace(problem, covariance=from_complete))
    stated = StatedErrorsProblem(problem.campaign, problem.terrain, problem.covariance, problem.recorded_mean)
    yield Case("stated", group, "stated reading errors only, no event-to-event spread", stated)
    campaign = only_events(problem.campaign, full, "ryggfonn-complete")
    yield Case(
        "dropped", group, f"only the {full.sum()} complete events, others dropped", pooled_problem(campaign)
    )
    runout = np.array([sensor.is_runout for sensor in problem.campaign.sensors])
    for key, title, left_out in (
        ("speeds", "speeds only, runout left out", runout),
        ("runout", "runout only, speeds left out", ~runout),
    ):
        yield Case(key, group, title, replace(problem, campaign=_without(problem.campaign, left_out)))
    after = np.array([event.covariates["dam_present"] == "yes" for event in problem.campaign.events])
    campaign = only_events(problem.campaign, after, "ryggfonn-after-dam")
    yield Case("after_dam", group, "without 19750225 (before the dam)", pooled_problem(campaign))


def place_uncertainties(raw: Path) -> dict[str, float]:
    """Stated uncertainty of each point sensor's place [m]."""
    with (raw / "places.csv").open(encoding="utf-8", newline="") as file:
        stated = {row["place"]: float(row["uncertainty_m"]) for row in csv.DictReader(file)}
    return {sensor: stated[place] for sensor, place in _PLACE_OF_SENSOR.items()}


def _places(base: Case, raw: Path) -> Iterator[Case]:
    for sensor_id, uncertainty_m in place_uncertainties(raw).items():
        for shift_m in (-uncertainty_m, uncertainty_m):
            where = "up" if shift_m < 0 else "down"
            title = f"{sensor_id} {abs(shift_m):g} m further {where} the track"
            campaign = _shifted(base.problem.campaign, sensor_id, shift_m)
            yield Case(
                f"{sensor_id}{shift_m:+g}", "sensor places", title, replace(base.problem, campaign=campaign)
            )
    spans = pooled_problem(build(raw, spans=True))
    yield Case("spans", "sensor places", "LC and CD read as means over their spans", spans)


def _shifted(campaign: Campaign, sensor_id: str, shift_m: float) -> Campaign:
    sensors = tuple(
        replace(sensor, s_from_m=sensor.s_from_m + shift_m, s_to_m=sensor.s_to_m + shift_m)
        if sensor.id == sensor_id
        else sensor
        for sensor in campaign.sensors
    )
    return replace(campaign, sensors=sensors)


def _terrains(base: Case) -> Iterator[Case]:
    track, group = base.problem.campaign.track, "terrain"
    for smoothing_m in (5.0, 20.0, 40.0):
        terrain = build_terrain(track.x_m, track.z_m, smoothing_m=smoothing_m)
        title = f"smoothing length {smoothing_m:g} m"
        yield Case(f"smoothing{smoothing_m:g}", group, title, replace(base.problem, terrain=terrain))
    terrain = build_terrain(track.x_m, track.z_m, cell_m=3.0)
    title = "cells of 3 m"
    yield Case("cell3", group, title, replace(base.problem, terrain=terrain))
    yield replace(base, key="flat", group=group, title="no curvature in the normal force", curvature=False)
    dam = pooled_problem(read_campaign(find_campaign("ryggfonn-with-dam")))
    yield Case("dam", group, "surveyed track, with the dam", dam)


def _others(base: Case, raw: Path) -> Iterator[Case]:
    for release_s_m in (50.0, 100.0, 150.0):
        campaign = build(raw, release_s_m=release_s_m)
        yield Case(
            f"release{release_s_m:g}",
            "release",
            f"all fronts start at s = {release_s_m:g} m",
            replace(base.problem, campaign=campaign),
        )


def _priors(base: Case) -> Iterator[Case]:
    for factor, word in ((2.0, "twice as wide"), (0.5, "half as wide")):
        yield replace(
            base, key=f"prior{factor:g}", group="priors", title=f"priors {word}", prior_factor=factor
        )


def _together(raw: Path) -> Case:
    """The two changes that favour fast fronts and an energy line that starts lower, at once."""
    late = pooled_problem(build(raw, release_s_m=100.0))
    campaign = only_events(late.campaign, complete(late), "ryggfonn-complete-late")
    return Case(
        "together", "combined", "complete events only and start at s = 100 m", pooled_problem(campaign)
    )
