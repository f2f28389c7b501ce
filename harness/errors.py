"""The errors a user may meet: one line each, with the exit status that belongs to it."""

from __future__ import annotations

import signal

EXIT_GOOD = 0
EXIT_VERDICT = 1  # a verdict failed
EXIT_INPUT = 2  # bad input or usage
EXIT_RUN = 3  # a run is invalid, failed or missing


class HarnessError(Exception):
    """An expected failure. The message is one line: where, what, expected, found, what to do."""

    exit_status = EXIT_INPUT


class InputError(HarnessError):
    """A file, table, study or argument that cannot be used as it is."""


class RunError(HarnessError):
    """A run that is invalid, failed or missing."""

    exit_status = EXIT_RUN


class Terminated(BaseException):
    """A signal other than Ctrl-C asks the harness to end; not an Exception, so that nothing on the way holds it up."""

    def __init__(self, number: int) -> None:
        """Keep the exit status that belongs to signal `number`."""
        super().__init__(signal.Signals(number).name)
        self.exit_status = 128 + number  # as shells have it
