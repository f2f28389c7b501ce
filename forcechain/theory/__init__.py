"""The analytic model of a laterally supported force chain that buckles."""
