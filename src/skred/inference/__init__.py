"""Ring 2, inference: the Op around the kernel, likelihoods, sampling, comparison."""
