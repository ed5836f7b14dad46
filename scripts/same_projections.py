#!/usr/bin/env python3
"""Two folders of golden projections: the same files and cameras, pixels within 1e-6 px.

usage: same_projections.py STORED MADE
"""

import csv
import pathlib
import sys


def rows(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def main():
    stored, made = map(pathlib.Path, sys.argv[1:3])
    for folder in sorted(made.iterdir()):
        most_px = 0.0
        pairs = list(zip(rows(stored / folder.name / "projections.csv"), rows(folder / "projections.csv"), strict=True))
        for old, new in pairs:
            assert (old["file"], old["camera"]) == (new["file"], new["camera"]), (folder, old, new)
            most_px = max(most_px, *(abs(float(old[axis]) - float(new[axis])) for axis in "uv"))
        print(f"{folder.name}: {len(pairs)} projections, at most {most_px:.1e} px apart")
        assert most_px < 1e-6, folder


if __name__ == "__main__":
    main()
