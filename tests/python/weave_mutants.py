"""Runs the mutants of a module that can be woven into one program (tests/weave), each in a run of its own of the module's tests.

usage: weave_mutants.py WEAVER TREE RESULTS_FOLDER "MODULE [HOLDER...]" [all]

A mutant is tried with the tests of its module, given with other modules whose tests hold it, first the quick ones; with `all`, those
that are still alive also with the tests of the modules that name it.

RESULTS_FOLDER has the mutants in `list.json`. To its `outcomes` a line is added for each mutant that was run, and mutants that are there
are not run again, unless they lived: there may be new tests. `left` has those that a build of their own must judge, `slow` the tests
that are not quick.
"""

import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

# A test that takes longer is left to what the quick ones let live.
QUICK_S = 0.1

# Errors that a mutant has wherever it stands: a type, a trait or a function that is not there.
REFUSED = ("E0277", "E0369", "E0433", "E0599")

# What no new test changes.
JUDGED = ("caught", "timeout", "unviable")


def build(tree, targets):
    """Builds the woven tests: their programs, or the compiler's errors."""
    command = ["cargo", "test", "--locked", "--package", "fencepost-core", *targets, "--no-run"]
    done = subprocess.run([*command, "--message-format=json"], cwd=tree, capture_output=True, text=True)
    messages = [json.loads(line) for line in done.stdout.splitlines()]
    programs = {m["target"]["name"]: m["executable"] for m in messages if m.get("executable")}
    errors = [m["message"] for m in messages if m["reason"] == "compiler-message" and m["message"]["level"] == "error"]
    if not errors and done.returncode:
        raise SystemExit(done.stderr)
    return programs, errors


def weave(program, listed, tree, folder, sources, targets):
    """Weaves in what the compiler takes: the programs, the numbers that are in them, and those that cannot be built anywhere."""
    left_out, impossible = set(), set()
    arms = {number for number, mutant in enumerate(json.loads(listed.read_text()), 1) if mutant["genre"] == "MatchArm"}
    while True:
        for path, text in sources.items():
            (tree / path).write_text(text)
        (folder / "left_out").write_text("\n".join(map(str, sorted(left_out))))
        out = subprocess.run([program, listed, tree, folder / "left_out"], stdout=subprocess.PIPE, text=True, check=True).stdout
        places = [line.split() for line in out.splitlines()]
        programs, errors = build(tree, targets)
        if not errors:
            return programs, {int(number): constant == "true" for number, _, _, _, constant in places}, impossible
        refused = set()
        for error in errors:
            spans = [span for span in error["spans"] if span["is_primary"]] + error["spans"]
            hits = [
                [int(number) for number, file, start, end, _ in places
                 if file == span["file_name"] and int(start) < span["byte_end"] and span["byte_start"] < int(end)]
                for span in spans
            ]  # fmt: skip
            hit = next(filter(None, hits), [])
            if not hit and spans:
                # A match of which arms are behind conditions now and no longer cover everything: those behind the word that is told.
                last = max([span["byte_end"] for child in error["children"] for span in child["spans"]], default=0)
                hit = [int(number) for number, file, start, _, _ in places
                       if file == spans[0]["file_name"] and spans[0]["byte_end"] <= int(start) < last and int(number) in arms]  # fmt: skip
            refused.update(hit)
            if (error["code"] or {}).get("code") in REFUSED:
                impossible.update(hit)
        if not refused:
            raise SystemExit("\n".join(error["rendered"] for error in errors))
        left_out |= refused


