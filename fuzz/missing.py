#!/usr/bin/env python3
"""Sorts the sides of branches that no input reached: fuzz/missing.py LINES..., what `llvm-cov show --show-branches=count` prints.

A side counts as reached if any copy of a generic function reached it. Those that cannot be reached are told from others by how they are
written: the `else` of a `get`, and of other questions of which the answer is known, so that no panic can be linked. Others are listed."""
import collections
import re
import sys

UNREACHABLE = re.compile(r"(get|get_mut|next|first_chunk|min|checked_sub|zip|map|structure)\(|self\.(pair|levels)|ok_or|_of\(")
reached = {}
source = None
for name in sys.argv[1:]:
    for line in open(name):
        if file := re.match(r"(/\S+/core/src/(\S+\.rs)):$", line):
            source = file.groups()
        branch = re.search(r"Branch \((\d+):(\d+)\): \[True: ([^,]+), False: ([^\]]+)\]", line)
        if branch and source:
            row, column, *counts = branch.groups()
            sides = reached.setdefault((source, int(row), int(column)), [False, False])
            for side, count in enumerate(counts):
                sides[side] |= count.strip() != "0"

sums = collections.Counter()
others = []
for ((path, name), row, column), sides in sorted(reached.items()):
    text = open(path).read().split("\n")
    # Tests at the end of a file are no part of what is to be reached.
    if "mod tests {" in text[:row]:
        continue
    for side in (0, 1):
        sums["all"] += 1
        if name.startswith("wire/"):
            sums["wire"] += 1
            sums["reached in the wire"] += sides[side]
        if sides[side]:
            continue
        code = text[row - 1].strip()
        if name.startswith("arch/x86_64") or (name == "matching/plan.rs" and re.search(r"Dsp|takes", code)):
            sums["processor"] += 1
        elif name.startswith("arch/generic") or name in ("arch/plain.rs", "wire/signal.rs"):
            sums["compiled"] += 1
        elif side == 1 and re.search(r"let (Some|\(Some)", code) and UNREACHABLE.search(" ".join(text[row - 1 : row + 2])):
            sums["else"] += 1
        else:
            sums["others"] += 1
            others.append(f"{name}:{row}: {'not false' if side else 'not true'}: {code}")
print(*others, sep="\n")
known = sums["else"] + sums["compiled"] + sums["processor"]
missed = known + sums["others"]
share = 100.0 * (sums["all"] - missed) / (sums["all"] - known)
print(
    f"by any copy: {sums['all'] - missed} of {sums['all']} sides of branches reached, "
    f"{100.0 * (sums['all'] - missed) / sums['all']:.1f} % ({100.0 * sums['reached in the wire'] / sums['wire']:.1f} % of "
    f"{sums['wire']} in the wire); not reached: {sums['else']} times the else of a get, "
    f"{sums['compiled']} in arch/generic, arch/plain.rs and wire/signal.rs, {sums['processor']} of other processors, "
    f"{sums['others']} others, listed above; without the first three kinds {share:.1f} %"
)
