"""The command line `pteron`: each subcommand parses, calls the library and prints.

Nothing heavy is imported before a subcommand runs, so that help is there at once.
"""
