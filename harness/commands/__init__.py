"""The commands, one a module, each with HELP, EXAMPLE, add_arguments(parser) and execute(options)."""
