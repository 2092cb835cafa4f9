"""Compares instruction counts, summaries of gungraun as JSON on standard input, with golden ones; BLESS=1 writes them anew.

usage: instructions.py GOLDEN_FILE
"""

import json
import os
import sys

TOLERANCE = 0.03

# What all stages but the matching cost at most on pictures that are made to cost much, against those of a trail.
WORST = 1.3


def counts(text):
    """Instructions by benchmark, from JSON values one after the other."""
    decoder, found, place = json.JSONDecoder(), {}, 0
    while place < len(text):
        if text[place].isspace():
            place += 1
            continue
        summary, place = decoder.raw_decode(text, place)
        found[summary["function_name"]] = instructions(summary)
    return found


def instructions(value):
    """The first count named Ir, wherever it lies."""
    if isinstance(value, dict):
        if "Ir" in value:
            return number(value["Ir"])
        value = list(value.values())
    if isinstance(value, list):
        for inner in value:
            count = instructions(inner)
            if count is not None:
                return count
    return None


def number(value):
    """The newest number: gungraun writes it alone or beside that of an earlier run."""
    if isinstance(value, dict):
        return next((n for n in map(number, value.values()) if n is not None), None)
    if isinstance(value, list):
        return next((n for n in map(number, value) if n is not None), None)
    return value if isinstance(value, int) else None


def main():
    found = counts(sys.stdin.read())
    if not found or None in found.values():
        sys.exit(f"no counts: {found}")
    if os.environ.get("BLESS"):
        with open(sys.argv[1], "w") as file:
            file.writelines(f"{name} {count}\n" for name, count in found.items())
    with open(sys.argv[1]) as file:
        golden = {name: int(count) for name, count in map(str.split, file)}
    wrong = found.keys() != golden.keys()
    for name in sorted(found.keys() | golden.keys()):
        new, old = found.get(name), golden.get(name)
        change = new / old - 1 if new and old else float("nan")
        bad = not abs(change) <= TOLERANCE
        wrong |= bad
        print(f"   {name:10} {new} instructions, golden {old}, {100 * change:+.1f} %{'  WRONG' if bad else ''}")
    beside = {name: found.get(f"detect{name}", 0) - found.get(f"matching{name}", 0) for name in ("", "_noise", "_blocks")}
    for name in ("_noise", "_blocks"):
        ratio = beside[name] / max(beside[""], 1)
        bad = not 0 < ratio <= WORST
        wrong |= bad
        print(f"   all but the matching, {name[1:]:6} {ratio:.2f} of the trail's, limit {WORST}{'  WRONG' if bad else ''}")
    if wrong:
        sys.exit("BLESS=1 tests/instructions writes them anew: look at the difference, and commit it with what caused it")


main()
