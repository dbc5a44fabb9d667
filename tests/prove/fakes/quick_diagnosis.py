"""Answers at once, each time with another token."""

import uuid

from skred.prove.task import main


def answer(campaign, base_model, settings):
    files = sorted(file.name for file in campaign.iterdir())
    return {"verdict": "nothing_missing", "token": uuid.uuid4().hex, "files": files, "base_model": base_model}


main(answer)
