"""Prior odds, probabilities, the omnibus check's p-value and the verdict: the campaign format, by hand."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from skred.diagnosis.check.bootstrap_test import BootstrapTest
from skred.diagnosis.check.decision import Decision, decide, smallest_set
from skred.diagnosis.evidence.linear_mixed_model import mean_prior
from skred.diagnosis.evidence.prior_odds import POWER, prior_odds, probabilities, stated
from skred.diagnosis.limits import LIMIT
from skred.diagnosis.words import prior_note
from skred.inference.priors import laws_with_priors
from skred.physics.laws import load_law
from skred.physics.mechanisms import mechanisms
from skred.physics.mechanisms.spec import Group

ALL = [m for m in mechanisms().values() if m.added is not None]
PHYSICS = [m.id for m in ALL if m.group is Group.PHYSICS]
INSTRUMENT = [m.id for m in ALL if m.group is Group.INSTRUMENT]


def test_a_prior_that_the_search_does_not_have_is_said_to_be_none_of_its_own() -> None:
    """Voellmy's xi h is no coefficient; its dry friction is one."""
    [plain] = laws_with_priors([load_law("voellmy")], {"dry_friction": 0.4})
    [both] = laws_with_priors([load_law("voellmy")], {"dry_friction": 0.4, "xi_h": 2e4})
    assert prior_note(load_law("voellmy")) == "" and prior_note(plain) == plain.prior_note
    assert mean_prior(plain).mean[0] < mean_prior(load_law("voellmy")).mean[0]
    assert mean_prior(both).mean.tolist() == mean_prior(plain).mean.tolist()
    said = prior_note(both).removeprefix(both.prior_note)
    assert (
        said
        == " What may be missing is looked for under priors of the coefficients, which xi_h does not change."
    )


def test_prior_odds_of_the_whole_library() -> None:
    odds = prior_odds(ALL)
    assert INSTRUMENT == ["release_offset", "sensor_bias", "sensor_place"] and len(PHYSICS) >= 8
    assert odds["nothing"] == pytest.approx(0.5) and odds["unlisted"] == pytest.approx(0.05)
    shares = dict.fromkeys(PHYSICS, 1.0) | {"segment_drag": 1.5, "entrainment": 0.5}  # one term, two names
    for name, share in shares.items():
        assert odds[name] == pytest.approx(0.35 * share / len(PHYSICS))
    assert odds["sensor_bias"] == odds["release_offset"] == pytest.approx(0.1 / 3.0)
    assert sum(odds.values()) == pytest.approx(1.0)


def test_prior_odds_of_groups_without_members() -> None:
    odds = prior_odds([mechanisms()["obstacle"], mechanisms()["viscous_drag"]])
    assert odds == pytest.approx(
        {"nothing": 0.5 / 0.9, "unlisted": 0.05 / 0.9, "obstacle": 0.175 / 0.9, "viscous_drag": 0.175 / 0.9}
    )
    assert prior_odds([]) == pytest.approx({"nothing": 10.0 / 11.0, "unlisted": 1.0 / 11.0})


def test_two_names_of_one_term_are_one_candidate_with_both_priors() -> None:
    alone = prior_odds([mechanisms()["obstacle"], mechanisms()["segment_drag"]])
    assert alone["segment_drag"] == pytest.approx(2.0 * alone["obstacle"])  # entrainment's share is its own
    assert "entrainment" not in alone
    names = decide({"nothing": 0.01, "unlisted": 0.01, "segment_drag": 0.95, "obstacle": 0.03}, 0.001, True)
    assert names == Decision("missing_physics", ("segment_drag", "entrainment"))
    both = {"nothing": 0.01, "unlisted": 0.01, "segment_drag": 0.5, "obstacle": 0.3, "entrainment": 0.18}
    assert decide(both, 0.001, True).names == ("segment_drag", "obstacle", "entrainment")
    own = {"nothing": 0.01, "unlisted": 0.01, "segment_drag": 0.01, "obstacle": 0.01, "entrainment": 0.96}
    assert decide(own, 0.001, True).names == ("entrainment",)  # in its own form it is another term


def test_probabilities_by_hand() -> None:
    odds = {"nothing": 0.5, "obstacle": 0.3, "unlisted": 0.2}
    found = probabilities({"obstacle": np.log(10.0), "unlisted": np.log(0.5)}, odds)
    assert found == pytest.approx({"nothing": 0.5 / 3.6, "obstacle": 3.0 / 3.6, "unlisted": 0.1 / 3.6})
    extreme = probabilities({"obstacle": 2000.0, "unlisted": -2000.0}, odds)
    assert extreme["obstacle"] == pytest.approx(1.0) and 0.0 <= extreme["unlisted"] < 1e-200
    assert sum(extreme.values()) == pytest.approx(1.0)


