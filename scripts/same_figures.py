#!/usr/bin/env python3
"""Compares figures on standard input with a stored file, both JSON: the same keys, numbers alike to 1e-6.

usage: opencv_figures.py DATASET --json | same_figures.py FILE

The stored figures are those of a minimum found to 1e-12 of its cost, which leaves parameters some 1e-6 of themselves
(or, near zero, of 1) off on another machine.
"""

import json
import pathlib
import sys

TOLERANCE = 1e-6


def numbers(value, path=""):
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from numbers(inner, f"{path}.{key}")
    elif isinstance(value, list):
        for index, inner in enumerate(value):
            yield from numbers(inner, f"{path}[{index}]")
    elif isinstance(value, (int, float)):
        yield path, value


def main():
    found = dict(numbers(json.load(sys.stdin)))
    stored = dict(numbers(json.loads(pathlib.Path(sys.argv[1]).read_text())))
    if found.keys() != stored.keys():
        sys.exit(f"other keys: {sorted(found.keys() ^ stored.keys())}")
    worst = max(abs(found[key] - stored[key]) / max(1.0, abs(stored[key])) for key in stored)
    print(f"{len(stored)} figures, largest difference {worst:.1e}")
    if worst > TOLERANCE:
        sys.exit(f"more than {TOLERANCE}")


main()
