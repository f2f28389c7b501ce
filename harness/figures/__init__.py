"""Figures: one look, one module a subject; each function draws on the axes it is given."""
