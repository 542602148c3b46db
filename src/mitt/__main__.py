"""Run the command line: ``python -m mitt``.

Python puts the working folder first in its path then. Like the command ``mitt``, what is run here
looks for nothing in it, unless mitt itself is there.
"""

import os
import sys

_HOME = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
if not sys.flags.safe_path and sys.path[:1] == [os.getcwd()] != [_HOME]:
    del sys.path[0]

from mitt.cli.main import main  # noqa: E402 (only now)

if __name__ == "__main__":
    raise SystemExit(main())
