"""Laws compared on one campaign: leave-one-out, WAIC, evidence, weights."""
