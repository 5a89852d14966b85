"""Tables made of the records that kernels hold, exactly."""
