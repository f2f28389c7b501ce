"""The analytic model of a laterally supported force chain that buckles.

`parameters`: the inputs. `three_particle`: states under monotonic loading, for arrays of parameters. `yielding`,
`classes`: critical loads, the order of yielding, the bound on overlaps. `energy`: the balance of energies.
`history`: any loading and unloading of one chain. `response`: what a prescribed displacement sees, with snapdowns.
`column`, `continuation`: N particles. `cluster`: the particles beside the chain. docs/equations.md maps the paper's
equations to functions and tests.
"""
