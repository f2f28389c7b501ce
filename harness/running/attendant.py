"""One task in a process of its own, for a worker: it ends, with all it started, as soon as the worker lets go of it.

Read by `python -m harness.running.attendant` from standard input: one line with the task, and then nothing. The end of
standard input says that the worker has gone, however that came, or wants the task to end; only that is asked of the
worker's machine, no signal and no thread. Standard output gets one line: how it ended.
"""

from __future__ import annotations

import json
import os
import select
import sys
from pathlib import Path
from typing import Any

from harness.errors import Terminated
from harness.running.engines import HeldError, Outcome, Task, ending_signals, locked, run_local

LOCK_PATIENCE_S = 60.0  # a worker that lost its scheduler may take that long to notice, and to end its run
FINISHED_ALREADY = "finished already"
_PATHS = ("folder", "log", "lock", "product")


class _LetGo(Exception):  # noqa: N818  no error: the worker's word
    """The worker has gone, or wants the task to end."""


def task_line(task: Task) -> str:
    """Write `task` as the line an attendant reads."""
    content = {name: str(getattr(task, name)) for name in _PATHS}
    more = {"command": list(task.command), "environment": dict(task.environment)}
    return json.dumps({**content, **more, "name": task.name, "time_limit_s": task.time_limit_s}) + "\n"


def task_in(line: str) -> Task:
    """Read a task from the line `task_line` wrote."""
    content: dict[str, Any] = json.loads(line)
    content.update({name: Path(content[name]) for name in _PATHS})
    return Task(**content)


def attend(task: Task, standard_input: int) -> Outcome:
    """Run `task` and return how it ended.

    Its product may be there already, made by an attempt whose worker was lost before it could say so: then nothing is
    run. An attempt that another process has not ended yet is waited for.
    """

    def watch(_: object = None) -> None:
        if select.select([standard_input], [], [], 0)[0]:  # nothing more is sent: it is the end
            raise _LetGo

    try:
        with locked(task.lock, LOCK_PATIENCE_S, watch):
            if task.product.exists():
                return Outcome(task=task, exit_status=0, seconds=0.0, stopped=FINISHED_ALREADY)
        (outcome,) = run_local([task], 1, watch)
    except HeldError:
        reason = f"could not be started: another process is still at work in {task.folder}"
        return Outcome(task=task, exit_status=None, seconds=0.0, stopped=reason)
    except _LetGo:
        return Outcome(task=task, exit_status=None, seconds=0.0, stopped="was ended with its worker, or on request")
    return outcome


def main() -> int:
    """Attend to the task on standard input."""
    line = b""
    while not line.endswith(b"\n"):  # unbuffered: what `select` is asked about must not lie in a buffer
        part = os.read(sys.stdin.fileno(), 65536)
        if not part:
            return 0
        line += part
    try:
        with ending_signals():
            outcome = attend(task_in(line.decode()), sys.stdin.fileno())
    except Terminated as end:
        return end.exit_status
    told = {"exit_status": outcome.exit_status, "seconds": outcome.seconds, "stopped": outcome.stopped}
    print(json.dumps({**told, "made": outcome.task.product.exists()}), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
