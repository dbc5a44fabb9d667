"""The kernel: fronts down a track, read where the sensors are, in compiled code."""
