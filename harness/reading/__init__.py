"""Run folders from disk to checked arrays, and whether a run is whole and valid."""
