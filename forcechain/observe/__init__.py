"""Force chains, buckled segments and their averages, from the arrays of a simulation."""
