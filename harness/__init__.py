"""Everything that touches the world: running YADE, reading exports, comparing, drawing, reporting."""
