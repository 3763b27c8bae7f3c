"""The command ``flank``."""

import signal
import sys

from . import _flank


def main() -> None:
    """Run the command line and exit with its code."""
    # The command has its own signals, as without Python.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(_flank.main(sys.argv))