def test_p_value_of_besag_and_clifford() -> None:
    """Few above after all: (above + 1) / (n + 1); four above, stopped: above / n."""
    clean = np.arange(300.0)
    assert BootstrapTest(1000.0, clean).p_value == pytest.approx(1.0 / 301.0)
    assert BootstrapTest(298.0, clean).p_value == pytest.approx(3.0 / 301.0)
    assert BootstrapTest(297.0, clean).p_value == pytest.approx(4.0 / 301.0)  # three above
    assert BootstrapTest(296.0, clean).p_value == pytest.approx(4.0 / 300.0)
    assert BootstrapTest(0.0, np.zeros(4)).p_value == 1.0  # ties count as above
    assert BootstrapTest(5.0, np.zeros(9)).p_value == LIMIT  # by Markov's inequality, no more is said
    assert BootstrapTest(4.0, np.zeros(9)).p_value == 0.1
    assert BootstrapTest(5.0, np.append(np.zeros(8), 6.0)).p_value == 0.2  # the evidence is at fault


def test_odds_that_still_raise_an_alarm() -> None:
    """More than simulated ones have; those of 100 to 1 where few were simulated; and nothing below 0.1."""
    assert BootstrapTest(4.0, np.linspace(-2.0, 3.5, 99)).needed == pytest.approx(3.5)
    assert BootstrapTest(4.0, np.linspace(-2.0, 0.0, 99)).needed == pytest.approx(np.log(9.0))
    assert BootstrapTest(9.0, np.zeros(9)).needed == pytest.approx(np.log(100.0))


def test_limit_of_the_check() -> None:
    assert LIMIT == 0.01
    assert BootstrapTest(4.0, np.zeros(99)).fired and not BootstrapTest(4.0, np.zeros(98)).fired
    assert not BootstrapTest(9.0, np.append(np.zeros(98), [10.0])).fired
    assert BootstrapTest(9.0, np.append(np.zeros(298), [10.0, 10.0])).fired
    assert not BootstrapTest(9.0, np.append(np.zeros(297), [10.0] * 3)).fired
    bound, placed = BootstrapTest(9.0, np.zeros(9)), BootstrapTest(9.0, np.zeros(99))
    assert bound.fired and bound.is_bound and placed.fired and not placed.is_bound


def shares(nothing: float, unlisted: float, **named: float) -> dict[str, float]:
    found = {"nothing": nothing, "unlisted": unlisted, **named}
    assert sum(found.values()) == pytest.approx(1.0)
    return found


def test_silence() -> None:
    quiet = shares(0.7, 0.05, obstacle=0.2, sensor_bias=0.05)
    for can_tell, expected in ((True, "nothing_missing"), (False, "cannot_tell")):
        found = decide(quiet, p_value=0.3, can_tell=can_tell)
        assert (found.verdict, found.names) == (expected, ())


def test_short_of_an_alarm_nothing_is_not_claimed() -> None:
    """Odds of three to one are no alarm, however rare they are, and no reason to claim nothing."""
    loud = shares(0.25, 0.05, obstacle=0.65, sensor_bias=0.05)
    for p_value in (0.3, 0.005):
        assert decide(loud, p_value, can_tell=True) == Decision("cannot_tell", ())
    louder = shares(0.09, 0.05, obstacle=0.81, sensor_bias=0.05)
    assert decide(louder, p_value=0.3, can_tell=True) == Decision("cannot_tell", ())
    assert decide(louder, p_value=0.005, can_tell=True).names == ("obstacle",)
    even = shares(0.5, 0.0, obstacle=0.5)
    assert decide(even, p_value=0.3, can_tell=True).verdict == "nothing_missing"
    assert decide(even, p_value=0.01, can_tell=True) == Decision("cannot_tell", ())


def test_one_name() -> None:
    found = decide(shares(0.02, 0.02, obstacle=0.9, segment_drag=0.05, sensor_bias=0.01), 0.005, True)
    assert (found.verdict, found.names) == ("missing_physics", ("obstacle",))
    # What cannot be told in general may still show.
    assert decide(shares(0.02, 0.02, obstacle=0.96), 0.005, False).names == ("obstacle",)


def test_ties_by_the_share_of_the_group() -> None:
    """0.9 of the group, not of everything: 0.600 + 0.156 of 0.84 is exactly that."""
    found = decide(
        shares(0.05, 0.06, obstacle=0.156, segment_drag=0.6, segment_friction=0.084, sensor_bias=0.05),
        0.005,
        True,
    )
    assert (found.verdict, found.names) == ("missing_physics", ("segment_drag", "entrainment", "obstacle"))
    assert smallest_set({"a": 0.5, "b": 0.4, "c": 0.1}) == ("a", "b")
    assert smallest_set({"a": 0.449, "b": 0.449, "c": 0.102})[-1] == "c"
    assert smallest_set({"a": 0.2}) == ("a",)


def test_groups_before_names() -> None:
    """`unlisted` is the most probable single id, yet six mechanisms together are more probable."""
    many = dict.fromkeys(PHYSICS[:6], 0.1)
    found = decide(shares(0.05, 0.34, sensor_bias=0.01, **many), 0.005, True)
    assert found.verdict == "missing_physics" and set(found.names[:-1]) == set(many)
    assert found.names[-1] == "unlisted"


