"""Ring 3, work: what a person asks for."""
