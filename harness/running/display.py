"""Tell whoever watches how a launch goes: bars on a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TextIO

from tqdm import tqdm

from harness.running.run_state import State, read_progress
from harness.study import RUNS

LINE_EVERY_S = 30.0
BAR_EVERY_S = 0.5
BAR = "{percentage:3.0f}%|{bar:24}| {desc}"

# Its thread would be there when processes are started, for nothing: the bars are refreshed by hand
tqdm.monitor_interval = 0


def progress_words(progress: Mapping[str, Any]) -> str:
    """Say what a running run last told: strain, steps per second, time left, as far as it told.

    >>> progress_words({"axial_strain": 0.0123, "target_strain": 0.1, "steps_per_second": 2900.4, "seconds_left": 75})
    'strain 0.0123 of 0.1, 2900 steps/s, 1 min 15 s left'
    """
    words = []
    strain, target = progress.get("axial_strain"), progress.get("target_strain")
    if progress.get("stage") == "preparing":
        words.append("preparing")
    elif isinstance(strain, int | float):
        words.append(f"strain {strain:.4f}" + (f" of {target:g}" if isinstance(target, int | float) else ""))
    rate, left = progress.get("steps_per_second"), progress.get("seconds_left")
    if isinstance(rate, int | float):
        words.append(f"{rate:.0f} steps/s")
    if isinstance(left, int | float):
        words.append(f"{duration(left)} left")
    return ", ".join(words) or "running"


def duration(seconds: float) -> str:
    """Say a time in the two largest units it needs.

    >>> [duration(s) for s in (0.4, 75, 7260)]
    ['0 s', '1 min 15 s', '2 h 1 min']
    """
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"


def _ending(name: str, state: State, reason: str | None, seconds: float) -> str:
    return f"{name}: {state.value} after {duration(seconds)}" + (f": {reason}" if reason else "")


class Lines:
    """Plain lines, for a file or a pipe: one when a run starts, one now and then, one when it ends."""

    def __init__(self, directory: Path, stream: TextIO) -> None:
        """Write to `stream` about the runs of `directory`."""
        self._directory = directory
        self._stream = stream
        self._told: dict[str, float] = {}

    def _say(self, text: str) -> None:
        print(text, file=self._stream, flush=True)

    def begin(self, total: int, complete: int) -> None:
        """Say how much there is to do."""
        self._say(f"{total} runs, {complete} of them complete: {self._directory}")

    def watch(self, running: Mapping[str, float]) -> None:
        """Say what has started, and every half minute how far each is."""
        now = time.monotonic()
        for name, seconds in running.items():
            if name not in self._told:
                self._told[name] = now
                self._say(f"{name}: started")
            elif now - self._told[name] >= LINE_EVERY_S:
                self._told[name] = now
                progress = read_progress(self._directory / RUNS / name)
                self._say(f"{name}: {progress_words(progress) if progress else 'running for ' + duration(seconds)}")

    def ended(self, name: str, state: State, reason: str | None, seconds: float) -> None:
        """Say how it ended."""
        self._told.pop(name, None)
        self._say(_ending(name, state, reason, seconds))

    def close(self) -> None:
        """Nothing to put away."""


class Bars:
    """One bar for the study and one for every running run, on a terminal."""

    def __init__(self, directory: Path, stream: TextIO) -> None:
        """Draw on `stream` about the runs of `directory`."""
        self._directory = directory
        self._stream = stream
        self._all: tqdm[Any] | None = None
        self._bars: dict[str, tqdm[Any]] = {}
        self._last = 0.0

    def begin(self, total: int, complete: int) -> None:
        """Draw the study's bar."""
        self._all = tqdm(
            total=total, initial=complete, desc="runs", file=self._stream, bar_format="{desc} {n}/{total} [{elapsed}]"
        )

    def watch(self, running: Mapping[str, float]) -> None:
        """Draw a bar for every running run."""
        for name in self._bars.keys() - running.keys():
            self._bars.pop(name).close()
        now = time.monotonic()
        if now - self._last < BAR_EVERY_S:
            return
        self._last = now
        for name in running:
            bar = self._bars.get(name)
            if bar is None:
                bar = tqdm(total=1.0, desc=name, file=self._stream, leave=False, bar_format=BAR)
                self._bars[name] = bar
            progress = read_progress(self._directory / RUNS / name)
            if progress is not None:
                strain, target = progress.get("axial_strain"), progress.get("target_strain")
                if isinstance(strain, int | float) and isinstance(target, int | float) and target > 0:
                    bar.n = min(1.0, max(0.0, strain / target))
                bar.set_description_str(f"{name}: {progress_words(progress)}", refresh=False)
            bar.refresh()
        if self._all is not None:
            self._all.refresh()

    def ended(self, name: str, state: State, reason: str | None, seconds: float) -> None:
        """Take the run's bar away and leave a line."""
        bar = self._bars.pop(name, None)
        if bar is not None:
            bar.close()
        tqdm.write(_ending(name, state, reason, seconds), file=self._stream)
        if self._all is not None:
            self._all.update()

    def close(self) -> None:
        """Take all bars away."""
        for bar in (*self._bars.values(), self._all):
            if bar is not None:
                bar.close()
        self._bars.clear()


def display_for(directory: Path) -> Lines | Bars:
    """Return bars when standard error is a terminal, else lines; standard output stays free for results."""
    return Bars(directory, sys.stderr) if sys.stderr.isatty() else Lines(directory, sys.stderr)
