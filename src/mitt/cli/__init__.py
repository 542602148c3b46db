"""The command line: options, help, and what the commands do."""
