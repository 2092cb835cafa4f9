#!/usr/bin/env python3
"""Checks the checker: a log with a planted mistake of each kind must not pass `check_can_log.py`.

    test_check_can_log.py CAN_LOG CELLS_CSV

The two files must agree and hold classic frames. Exit status: 0 if every mistake is caught, 1 if not.
"""

import contextlib
import io
import pathlib
import sys
import tempfile
from unittest import mock

import check_can_log


def frame(line):
    """Returns what stands before the data, and the data."""
    head, data = line.rstrip("\n").split("#")
    return head, bytearray.fromhex(data)


def protected(head, data):
    """The line with a checksum that fits."""
    data[0] = check_can_log.crc8(bytes([int(head[-3:], 16) & 0xFF, 0]) + bytes(data[1:]), 0, 0)
    return f"{head}#{data.hex().upper()}\n"


def changed(line, byte, bits, protect=True):
    """The line with some bits turned over."""
    head, data = frame(line)
    data[byte] ^= bits
    return protected(head, data) if protect else f"{head}#{data.hex().upper()}\n"


def mistakes(log, cells):
    """Yields (what is wrong, lines of the log, lines of the cells)."""
    at = {name: next(k for k, line in enumerate(log) if f" {name:03X}#" in line) for name in range(0x400, 0x407) if name != 0x403}
    middle = [k for k, line in enumerate(log) if " 402#" in line][3]

    def replaced(k, line):
        return log[:k] + [line] + log[k + 1 :]

    yield "a bit turned over", replaced(middle, changed(log[middle], 5, 0x10, protect=False)), cells
    yield "another state, rightly protected", replaced(middle, changed(log[middle], 5, 0x08)), cells
    yield "a cell moved, rightly protected", replaced(middle, changed(log[middle], 4, 0x01)), cells
    yield "a sector part that does not exist", replaced(at[0x404], changed(log[at[0x404]], 2, 0x80)), cells
    yield "a bit that no signal covers", replaced(at[0x400], changed(log[at[0x400]], 5, 0x40)), cells
    yield "another cell count", replaced(at[0x401], changed(log[at[0x401]], 4, 0x01)), cells
    yield "another scan checksum", replaced(at[0x406], changed(log[at[0x406]], 7, 0x01)), cells
    yield "another data id", replaced(at[0x405], changed(log[at[0x405]], 1, 0x10)), cells
    for name, k in at.items():
        if name != 0x400:
            yield f"{name:03X} lost", log[:k] + log[k + 1 :], cells
        yield f"{name:03X} twice", log[: k + 1] + log[k:], cells
        yield f"{name:03X} too short", replaced(k, log[k][:-3] + "\n"), cells
    yield "two frames exchanged", log[:middle] + [log[middle + 1], log[middle]] + log[middle + 2 :], cells
    yield "a frame of somebody else", log + ["(9999999999.000000) can0 123#00\n"], cells
    yield "not a log", ["hello\n"] + log, cells
    yield "an empty log", [], cells
    yield "a log that ends early", log[: at[0x405]], cells
    yield "a cell missing in the table", log, cells[:5] + cells[6:]
    yield "a cell more in the table", log, cells[:2] + [cells[1].replace(cells[1].split(",")[2], "-1.375")] + cells[2:]
    other = cells[1].replace("free", "FREE").replace("obstacle", "free").replace("FREE", "obstacle")
    yield "another state in the table", log, cells[:1] + [other] + cells[2:]
    yield "a place that is no centre of a cell", log, cells[:1] + [cells[1].replace(cells[1].split(",")[2], "0.2")] + cells[2:]
    last = cells[-1].split(",")[0]
    yield "a frame missing in the table", log, [line for line in cells if not line.startswith(f"{last},")]
    yield "a table without states", log, [line.replace("state", "condition") for line in cells[:1]] + cells[1:]


def run(folder, log, cells):
    """Exit status of the checker."""
    for name, lines in (("can.log", log), ("cells.csv", cells)):
        (folder / name).write_text("".join(lines))
    argv = ["check_can_log.py", str(folder / "can.log"), str(folder / "cells.csv")]
    with mock.patch.object(sys, "argv", argv), contextlib.redirect_stdout(io.StringIO()):
        with contextlib.redirect_stderr(io.StringIO()) as said:
            return check_can_log.main(), said.getvalue().strip()


def main():
    log, cells = (pathlib.Path(path).read_text().splitlines(keepends=True) for path in sys.argv[1:3])
    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        status, said = run(pathlib.Path(folder), log, cells)
        if status != 0:
            print(f"the files do not agree to begin with: {said}", file=sys.stderr)
            return 1
        count = 0
        for what, bad_log, bad_cells in mistakes(log, cells):
            count += 1
            status, said = run(pathlib.Path(folder), bad_log, bad_cells)
            if status != 1 or not said:
                failed += 1
                print(f"not caught: {what} (status {status})", file=sys.stderr)
    print(f"{count - failed} of {count} planted mistakes were caught")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