class Runs:
    """Runs of the tests."""

    def __init__(self, programs, tree):
        self.programs, self.directory = programs, tree / "core"

    def times(self, named):
        """How long each test takes without a mutant that has one of `named` in its name, each of all if there is none; none may fail."""
        found = {}
        for name, program in self.programs.items():
            out = self.run(program, ["--report-time", "--test-threads=1", *named], None, 1800)
            if out.returncode:
                raise SystemExit(out.stdout)
            for test, seconds in re.findall(r"^test (.*?)(?: - should panic)? \.\.\. .*ok <([0-9.]+)s>$", out.stdout, re.M):
                found[name, test] = float(seconds)
        return found

    def run(self, program, arguments, mutant, timeout_s):
        environment = os.environ | ({"MUTANT": str(mutant)} if mutant else {})
        command = [program, "-Zunstable-options", "--fail-fast", *arguments]
        return subprocess.run(
            command, cwd=self.directory, env=environment, timeout=timeout_s, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            errors="replace",
        )  # fmt: skip

    def outcome(self, tests, mutant):
        """What becomes of a mutant in some of the tests, given with their times."""
        for name, program in self.programs.items():
            chosen = [test for program_name, test in tests if program_name == name]
            if not chosen:
                continue
            timeout_s = 10 + 6 * sum(seconds for (program_name, _), seconds in tests.items() if program_name == name)
            try:
                if self.run(program, ["--exact", *chosen], mutant, timeout_s).returncode:
                    return "caught"
            except subprocess.TimeoutExpired:
                return "timeout"
        return "missed"


def naming(tree, module):
    """The modules of the core that name one."""
    source = tree / "core/src"
    return {path.relative_to(source).parts[0].removesuffix(".rs") for path in source.rglob("*.rs")
            if re.search(rf"\b{module}::", path.read_text())}  # fmt: skip


def main(weaver, tree, folder, held, thorough=""):
    tree, folder, holders = Path(tree), Path(folder), held.split()
    module, tests_of = holders[0], [f"{holder}::" for holder in holders]
    listed = folder / "list.json"
    mutants = json.loads(listed.read_text())
    sources = {path: (tree / path).read_text() for path in {"core/src/lib.rs"} | {mutant["file"] for mutant in mutants}}
    done = folder / "outcomes"
    known = dict(reversed(line.split("\t")) for line in done.read_text().splitlines()) if done.exists() else {}
    try:
        # Of the core's other tests none looks at anything but the wire.
        targets = ["--lib", "--test", "wire"] if module == "wire" else ["--lib"]
        programs, woven, impossible = weave(weaver, listed, tree, folder, sources, targets)
        runs = Runs(programs, tree)
        # The tests of a module have its name in theirs, but for those of the wire that look at it from outside.
        times = runs.times([] if thorough or module == "wire" else tests_of)
        quick = {test for test, seconds in times.items() if seconds < QUICK_S}
        own = {test for test in times if test[1].startswith(tuple(tests_of)) or (module, test[0]) == ("wire", "wire")}
        users = {test for test in times if thorough and test[1].split("::")[0] in naming(tree, module)}
        (folder / "slow").write_text("".join(f"{test}\n" for _, test in times.keys() - quick))
        began = time.monotonic()
        alive = [number for number, mutant in enumerate(mutants, 1)
                 if number in woven and known.get(mutant["name"]) not in JUDGED]  # fmt: skip
        with done.open("a") as file:
            for number in impossible:
                known[mutants[number - 1]["name"]] = "unviable"
                print("unviable", mutants[number - 1]["name"], sep="\t", file=file)
            for chosen in (own & quick, own - quick, users - own):
                tests = {test: times[test] for test in chosen}
                tried, alive = alive, []
                for number in tried:
                    outcome = runs.outcome(tests, number)
                    if outcome == "missed":
                        alive.append(number)
                    known[mutants[number - 1]["name"]] = outcome
                    print(outcome, mutants[number - 1]["name"], sep="\t", file=file, flush=True)
        print(f"{module}: {len(woven)} of {len(mutants)} woven, run in {time.monotonic() - began:.0f} s")
    finally:
        for path, text in sources.items():
            (tree / path).write_text(text)
    left = [mutant["name"] for number, mutant in enumerate(mutants, 1)
            if known.get(mutant["name"]) not in JUDGED and woven.get(number, True)]  # fmt: skip
    (folder / "left").write_text("".join(name + "\n" for name in left))


if __name__ == "__main__":
    main(*sys.argv[1:])
