"""The command line as ``python -m skred.cli``."""

from skred.cli.main import main

main()
