"""The console script `sastrugi`: the program itself, in this process."""

from __future__ import annotations

import sys

from . import _native


def main() -> int:
    """Runs the command line and returns its exit code. On Ctrl-C the process ends with 75, as the program does."""
    return _native.main(["sastrugi", *sys.argv[1:]])
