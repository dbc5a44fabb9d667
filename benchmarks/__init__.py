"""What is measured again: each file a program, `python -m benchmarks.NAME`."""
