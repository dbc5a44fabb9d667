"""`skred ARGUMENTS...` with another diagnosis: python prove_driver.py FAKE ARGUMENTS..."""

import functools
import signal
import sys

if __name__ == "__main__":
    import skred.prove.run
    from skred.cli.main import main

    # As in a terminal, also where the tests run in the background, which ignores interruptions.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    skred.prove.run.Limits = functools.partial(skred.prove.run.Limits, module=sys.argv[1])
    main(sys.argv[2:])
