"""Step 3: the candidates compared by evidence, where they act, and what follows from it."""
