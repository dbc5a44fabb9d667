"""Peers of skred's sampler and likelihood, one a file; see ``benchmarks.logp`` and ``sampling.py``."""
