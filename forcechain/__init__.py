"""Confined buckling of force chains: the analytic model and its observation in particle tables.

`forcechain.theory` is the analytic model, `forcechain.observe` finds force chains and buckled segments in the arrays
of a simulation. Arrays in, frozen results out: nothing here reads a file, draws, or needs YADE.
"""

__version__ = "0.1.0"
