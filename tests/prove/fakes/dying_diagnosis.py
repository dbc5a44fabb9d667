"""Takes its own life."""

import os
import signal

from skred.prove.task import main


def answer(campaign, base_model, settings):
    print("last words", flush=True)
    os.kill(os.getpid(), signal.SIGKILL)


main(answer)
