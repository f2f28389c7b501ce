"""From the runs of a study to buckling data, kept with what they were made from."""