def test_unlisted_wins_over_single_mechanisms() -> None:
    few = dict.fromkeys(PHYSICS[:6], 0.05)
    found = decide(shares(0.05, 0.6, sensor_bias=0.05, **few), 0.005, True)
    assert (found.verdict, found.names) == ("unexplained", ())


def test_instruments() -> None:
    found = decide(shares(0.05, 0.05, obstacle=0.05, sensor_bias=0.8, release_offset=0.05), 0.005, True)
    assert (found.verdict, found.names, found.disputed) == ("instrument", ("sensor_bias",), False)
    found = decide(shares(0.05, 0.03, obstacle=0.04, sensor_bias=0.52, release_offset=0.36), 0.005, True)
    assert (found.verdict, found.names) == ("instrument", ("sensor_bias", "release_offset"))


def test_ties_across_groups() -> None:
    """The group decides the verdict; what is within two nats of its name (a factor of 7.4) is tied."""
    near = shares(0.05, 0.01, sensor_bias=0.5, segment_drag=0.3, obstacle=0.08, entrainment=0.06)
    found = decide(near, 0.005, True)
    assert (found.verdict, found.disputed) == ("instrument", True)
    assert found.names == ("sensor_bias", "segment_drag", "entrainment", "obstacle")
    # Less probable than the fault, yet with the others of its group more: first, and the fault is tied.
    many = shares(0.05, 0.01, sensor_bias=0.4, segment_drag=0.3, obstacle=0.2, entrainment=0.04)
    found = decide(many, 0.005, True)
    assert (found.verdict, found.names[0], found.names[-1]) == (
        "missing_physics",
        "segment_drag",
        "sensor_bias",
    )
    far = shares(0.05, 0.11, sensor_bias=0.09, obstacle=0.75)
    assert decide(far, 0.005, True) == Decision("missing_physics", ("obstacle", "unlisted"))
    assert not decide(far, 0.005, True).disputed  # both are physics
    fault = decide(shares(0.05, 0.35, sensor_bias=0.6), 0.005, True)
    assert fault.names == ("sensor_bias", "unlisted") and fault.disputed
    assert not decide(shares(0.2, 0.3, sensor_bias=0.5), 0.9, True).disputed


def test_no_instrument_in_the_comparison() -> None:
    assert decide(shares(0.05, 0.05, obstacle=0.9), 0.005, True).names == ("obstacle",)
    assert decide(shares(0.05, 0.2, obstacle=0.75), 0.005, True).names == ("obstacle", "unlisted")
    assert decide(shares(0.05, 0.95), 0.005, True).verdict == "unexplained"


def test_the_alarm_is_one_limit() -> None:
    """What one in a hundred clean campaigns has is an alarm, unless nothing is in a 90 % set."""
    sure = shares(0.01, 0.01, obstacle=0.98)
    assert decide(sure, p_value=0.011, can_tell=True).verdict == "cannot_tell"
    assert decide(sure, p_value=0.01, can_tell=True).names == ("obstacle",)
    assert decide(shares(0.11, 0.0, obstacle=0.89), 0.005, True).verdict == "cannot_tell"
    assert decide(shares(0.09, 0.0, obstacle=0.91), 0.005, True).names == ("obstacle",)


def test_stated_probabilities_by_hand() -> None:
    """Nothing keeps its own; odds of 4 between the others count half in nats, as 2, times their priors."""
    odds = {"nothing": 0.5, "obstacle": 0.3, "unlisted": 0.2}
    factors = {"obstacle": np.log(16.0), "unlisted": np.log(4.0)}
    found = stated(factors, odds, 0.5)
    assert found == pytest.approx(
        {"nothing": 0.5 / 6.1, "obstacle": 5.6 / 6.1 * 0.75, "unlisted": 5.6 / 6.1 * 0.25}
    )
    assert stated(factors, odds, 1.0) == pytest.approx(probabilities(factors, odds))
    assert stated({}, odds) == pytest.approx(odds)


def test_stated_probabilities_of_what_is_all_but_sure() -> None:
    odds = {"nothing": 0.5, "obstacle": 0.3, "unlisted": 0.2}
    for factors in ({"obstacle": 2000.0, "unlisted": -2000.0}, {"obstacle": -2000.0, "unlisted": -2000.0}):
        found = stated(factors, odds)
        assert sum(found.values()) == pytest.approx(1.0) and min(found.values()) >= 0.0


def test_the_power_is_the_one_that_trials_gave() -> None:
    result = Path(__file__).parents[2] / "studies" / "results" / "calibrate_odds.json"
    assert json.loads(result.read_text(encoding="utf-8"))["power"] == POWER


def test_a_force_in_no_list_is_tied_by_the_rule_that_names_are() -> None:
    """Listed ids at most 2 nats behind it; it stays the answer."""
    close = decide(shares(0.01, 0.79, segment_friction=0.15, sensor_bias=0.05), 0.005, True)
    assert close.verdict == "unexplained" and close.names == () and close.answer == "unlisted"
    assert close.tied == close.beside == ("segment_friction",)
    far = decide(shares(0.01, 0.89, segment_friction=0.1), 0.005, True)
    assert far.verdict == "unexplained" and far.tied == ()
