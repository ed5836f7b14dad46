"""Runs a reader on one blob after the other in one Python, which takes longer to start than to read.
Usage: read_each.py READER RIG.rays...; prints of each its exit code, what it printed and what it said, each before a zero."""
import contextlib, io, os, runpy, sys

reader, *blobs = sys.argv[1:]
sys.path[0] = os.path.dirname(reader)
for blob in blobs:
    printed, said, code = io.StringIO(), io.StringIO(), 0
    sys.argv = [reader, blob]
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(said):
        try:
            runpy.run_path(reader, run_name="__main__")
        except SystemExit as end:
            code = end.code or 0
            if isinstance(code, str):
                code = print(code, file=sys.stderr) or 1
    print(code, printed.getvalue(), said.getvalue(), sep="\0", end="\0")
