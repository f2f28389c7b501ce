"""Bars on a terminal, and only there."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest

from harness.progress import SHOWN_AFTER_S, watched


def slowly() -> Iterator[int]:
    for item in range(3):
        time.sleep(0.6 * SHOWN_AFTER_S)
        yield item


@pytest.mark.parametrize("terminal", [True, False])
def test_a_terminal_sees_how_far_it_is(
    terminal: bool, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stderr.isatty", lambda: terminal, raising=False)
    assert list(watched(slowly(), "runs analysed", 3)) == [0, 1, 2]
    told = capsys.readouterr()
    assert told.out == ""
    assert ("runs analysed: 2/3 [" in told.err) == terminal
    assert (" left]" in told.err) == terminal


def test_what_is_quick_shows_nothing(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    assert list(watched([1, 2], "runs analysed", 2)) == [1, 2]
    assert "runs analysed" not in capsys.readouterr().err
