"""What `forcechain model` reads from its command line and prints."""
