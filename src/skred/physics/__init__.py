"""Ring 1, physics: terrain, mechanisms and the kernel (numpy, numba; scipy for the smoothing)."""
