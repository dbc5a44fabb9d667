"""The hierarchical likelihood: every avalanche its own parameters, integrated over."""
