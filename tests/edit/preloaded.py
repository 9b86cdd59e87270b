"""Import and track what the editors of the tests need, in the process that forks them."""

import sys

import asterism.cli.commands.edit
import asterism.cli.commands.track  # noqa: F401
from tests.edit.editors import track_for_commands

# The search for doctests imports every module.
if "pytest" not in sys.modules:
    track_for_commands()
