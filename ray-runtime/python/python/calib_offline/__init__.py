"""``calib-offline`` from Python: calibrate a folder, get the record.

    import calib_offline

    record = calib_offline.calibrate("recordings/monday", "results/monday")
    print(record.grade, record.reasons)
    rig = record.rig()              # a rays.Rig

This runs the program ``calib-offline``, one process a call, and reads what it writes: the same bytes as on the
command line, errors with their remedies as exceptions, and an interrupt ends it with nothing half written. The program is that of the argument
``program``, else of the environment variable ``CALIB_OFFLINE``, else the one on ``PATH``.
"""

from ._errors import CalibrationError, ProgramNotFound, Undetermined, UsageError
from ._program import find_program, run
from ._record import Record, calibrate

__all__ = [
    "CalibrationError",
    "ProgramNotFound",
    "Record",
    "Undetermined",
    "UsageError",
    "calibrate",
    "find_program",
    "run",
]
