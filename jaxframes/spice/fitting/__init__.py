"""Tables fitted to what CSPICE computes, within a tolerance or a size."""
