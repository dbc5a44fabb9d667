"""Where results of the studies are, and how they are read and written."""

from benchmarks.files import ROOT, read, shrink, write

__all__ = ["FIGURES", "RESULTS", "ROOT", "read", "shrink", "write"]

RESULTS = ROOT / "studies" / "results"
FIGURES = ROOT / "docs" / "figures"
