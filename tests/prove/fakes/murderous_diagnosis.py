"""Takes the life of the worker, for avalanches on a path that the law is asked about."""

import os
import signal
import time

from skred.prove.task import main


def answer(campaign, base_model, settings):
    if base_model == "murderous":
        os.kill(os.getppid(), signal.SIGKILL)
        time.sleep(60.0)
    return {"verdict": "nothing_missing"}


main(answer)
