"""Reading kernels: the process that holds them, their segments, names, clocks and coverage."""
