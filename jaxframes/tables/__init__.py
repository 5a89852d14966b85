"""Numbers over time under jit: Chebyshev records, orientation models, and how they are saved. Knows no kernel."""
