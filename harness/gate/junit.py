"""JUnit XML: the lines of a check as a continuous-integration server shows them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

from harness.gate.regression import Line, Outcome
from yade_scripts.run_folder import write

NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")  # what XML 1.0 cannot hold


def write_junit(path: Path, study: str, lines: Sequence[Line]) -> Path:
    """Write one test case a line to `path`, whole or not at all, and return it; what does not pass is a failure."""
    failures = sum(line.outcome is not Outcome.PASS for line in lines)
    suite = ElementTree.Element(
        "testsuite", name="forcechain check", tests=str(len(lines)), failures=str(failures), errors="0", skipped="0"
    )
    for line in lines:
        group = _clean(".".join(part for part in ("forcechain", study, line.case) if part))
        case = ElementTree.SubElement(suite, "testcase", classname=group, name=_clean(line.quantity))
        if line.outcome is not Outcome.PASS:
            failure = ElementTree.SubElement(case, "failure", type=line.outcome.value, message=_clean(line.why))
            failure.text = _clean(
                f"{line.quantity} [{line.unit}]: baseline {line.baseline}, found {line.found}, "
                f"tolerance {line.tolerance} ({line.tolerance_source}); {line.why}"
            )
    root = ElementTree.Element("testsuites")
    root.append(suite)
    ElementTree.indent(root)
    path.parent.mkdir(parents=True, exist_ok=True)
    write(path.parent, path.name, ElementTree.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n")
    return path


def _clean(text: str) -> str:
    return NOT_XML.sub("?", text)
