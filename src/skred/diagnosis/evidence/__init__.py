"""The evidence of what is added to a law: events and population integrated over."""
