"""Run commands side by side on this machine: started, watched, and ended with everything they started."""

from __future__ import annotations

import contextlib
import ctypes
import fcntl
import os
import signal
import subprocess
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

from harness.errors import Terminated

POLL_S = 0.1
PATIENCE_S = 1.0  # from asking a process to end until it is killed
PR_SET_PDEATHSIG = 1  # linux/prctl.h
OWNER_ONLY = 0o600  # a log can hold the cookie of YADE's Python prompt


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """One command to run.

    Attributes:
        name: what it is called in messages.
        command: program and arguments.
        environment: its environment, complete.
        folder: its working directory.
        log: file that takes its output.
        lock: file that is locked as long as one of its processes lives, so that no two of them write the same files.
        product: the file that is there once it has ended as it should.
        time_limit_s: it is ended after this time [s]; None: no limit.
    """

    name: str
    command: Sequence[str]
    environment: Mapping[str, str]
    folder: Path
    log: Path
    lock: Path
    product: Path
    time_limit_s: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """How a task ended: what the operating system tells, which says nothing about its products.

    Attributes:
        task: the task.
        exit_status: as `subprocess` has it, negative for a signal; None when it could not be started.
        seconds: how long it ran.
        stopped: why the harness ended it, or why it could not be started; None when it ended by itself.
    """

    task: Task
    exit_status: int | None
    seconds: float
    stopped: str | None = None

    def __str__(self) -> str:
        """Say it in one phrase."""
        if self.stopped:
            return self.stopped
        if self.exit_status is not None and self.exit_status < 0:
            with contextlib.suppress(ValueError):
                return f"was ended by signal {signal.Signals(-self.exit_status).name}"
        return f"ended with exit status {self.exit_status}"


class HeldError(OSError):
    """A lock is held by another process."""


Watch = Callable[[Mapping[str, float]], None]
Engine = Callable[[Sequence[Task], int | None, Watch], Generator[Outcome, None, None]]


def run_local(tasks: Sequence[Task], jobs: int | None, watch: Watch) -> Generator[Outcome, None, None]:
    """Run `tasks`, at most `jobs` at a time (None: one a core), in their order; yield each outcome as it comes.

    `watch` is called some times a second with the names of the running tasks and their running times [s]. However this
    ends (to the last task, by Ctrl-C, by a signal, or closed early), no process it started is left running; should the
    harness itself be killed, the kernel ends them.
    """
    waiting = deque(tasks)
    jobs = jobs or available_cores()
    running: dict[int, tuple[Task, subprocess.Popen[bytes], float]] = {}
    try:
        while waiting or running:
            while waiting and len(running) < jobs:
                task = waiting.popleft()
                try:
                    process = _start(task)
                except OSError as error:
                    reason = (
                        f"another process is still at work in {task.folder}" if isinstance(error, HeldError) else error
                    )
                    yield Outcome(task=task, exit_status=None, seconds=0.0, stopped=f"could not be started: {reason}")
                    continue
                running[process.pid] = (task, process, time.monotonic())
            ended = []
            for pid, (task, process, began) in running.items():
                seconds = time.monotonic() - began
                status = process.poll()
                stopped = None
                if status is None and task.time_limit_s is not None and seconds > task.time_limit_s:
                    stopped = f"was stopped at its time limit of {task.time_limit_s:g} s"
                    status = _end([process])
                if status is not None:
                    _end([process])  # what it may have started itself
                    ended.append((pid, Outcome(task=task, exit_status=status, seconds=seconds, stopped=stopped)))
            for pid, outcome in ended:
                del running[pid]
                yield outcome
            if running:
                watch({task.name: time.monotonic() - began for task, _, began in running.values()})
                if not ended:
                    time.sleep(POLL_S)
    finally:
        _end([process for _, process, _ in running.values()])


def available_cores() -> int:
    """Cores this process may use, which on a shared node can be fewer than the machine has."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextlib.contextmanager
def locked(path: Path, patience_s: float = 0.0, watch: Callable[[], None] = lambda: None) -> Iterator[int]:
    """Hold the lock `path`, a file; wait at most `patience_s` for it, calling `watch`. HeldError when it is held.

    Yields its descriptor. The lock is the kernel's and belongs to every process that inherits the descriptor: it is
    free again when the last of them has ended, however that came.
    """
    path.parent.mkdir(exist_ok=True)
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT, OWNER_ONLY)
    until = time.monotonic() + patience_s
    try:
        while True:
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if time.monotonic() >= until:
                    raise HeldError(f"{path} is held by another process") from None
                watch()
                time.sleep(POLL_S)
        yield descriptor
    finally:
        os.close(descriptor)


@contextlib.contextmanager
def ending_signals() -> Iterator[None]:
    """Let SIGTERM and SIGHUP end the harness as Ctrl-C does: through its clean-up. Ignored ones stay ignored."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def end(number: int, _: FrameType | None) -> None:
        raise Terminated(number)

    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)}
    for number, handler in before.items():
        if handler != signal.SIG_IGN:
            signal.signal(number, end)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _start(task: Task) -> subprocess.Popen[bytes]:
    with locked(task.lock) as lock:
        return _start_locked(task, lock)


def _start_locked(task: Task, lock: int) -> subprocess.Popen[bytes]:
    task.log.unlink(missing_ok=True)  # so that its mode is ours, whoever made the old one
    log = os.open(task.log, os.O_WRONLY | os.O_CREAT | os.O_EXCL, OWNER_ONLY)
    libc = ctypes.CDLL(None)
    parent = os.getpid()

    def die_with_parent() -> None:
        libc.prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:  # it died before the line above
            os._exit(1)

    try:
        return subprocess.Popen(
            task.command,
            cwd=task.folder,
            env=dict(task.environment),
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=subprocess.STDOUT,
            start_new_session=True,  # a group of its own: ended as a whole, and not by the terminal's Ctrl-C
            preexec_fn=die_with_parent,
            pass_fds=(lock,),  # it holds the lock now, and on its own should the harness die
        )
    finally:
        os.close(log)


def _end(processes: Sequence[subprocess.Popen[bytes]]) -> int | None:
    """End processes and their groups: ask, wait a little, kill. Return the exit status of the last."""
    for process in processes:
        _signal_group(process, signal.SIGTERM)
    until = time.monotonic() + PATIENCE_S
    for process in processes:
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(max(0.0, until - time.monotonic()))
    for process in processes:
        _signal_group(process, signal.SIGKILL)
        process.wait()
    return processes[-1].returncode if processes else None


def _signal_group(process: subprocess.Popen[bytes], number: int) -> None:
    # The group outlives its leader while a member is left; its number is not given anew until then.
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, number)
