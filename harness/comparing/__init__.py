"""Model against data, data against the paper: rows, tolerances, fitted parameters."""
