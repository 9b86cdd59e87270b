"""Import what the editors of the tests need, in the process that forks them."""

import asterism.cli.commands.edit
import asterism.cli.commands.track  # noqa: F401
from tests.edit import editors  # noqa: F401
