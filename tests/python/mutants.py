"""Counts what became of the mutants of tests/mutants, module by module, and compares survivors with those that are argued.

usage: mutants.py RESULTS_FOLDER LIST.toml MODULE...
"""

import json
import re
import sys
import tomllib
from collections import Counter
from pathlib import Path

# The most mutants that may be argued to be equivalent, as a part of all: a longer list would be an excuse.
MOST_ARGUED = 0.03


def lines(path):
    return path.read_text().splitlines() if path.exists() else []


def without_place(mutant):
    """The text of a mutant without its line and column, which every change above it moves."""
    return re.sub(r"^([^:]+):\d+:\d+: ", r"\1: ", mutant)


def outcomes(folder):
    """The mutants of a module by what became of them; of what was tried twice the last try counts."""
    last = dict(reversed(line.split("\t")) for line in lines(folder / "outcomes"))
    found = {outcome: [] for outcome in ("caught", "timeout", "missed", "unviable")}
    for mutant, outcome in last.items():
        found[outcome].append(mutant)
    return found


def argued(path):
    """How often each mutant is argued to be equivalent; every entry says why."""
    entries = tomllib.loads(path.read_text())["equivalent"]
    for entry in entries:
        if not entry["reason"].strip():
            raise SystemExit(f"{path}: no reason: {entry['mutants']}")
    return Counter(mutant for entry in entries for mutant in entry["mutants"])


def main(results, path, *modules):
    results, listed = Path(results), argued(Path(path))
    every = len(lines(results / "all"))
    total, failures = Counter(), []
    columns = ("killed", "timed out", "argued", "survived", "not built", "excluded", "not run")
    print(" | ".join(("module", *columns)))
    for module in modules:
        there, chosen = lines(results / module / "all"), json.loads((results / module / "list.json").read_text())
        found = outcomes(results / module)
        survivors = Counter(map(without_place, found["missed"]))
        here = (f"core/src/{module}/", f"core/src/{module}.rs:")
        expected = Counter({text: number for text, number in listed.items() if text.startswith(here)})
        unknown = survivors - expected
        tested = sum(map(len, found.values()))
        counts = {
            "killed": len(found["caught"]),
            "timed out": len(found["timeout"]),
            "argued": (survivors & expected).total(),
            "survived": unknown.total(),
            "not built": len(found["unviable"]),
            "excluded": len(there) - len(chosen),
            "not run": len(chosen) - tested,
        }
        total.update(counts)
        print(" | ".join((module, *(str(counts[name]) for name in columns))))
        failures += [f"survived: {text} ({number})" for text, number in sorted(unknown.items())]
        # Of a part of the module nothing can be said but that they exist.
        needless = expected - (survivors if tested == len(chosen) else Counter(map(without_place, there)))
        failures += [f"argued, but no such mutant survives: {text} ({number})" for text, number in sorted(needless.items())]
    print(" | ".join(("all", *(str(total[name]) for name in columns))))
    print(f"of {every} mutants of all modules; {listed.total()} of them are argued, {MOST_ARGUED * every:.0f} may be")
    if listed.total() > MOST_ARGUED * every:
        failures.append(f"{listed.total()} mutants are argued, more than {MOST_ARGUED:.0%} of {every}")
    for failure in failures:
        print(failure, file=sys.stderr)
    return bool(failures)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
