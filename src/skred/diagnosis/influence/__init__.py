"""What an answer hangs on: the comparison again without each avalanche and each kind of reading."""
