"""Pages of what was measured: `python -m benchmarks.page` and `python -m benchmarks.page.development`."""
