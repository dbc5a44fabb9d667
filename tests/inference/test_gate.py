"""The gate on posteriors made to fail."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr

from skred.inference.gate import ESS_LIMIT, check_gate


def tree(draws: np.ndarray, diverging: int | None = None) -> xr.DataTree:
    """A posterior of one parameter, (chain, draw)."""
    coords = {"chain": np.arange(draws.shape[0]), "draw": np.arange(draws.shape[1])}
    groups = {"posterior": xr.Dataset({"mu": (("chain", "draw"), draws)}, coords=coords)}
    if diverging is not None:
        flags = np.zeros(draws.shape, dtype=bool)
        flags[0, :diverging] = True
        groups["sample_stats"] = xr.Dataset({"diverging": (("chain", "draw"), flags)}, coords=coords)
    return xr.DataTree.from_dict(groups)


def independent(n_draws: int = 1000) -> np.ndarray:
    return np.random.default_rng(0).standard_normal((4, n_draws))


def apart() -> np.ndarray:
    return independent() + 0.3 * np.arange(4)[:, None]


def at_two_modes() -> np.ndarray:
    """Each chain has settled; one is elsewhere, and narrower."""
    draws = independent()
    draws[3] = 9.0 + 0.2 * draws[3]
    return draws


def at_two_modes_and_drifting() -> np.ndarray:
    return at_two_modes() + np.linspace(0.0, 1.0, 1000)


def stuck() -> np.ndarray:
    return np.full((4, 1000), 0.3)


def with_nan() -> np.ndarray:
    draws = independent()
    draws[2, 17] = np.nan
    return draws


def rare_tail() -> np.ndarray:
    """Mixes well in its bulk, but goes to its tail once and stays there for long."""
    draws = independent()
    draws[:, 100:140] = 8.0 + 0.01 * independent(40)
    draws[:, 600:640] = -8.0 + 0.01 * independent(40)
    return draws


@pytest.mark.parametrize("diverging", [None, 0])
def test_independent_draws_pass(diverging: int | None) -> None:
    gate = check_gate(tree(independent(), diverging), ["mu"])
    assert gate.passed and gate.problems == () and gate.divergences == 0
    assert gate.r_hat_max < 1.01 and gate.ess_bulk_min > 3000 and gate.ess_tail_min > 3000


@pytest.mark.parametrize(
    ("draws", "diverging", "words"),
    [
        (apart(), None, ["r-hat", "--tune"]),
        (independent(60), None, ["bulk effective sample size", "--draws"]),
        (rare_tail(), None, ["tail effective sample size", "--draws"]),
        (independent(), 3, ["3 divergent transitions", "--sampler metropolis"]),
        (with_nan(), None, ["r-hat nan", "--tune"]),
        (stuck(), None, ["--tune"]),
        (at_two_modes(), None, ["separate modes", "skred calibrate --sampler smc"]),
        (at_two_modes_and_drifting(), None, ["--tune", "--draws"]),
    ],
)
def test_what_fails_says_what_to_do(draws: np.ndarray, diverging: int | None, words: list[str]) -> None:
    gate = check_gate(tree(draws, diverging), ["mu"])
    assert not gate.passed
    told = "; ".join(gate.problems)
    assert all(word in told for word in words), told


def test_only_what_fails_is_told() -> None:
    [problem] = check_gate(tree(independent(), 2), ["mu"]).problems
    assert "divergent" in problem
    gate = check_gate(tree(rare_tail()), ["mu"])
    assert gate.ess_tail_min < ESS_LIMIT
    # More draws do not join separate modes: nothing is said of how many there are.
    [problem] = check_gate(tree(at_two_modes()), ["mu"]).problems
    assert "draws" not in problem


def test_every_parameter_counts_and_no_other() -> None:
    good, bad = tree(independent()), tree(apart())
    both = good["posterior"].to_dataset().assign(other=bad["posterior"]["mu"])
    posterior = xr.DataTree.from_dict({"posterior": both})
    assert check_gate(posterior, ["mu"]).passed
    assert not check_gate(posterior, ["mu", "other"]).passed


def test_as_plain_data() -> None:
    plain = check_gate(tree(apart()), ["mu"]).as_dict()
    assert json.loads(json.dumps(plain)) == plain
    assert plain["passed"] is False and len(plain["problems"]) >= 1
