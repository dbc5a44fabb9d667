"""Never answers."""

import time

from skred.prove.task import main


def answer(campaign, base_model, settings):
    while True:
        time.sleep(1.0)


main(answer)
