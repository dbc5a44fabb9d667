"""One tolerance for all that is compared: how well evidence is known, what decides nothing, what counts."""

STANDARD_ERROR = 0.1
"""Standard error of a log integral, in nats, at which there are enough draws; and the share of an integral
that no single place holds where there are enough places, nor a single draw where proposals miss no mode."""
DRAWS = 200
"""Draws of a turn in which an integral is sampled where a density takes no time, and populations that every
prediction is made of."""
DECIDES_NOTHING = 1.0
"""Nats that decide nothing between two answers: what is closer than that counts as equally good."""
COUNTS = 6.0
"""Nats behind the best within which something may count. What is farther behind has a ninetieth of the best's
probability as stated (`prior_odds.POWER`), or a four hundredth of an integral."""
MOST_ROUNDS = 6
"""Rounds at most of whatever is done again until it settles, which bounds the time: of a refit, of strengths
put around what was found, singly or on a grid, of sampling, of steps of a force, of ever smaller steps in
place."""
ARRIVED = 0.01
"""Nats gained by a step below which a climb has arrived."""
STEP_SHARES = (1.0, 0.35, 0.12, 0.04)
"""Shares of a step that are tried one after the other: a full step can stop fronts that went on."""
