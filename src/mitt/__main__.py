"""Run the command line: ``python -m mitt``."""

from mitt.cli.main import main

if __name__ == "__main__":
    raise SystemExit(main())
