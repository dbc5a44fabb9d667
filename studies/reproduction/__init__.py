"""See the module's programs."""
