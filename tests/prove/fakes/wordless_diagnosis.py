"""Answers with something that is no verdict."""

from skred.prove.task import main

main(lambda campaign, base_model, settings: {"verdict": 7})
