"""Raises."""

from skred.prove.task import main


def answer(campaign, base_model, settings):
    raise ArithmeticError(f"no answer for {campaign}")


main(answer)
