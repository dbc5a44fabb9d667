"""Threads, worker processes, and the cache of compiled functions."""
