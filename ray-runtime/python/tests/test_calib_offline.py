"""``calib_offline``: the program from Python."""

import sys

import numpy as np
import pytest

import calib_offline
from conftest import ROOT


@pytest.fixture(scope="module")
def record(program, tmp_path_factory):
    out = tmp_path_factory.mktemp("results") / "stereo"
    # The poses that are left out make it faster, and are one thing more that arrives.
    return calib_offline.calibrate(ROOT / "data/stage", out, exclude=[3], program=program)


def test_a_folder_becomes_a_record_and_a_rig(record):
    assert record.grade in ("pass", "doubtful", "fail") and record.reasons
    assert record.calibration.exists() and record.blob.exists() and record.report.exists()
    assert record.data["schema"].startswith("calib-offline/calibration/")
    assert "3" in " ".join(record.data["command"]) if isinstance(record.data["command"], list) else "3" in record.data["command"]
    rig = record.rig()
    assert list(rig.cameras) == ["left", "right"] and rig.has_sigma()
    assert calib_offline.Record.read(record.folder).data == record.data
    assert calib_offline.Record.read(record.calibration).folder == record.folder


def test_the_blob_is_that_of_the_command_line(record, program, tmp_path):
    import subprocess

    command = [program, "calibrate", ROOT / "data/stage", "-o", tmp_path / "out", "--exclude", "3"]
    subprocess.run(command, check=True, capture_output=True)
    assert (tmp_path / "out/rig.rays").read_bytes() == record.blob.read_bytes()


def test_other_commands_run_too(record, program):
    found = calib_offline.run("inspect", record.blob, program=program)
    assert found["schema"].startswith("calib-offline/inspect")


def test_errors_have_their_exit_code_and_remedy(program, tmp_path):
    with pytest.raises(calib_offline.UsageError) as caught:
        calib_offline.calibrate(tmp_path / "none", tmp_path / "out", program=program)
    assert caught.value.exit_code == 2 and caught.value.remedy and "try: " in str(caught.value)
    with pytest.raises(calib_offline.UsageError) as caught:
        calib_offline.calibrate("--help", tmp_path / "out", program=program)
    assert "--help" in str(caught.value)
    with pytest.raises(calib_offline.UsageError):
        calib_offline.calibrate(ROOT / "data/stage", tmp_path / "out", method="guess", program=program)
    with pytest.raises(calib_offline.CalibrationError):
        calib_offline.run("no-such-verb", program=program)


def test_data_that_cannot_determine_it_end_with_undetermined(program, tmp_path):
    poses = calib_offline.run("inspect", ROOT / "data/stage", program=program)["cameras"][0]["images"]
    with pytest.raises(calib_offline.Undetermined) as caught:
        calib_offline.calibrate(ROOT / "data/stage", tmp_path / "out", exclude=range(2, poses), program=program)
    assert caught.value.exit_code == 3 and caught.value.chain
    assert not (tmp_path / "out/calibration.json").exists()


def test_results_are_replaced_only_when_asked(record, program):
    with pytest.raises(calib_offline.UsageError):
        calib_offline.calibrate(ROOT / "data/stage", record.folder, program=program)


def test_a_program_that_is_not_there_is_said(monkeypatch, tmp_path):
    with pytest.raises(calib_offline.ProgramNotFound, match="argument program"):
        calib_offline.find_program(tmp_path / "none")
    monkeypatch.setenv("CALIB_OFFLINE", str(tmp_path / "none"))
    with pytest.raises(FileNotFoundError, match="CALIB_OFFLINE"):
        calib_offline.calibrate("a", "b")
    monkeypatch.delenv("CALIB_OFFLINE")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(calib_offline.ProgramNotFound, match="cargo install"):
        calib_offline.run("inspect", "x")


def test_a_program_that_is_another_is_said():
    with pytest.raises(calib_offline.CalibrationError, match="ended with code"):
        calib_offline.run("inspect", "x", program=sys.executable)


def test_what_is_no_record_is_said(tmp_path):
    with pytest.raises(FileNotFoundError):
        calib_offline.Record.read(tmp_path)
    for content in ["{", "[]", "{}"]:
        (tmp_path / "calibration.json").write_text(content)
        with pytest.raises(ValueError, match="is no calibration"):
            calib_offline.Record.read(tmp_path)


def test_points_of_the_record_lie_where_boards_were(record):
    """The rig measures: a point before the cameras is seen by both and comes back."""
    rig = record.rig()
    xyz = np.array([[60.0, 70.0, 0.0], [20.0, 30.0, 10.0], [69.4, 63.1, 9.3]])
    uv = [rig.project(camera, xyz) for camera in (0, 1)]
    points = rig.triangulate(*uv, sigma=True)
    assert points.ok.all()
    # Projection is good to some 0.001 px, and a pixel is about 0.2 mm here.
    np.testing.assert_allclose(points.xyz, xyz, atol=0.01)
    assert (points.sigma < 1.0).all()
