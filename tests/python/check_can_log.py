#!/usr/bin/env python3
"""Checks a bus log against the cells that it should carry, without any of Fencepost's own code.

    check_can_log.py CAN_LOG CELLS_CSV [--dbc FILE] [--base 0x400] [--node 0] [--ignore-others]

Every frame is decoded by cantools in strict mode with the DBC file and encoded again; checksums and counters are recomputed
here. The scans, in their order, must carry exactly the cells of the frames of CELLS_CSV in theirs; cells that an end message
declares as dropped may be missing, and exactly as many must be. Exit status: 0 if all agrees, 1 if not, 2 if a file cannot
be read.
"""

import argparse
import csv
import itertools
import pathlib
import re
import sys
from collections import Counter

import cantools

LINE = re.compile(r"\((\d+\.\d{6})\) (\S+) ([0-9A-Fa-f]{3})#(?:#([0-9A-Fa-f]))?((?:[0-9A-Fa-f]{2})*)(?: [RT])?\s*")
DBC = pathlib.Path(__file__).resolve().parents[2] / "core" / "fencepost.dbc"
DBC_ID = 0x400  # the file shows node 0 at this base
SCAN = ("Header", "Cells", "CellsFd", "Sectors", "Ground", "End")
SECTOR_PARTS = 5
MOST_DROPPED = 4095  # "that many or more"


class Mismatch(Exception):
    """Something does not agree; the text says what and where."""


def crc8(data, start, final):
    """CRC-8 SAE J1850, polynomial 0x1D, bit by bit."""
    crc = start
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ 0x1D) & 0xFF if crc & 0x80 else crc << 1
    return crc ^ final


def self_test():
    """The published values: AUTOSAR CRC routines, and E2E profile 11 with data id 0x123 in nibble mode."""
    assert crc8(b"123456789", 0xFF, 0xFF) == 0x4B
    assert crc8(bytes.fromhex("332255AABBCCDDEEFF"), 0xFF, 0xFF) == 0xCB
    assert crc8(bytes([0x23, 0x00, 0x10, 0, 0, 0, 0, 0, 0]), 0, 0) == 0x2A


def read_log(path):
    """Yields (line number, time, identifier, whether FD, data)."""
    with open(path, encoding="ascii") as file:
        for number, line in enumerate(file, 1):
            match = LINE.fullmatch(line)
            if not match:
                raise Mismatch(f"line {number}: not a line of a candump log: {line.rstrip()!r}")
            time, _, identifier, flags, data = match.groups()
            yield number, float(time), int(identifier, 16), flags is not None, bytes.fromhex(data)


class Decoder:
    """Decodes single frames and checks what can be checked about each by itself and its counter."""

    def __init__(self, database, first_id):
        self.database = database
        self.first_id = first_id
        self.counters = {}
        self.seen = Counter()

    def decode(self, identifier, is_fd, data):
        """Returns (name, values), or None if the frame belongs to somebody else."""
        if not self.first_id <= identifier < self.first_id + 16:
            return None
        try:
            message = self.database.get_message_by_frame_id(DBC_ID + identifier - self.first_id)
        except KeyError:
            raise Mismatch(f"identifier {identifier:03X} is in no message") from None
        if len(data) != message.length or is_fd != message.is_fd:
            raise Mismatch(f"{message.name}: {len(data)} bytes, FD {is_fd}; the DBC file says {message.length}, {message.is_fd}")
        values = message.decode(data, decode_choices=False)
        # Encoding in strict mode refuses values out of their range, and shows bits that no signal covers.
        again = message.encode(values, strict=True)
        if again != data:
            raise Mismatch(f"{message.name}: {data.hex()} is {again.hex()} when it is encoded again")
        crc = crc8(bytes([identifier & 0xFF, 0]) + data[1:], 0, 0)
        if values["Crc"] != crc:
            raise Mismatch(f"{message.name}: CRC {values['Crc']:02X}, computed {crc:02X}")
        if values["DataIdNibble"] != identifier >> 8:
            raise Mismatch(f"{message.name}: data id nibble {values['DataIdNibble']}")
        last = self.counters.get(identifier)
        if last is not None and values["Counter"] != (last + 1) % 15:
            raise Mismatch(f"{message.name}: counter {values['Counter']} after {last}")
        self.counters[identifier] = values["Counter"]
        self.seen[message.name] += 1
        return message.name, values


