"""`skred ARGUMENTS...` with another diagnosis: python prove_driver.py FAKE ARGUMENTS..."""

import functools
import sys

if __name__ == "__main__":
    import skred.prove.run
    from skred.cli import main

    skred.prove.run.Limits = functools.partial(skred.prove.run.Limits, module=sys.argv[1])
    main(sys.argv[2:])
