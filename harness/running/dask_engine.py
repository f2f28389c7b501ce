"""Run the same tasks past one machine, on the workers of a Dask scheduler: one a slot, on a shared file system.

A worker's thread is a slot; each run is a process of its own there. What a task needs of its environment is sent
along, the rest is the worker's own. A lost worker's runs go to another; what the harness gives up, or leaves behind
when it dies, is ended on the workers.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import os
import subprocess
import sys
import time
from collections import deque
from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from uuid import uuid4

from distributed import Client, Future, KilledWorker, Security, get_worker
from distributed.comm.core import connect

from harness.errors import InputError, RunError
from harness.running.attendant import FINISHED_ALREADY, task_line
from harness.running.engines import PATIENCE_S, Engine, Outcome, Task, Watch
from harness.running.yade_environment import bare_environment

POLL_S = 0.2
CONNECT_TIMEOUT_S = 10.0
GATHER_TIMEOUT_S = 30.0
END_TIMEOUT_S = 10.0  # for the runs on the workers to end when the harness is interrupted
VISIBLE_TIMEOUT_S = 60.0  # until a network file system shows on this machine what was written on another
WANTED = frozenset({"executing", "long-running"})  # states of a task, in Dask's words, that somebody waits for


@contextlib.contextmanager
def connected(address: str | None) -> Iterator[Engine]:
    """Connect to a scheduler and yield the engine that runs tasks on its workers.

    `address` is as tcp://host:8786 or the path of a scheduler file; None: the one Dask's own configuration names.
    InputError when none is named, RunError when none answers.
    """
    import dask

    address = address or dask.config.get("scheduler-address", None)
    if not address:
        raise InputError(
            "--engine dask: no scheduler is named; start one (`dask scheduler`, and `dask worker ADDRESS` where the "
            "runs are to be) and add --scheduler ADDRESS"
        )
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)  # what matters of it is told by our own messages
    found = _address_in(Path(address)) if address.endswith(".json") else address
    try:
        asyncio.run(_knock(found))
        client = Client(found, timeout=CONNECT_TIMEOUT_S, set_as_default=False)
    except Exception as error:  # anything may stand at an address, and answer anything
        reason = " ".join(f"{error}".split())[:200] or type(error).__name__
        raise RunError(
            f"--scheduler {address}: no scheduler answers ({reason}); start `dask scheduler`, or correct the address"
        ) from None
    with client:
        slots = sum(worker["nthreads"] for worker in client.scheduler_info(n_workers=-1)["workers"].values())
        print(f"scheduler {address}: {slots} slots" + ("" if slots else ", waiting for workers"), file=sys.stderr)
        yield partial(run_on_workers, client)


def _address_in(scheduler_file: Path) -> str:
    try:
        return str(json.loads(scheduler_file.read_text(encoding="utf-8"))["address"])
    except FileNotFoundError:
        reason = "no such scheduler file"
    except (OSError, ValueError, KeyError, TypeError):
        reason = "not a scheduler file"
    raise RunError(f"--scheduler {scheduler_file}: {reason}; start `dask scheduler --scheduler-file {scheduler_file}`")


async def _knock(address: str) -> None:
    """Raise what comes of connecting to `address`: a `Client` that fails to says more than one line of it."""
    comm = await connect(address, timeout=CONNECT_TIMEOUT_S, **Security().get_connection_args("client"))
    await comm.close()


def run_on_workers(
    client: Client, tasks: Sequence[Task], jobs: int | None, watch: Watch
) -> Generator[Outcome, None, None]:
    """Run `tasks` on the workers of `client`'s scheduler, at most `jobs` at a time (None: one a slot).

    As `run_local` otherwise, but `watch` is called with those that a worker has begun. RunError when the scheduler is
    lost; its workers then end what they run.
    """
    waiting = deque(tasks)
    pending: dict[str, tuple[Task, Future[Any]]] = {}
    begun: dict[str, float] = {}
    topic = f"forcechain-{uuid4().hex}"

    def note(event: tuple[float, Mapping[str, str]]) -> None:
        told = event[1]
        if told["event"] == "begun":
            begun[told["name"]] = time.monotonic()
        else:
            begun.pop(told["name"], None)

    client.subscribe_topic(topic, note)
    try:
        while waiting or pending:
            while waiting and (jobs is None or len(pending) < jobs):
                task = waiting.popleft()
                # The harness's own environment stays here: it may hold secrets, and the wire need not be private
                changed = task.environment.items() - bare_environment().items()
                sent = replace(task, environment=dict(changed))
                # A key of its own: what an earlier launch left with the scheduler is not taken for this one's
                key = f"{task.name}-{uuid4().hex}"
                pending[task.name] = task, client.submit(attend_on_worker, sent, topic, key=key, pure=False)
            ended = []
            for name, (task, future) in pending.items():
                if future.status in ("cancelled", "lost"):
                    raise RunError(
                        "the scheduler is lost, and with it the runs under way; start one and run this again"
                    )
                if future.done():
                    with contextlib.suppress(TimeoutError):  # its worker is lost, just now: another does it over
                        ended.append((name, _outcome(task, future)))
            for name, outcome in ended:
                del pending[name]
                begun.pop(name, None)
                yield outcome
            now = time.monotonic()
            running = {name: now - since for name, since in list(begun.items()) if name in pending}
            watch(running)
            if pending and not ended:
                time.sleep(POLL_S)
    finally:
        _end(client, [future for _, future in pending.values()], begun)
        with contextlib.suppress(OSError, ValueError):
            client.unsubscribe_topic(topic)


def attend_on_worker(task: Task, topic: str) -> dict[str, Any]:
    """Run `task` here, on a worker, in a process of its own; return how it ended.

    A thread cannot be ended from without, and threads and `fork` do not go together: the process does the work, and
    goes on only as long as this one holds on to its standard input.
    """
    worker = get_worker()
    key = worker.get_current_task()
    environment = bare_environment() | dict(task.environment)
    attendant = subprocess.Popen(
        [sys.executable, "-m", "harness.running.attendant"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    if attendant.stdin is None or attendant.stdout is None:
        raise RuntimeError("no pipes to the attendant, though they were asked for")
    worker.log_event(topic, {"event": "begun", "name": task.name})
    try:
        attendant.stdin.write(task_line(replace(task, environment=environment)))
        attendant.stdin.flush()
        while attendant.poll() is None:
            state = worker.state.tasks.get(key)
            if state is None or state.state not in WANTED:  # given up: by Ctrl-C, or because the harness has gone
                break
            time.sleep(POLL_S)
    finally:
        with contextlib.suppress(BrokenPipeError):
            attendant.stdin.close()
        told = attendant.stdout.read()
        attendant.stdout.close()
        attendant.wait()
        worker.log_event(topic, {"event": "ended", "name": task.name})
    if not told.strip():
        reason = f"its attendant ended with exit status {attendant.returncode}"
        return {"exit_status": None, "seconds": 0.0, "stopped": reason, "made": False}
    content: dict[str, Any] = json.loads(told)
    return content


def _outcome(task: Task, future: Future[Any]) -> Outcome:
    try:
        told = future.result(timeout=GATHER_TIMEOUT_S)
    except TimeoutError:
        raise
    except KilledWorker as error:
        last = getattr(error, "last_worker", None)
        where = f", the last one at {last.address}" if last is not None else ""
        reason = f"lost its worker again and again{where}"
        return Outcome(task=task, exit_status=None, seconds=0.0, stopped=reason)
    except Exception as error:  # whatever a worker raised comes here as it was raised there
        reason = " ".join(f"could not be started on its worker: {type(error).__name__}: {error}".split())
        return Outcome(task=task, exit_status=None, seconds=0.0, stopped=reason)
    if told["made"]:
        _wait_until_visible(task.product)
    stopped = None if told["stopped"] == FINISHED_ALREADY else told["stopped"]
    return Outcome(task=task, exit_status=told["exit_status"], seconds=told["seconds"], stopped=stopped)


def _wait_until_visible(path: Path) -> None:
    """Wait until `path` is there: a network file system remembers for a while that it was not."""
    until = time.monotonic() + VISIBLE_TIMEOUT_S
    while not path.exists() and time.monotonic() < until:
        os.listdir(path.parent)  # noqa: PTH208  reading the folder makes the machine ask the server anew
        time.sleep(POLL_S)


def _end(client: Client, futures: Sequence[Future[Any]], begun: Mapping[str, float]) -> None:
    """Give up `futures`, and wait until the workers have told that what they had begun has ended."""
    if not futures or client.status != "running":
        return
    with contextlib.suppress(OSError, TimeoutError):
        client.cancel(list(futures), force=True)
    until = time.monotonic() + max(END_TIMEOUT_S, 2 * PATIENCE_S)
    while begun and time.monotonic() < until:
        time.sleep(POLL_S)
