"""Launching a study's runs, watching them, and knowing where each of them stands."""
