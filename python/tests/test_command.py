"""The command of the wheel, and the same bytes from Python."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from conftest import SCENES

import flank

COMMAND = Path(sys.executable).with_name("flank")


def command(*words: object, **options: object) -> subprocess.CompletedProcess:
    return subprocess.run([COMMAND, *map(str, words)], capture_output=True, text=True, check=False, **options)


def assert_same(left: Path, right: Path) -> None:
    files = sorted(path.relative_to(left) for path in left.rglob("*") if path.is_file())
    assert files == sorted(path.relative_to(right) for path in right.rglob("*") if path.is_file())
    assert len(files) > 2
    for file in files:
        assert (left / file).read_bytes() == (right / file).read_bytes(), file


@pytest.mark.parametrize("name", ["kahraman-singh", "W5b-ch", "bouncing-ball"])
def test_a_run_has_the_bytes_of_the_command(tmp_path, name):
    path = SCENES / f"{name}.json"
    done = command("run", path, "--out", tmp_path / "command", "--trajectory", "--no-report", "--quiet")
    assert done.returncode == 0, done.stderr
    run = flank.load(path).run(out=tmp_path / "python", trajectory=True)
    assert_same(tmp_path / "command", tmp_path / "python")
    # The events in memory are the lines of the table.
    table = (tmp_path / "python" / "events.csv").read_text().splitlines()
    events = flank.load(path).run().events
    assert table[0].split(",") == list(events) and len(table) == len(events) + 1
    place = table[0].split(",").index("uncertainty_s" if "uncertainty_s" in events else "uncertainty")
    assert [float(line.split(",")[place]) for line in table[1:]] == events[list(events)[place]].tolist()
    assert run.summary.to_dict() == flank.load(path).run().summary.to_dict()


def test_a_sweep_has_the_bytes_of_the_command(tmp_path):
    path, load = SCENES / "kahraman-singh.json", np.linspace(0.05, 0.3, 6)
    text = ",".join(map(repr, load.tolist()))
    words = ["--vary", "/train/transmission_error/0/frequency=0.5:0.8:3", "--vary", f"/train/mean_load={text}", "--seed", "both"]
    done = command("sweep", path, *words, "--out", tmp_path / "command", "--quiet")
    assert done.returncode == 0, done.stderr
    data = flank.sweep(flank.load(path), frequency="0.5:0.8:3", mean_load=load, seed="both", out=tmp_path / "python", progress=False)
    assert_same(tmp_path / "command", tmp_path / "python")
    assert dict(data.sizes) == {"frequency": 3, "mean_load": 6, "direction": 2, "contact": 1}


def test_a_map_and_basins_have_the_bytes_of_the_command(tmp_path):
    path = SCENES / "kahraman-singh.json"
    words = ["--vary", "/train/transmission_error/0/frequency=0.4:1.6:8", "--vary", "/train/mean_load=0.02:0.3:9"]
    done = command("map", path, *words, "--out", tmp_path / "command", "--quiet")
    assert done.returncode == 0, done.stderr
    flank.map(flank.load(path), frequency="0.4:1.6:8", mean_load="0.02:0.3:9", out=tmp_path / "python", threads=1, progress=False)
    assert_same(tmp_path / "command", tmp_path / "python")
    words = ["--vary", "/initial/q/x=-1:1:6", "--vary", "/initial/v/x=-1:1:7"]
    done = command("basins", path, *words, "--out", tmp_path / "command-basins", "--quiet")
    assert done.returncode == 0, done.stderr
    flank.basins(flank.load(path), q="-1:1:6", v="-1:1:7", out=tmp_path / "python-basins", progress=False)
    assert_same(tmp_path / "command-basins", tmp_path / "python-basins")


def test_the_command_has_its_exit_codes_and_messages(tmp_path):
    assert command("--version").stdout.strip() == f"flank {flank.__version__}"
    wrong = command("run", tmp_path / "nothing.json")
    assert wrong.returncode == 2 and "nothing.json" in wrong.stderr
    assert command("nonsense").returncode == 2
    plan = command("sweep", "--vary", "/train/speed_rpm=500:600:4", "--plan", "2")
    assert plan.returncode == 0 and len(plan.stdout.splitlines()) == 2
    assert plan.stdout.startswith(str(COMMAND))


def test_a_signal_ends_the_command_as_without_python(tmp_path):
    words = [COMMAND, "run", SCENES / "kahraman-singh.json", "--out", tmp_path / "out", "--no-log", "--no-report", "--events", "1000000000"]
    scene = tmp_path / "long.json"
    scene.write_text((SCENES / "kahraman-singh.json").read_text().replace('"cycles": 500', '"cycles": 1000000000'))
    words[2] = scene
    process = subprocess.Popen(words, stderr=subprocess.PIPE, text=True)
    time.sleep(1.5)
    os.kill(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=20)
    assert process.returncode == 75, errors
    assert "Traceback" not in errors
    assert (tmp_path / "out" / "summary.json").exists()
