"""Bayesian calibration and comparison of avalanche block models against recordings."""

from skred.parallel.folders import let_pytensor_write

let_pytensor_write()  # before anything imports it
