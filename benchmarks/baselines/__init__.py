"""Baselines for naming missing physics, one a file, on the campaigns that `skred diagnose` is given.

Each is a class with an ``id`` and a method ``answer``; see `common.Baseline` and ``run_baselines.py``.
"""

from __future__ import annotations

from importlib import import_module

from .common import Answer, Baseline

__all__ = ["BASELINES", "Answer", "Baseline", "baseline"]

BASELINES = {
    "integral_regression": "IntegralRegression",
    "sindy": "EnsembleSindy",
    "gaussian_process": "LargestResidual",
    "forward_bic": "ForwardBic",
    "posterior_predictive": "PosteriorPredictive",
    "always_nothing": "AlwaysNothing",
    "random_class": "RandomClass",
}
"""Modules of this folder, which are the ids, and the class in each."""


def baseline(name: str) -> Baseline:
    """One baseline; only its own module, and what that needs, is imported."""
    made: Baseline = getattr(import_module(f".{name}", __name__), BASELINES[name])()
    return made
