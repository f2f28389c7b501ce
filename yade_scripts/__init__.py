"""Scripts that run inside YADE's own Python (numpy only), and the export format they share with the harness."""
