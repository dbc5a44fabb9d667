"""What the choices that make a comparison affordable cost: each against doing without it."""
