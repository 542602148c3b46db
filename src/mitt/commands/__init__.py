"""What the commands do, a module each with ``run(options) -> exit status``."""
