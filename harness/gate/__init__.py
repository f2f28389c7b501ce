"""The regression gate: approved numbers, and a study held against them."""