class Scans:
    """Puts scans together; `done` holds (scan index, cells, number of dropped cells, size of a cell in metres)."""

    def __init__(self):
        self.done = []
        self.header = None

    def add(self, name, values, data):
        if name == "Header":
            if self.header:
                raise Mismatch("a header before the end of the scan before")
            if self.done and values["ScanIndex"] != (self.done[-1][0] + 1) % 0x10000:
                raise Mismatch(f"scan {values['ScanIndex']} after scan {self.done[-1][0]}")
            self.header, self.cells, self.frames, self.parts, self.ground = values, [], [], [], False
            return
        if not self.header:
            raise Mismatch(f"{name} without a header")
        index = self.header["ScanIndex"]
        if name != "End" and values["ScanLow"] != index % 16:
            raise Mismatch(f"{name} of another scan in scan {index}")
        if name in ("Cells", "CellsFd"):
            self.add_cells(name, values, data)
        elif name == "Sectors":
            if values["Part"] != len(self.parts) or len(self.frames) != self.header["FrameCount"]:
                raise Mismatch(f"scan {index}: sectors part {values['Part']} out of order")
            self.parts.append(values["Part"])
        elif name == "Ground":
            if len(self.parts) != SECTOR_PARTS or self.ground:
                raise Mismatch(f"scan {index}: ground out of order")
            self.ground = True
        elif name == "End":
            self.end(values)

    def add_cells(self, name, values, data):
        if values["Sequence"] != len(self.frames) % 16:
            raise Mismatch(f"{name}: sequence {values['Sequence']} in frame {len(self.frames)}")
        self.frames.append(data[2:])
        for k in itertools.count():
            if f"Run{k}X" not in values:
                break
            x, y, length = (values[f"Run{k}{part}"] for part in ("X", "Y", "Length"))
            state = "obstacle" if values[f"Run{k}Obstacle"] else "free"
            self.cells += [(x, y + n, state) for n in range(length)]

    def end(self, values):
        header, index = self.header, self.header["ScanIndex"]
        if values["ScanIndex"] != index:
            raise Mismatch(f"the end of scan {values['ScanIndex']} in scan {index}")
        if not self.ground or len(self.frames) != header["FrameCount"] or len(self.cells) != header["CellCount"]:
            raise Mismatch(f"scan {index}: {len(self.frames)} frames and {len(self.cells)} cells, header {header}")
        crc = crc8(b"".join(self.frames), 0xFF, 0xFF)
        if values["ScanCrc"] != crc:
            raise Mismatch(f"scan {index}: scan CRC {values['ScanCrc']:02X}, computed {crc:02X}")
        self.check_order(index)
        self.done.append((index, self.cells, values["DroppedCells"], values["CellSize"]))
        self.header = None

    def check_order(self, index):
        states = [state for _, _, state in self.cells]
        if states != sorted(states, key=lambda state: state == "free"):
            raise Mismatch(f"scan {index}: an obstacle after a free cell")
        if len(set((x, y) for x, y, _ in self.cells)) != len(self.cells):
            raise Mismatch(f"scan {index}: a cell came twice")


def read_cells(path):
    """Returns a list of (frame, [(x in metres, y in metres, state)]) in the order of the file."""
    with open(path, encoding="utf-8", newline="") as file:
        rows = csv.DictReader(file)
        needed = {"frame", "x_m", "y_m", "state"}
        if not needed <= set(rows.fieldnames or ()):
            raise Mismatch(f"{path}: columns {rows.fieldnames}, needed {sorted(needed)}")
        groups = itertools.groupby(rows, key=lambda row: row["frame"])
        frames = [(frame, [(float(r["x_m"]), float(r["y_m"]), r["state"]) for r in group]) for frame, group in groups]
    if len(set(frame for frame, _ in frames)) != len(frames):
        raise Mismatch(f"{path}: the rows of a frame are not together")
    return frames


def to_index(metres, size, frame):
    """Index of the cell whose centre lies at `metres`."""
    index = round(metres / size - 0.5)
    if abs((index + 0.5) * size - metres) > 1e-3:
        raise Mismatch(f"frame {frame}: {metres} m is no centre of a cell of {size} m")
    return index


def compare(scans, frames):
    """Scans and frames in their order; frames without a known cell have no rows."""
    scans = [scan for scan in scans if scan[1] or scan[2]]
    if len(scans) != len(frames):
        raise Mismatch(f"{len(scans)} scans with cells, {len(frames)} frames with cells")
    total = missing_total = 0
    for (index, cells, dropped, size), (frame, rows) in zip(scans, frames):
        expected = Counter((to_index(x, size, frame), to_index(y, size, frame), state) for x, y, state in rows)
        sent = Counter(cells)
        extra, missing = sent - expected, expected - sent
        if extra:
            raise Mismatch(f"scan {index}, frame {frame}: {sum(extra.values())} cells more, as {list(extra)[:3]}")
        count = sum(missing.values())
        if count != dropped and not (dropped == MOST_DROPPED and count > dropped):
            raise Mismatch(f"scan {index}, frame {frame}: {count} cells missing, {dropped} declared, as {list(missing)[:3]}")
        total += len(cells)
        missing_total += count
    return total, missing_total


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("log", type=pathlib.Path)
    parser.add_argument("cells", type=pathlib.Path)
    parser.add_argument("--dbc", type=pathlib.Path, default=DBC)
    parser.add_argument("--base", type=lambda text: int(text, 0), default=DBC_ID)
    parser.add_argument("--node", type=int, default=0)
    parser.add_argument("--ignore-others", action="store_true", help="frames with other identifiers are no mistake")
    arguments = parser.parse_args()
    self_test()
    try:
        decoder = Decoder(cantools.database.load_file(arguments.dbc, strict=True), arguments.base | arguments.node << 4)
        scans = Scans()
        last_time = 0.0
        for number, time, identifier, is_fd, data in read_log(arguments.log):
            try:
                if time < last_time:
                    raise Mismatch(f"time {time} after {last_time}")
                last_time = time
                decoded = decoder.decode(identifier, is_fd, data)
                if decoded is None and not arguments.ignore_others:
                    raise Mismatch(f"identifier {identifier:03X} is not one of the node's")
                if decoded and decoded[0] in SCAN:
                    scans.add(*decoded, data)
            except (Mismatch, cantools.Error) as error:
                raise Mismatch(f"line {number}: {error}") from error
        if scans.header:
            raise Mismatch("the log ends within a scan")
        if not scans.done:
            raise Mismatch("no scan in the log")
        total, missing = compare(scans.done, read_cells(arguments.cells))
    except (Mismatch, cantools.Error) as error:
        print(f"{arguments.log}: {error}", file=sys.stderr)
        return 1
    except OSError as error:
        print(error, file=sys.stderr)
        return 2
    seen = ", ".join(f"{count} {name}" for name, count in sorted(decoder.seen.items()))
    dropped = f"; {missing} cells were declared as dropped" if missing else ""
    print(f"{arguments.log}: {len(scans.done)} scans with {total} cells agree with {arguments.cells}{dropped} ({seen})")
    return 0


if __name__ == "__main__":
    sys.exit(main())
