"""Sweeps, maps, basins and ensembles."""

import os
import signal
import subprocess
import sys
import threading

import numpy as np
import pytest

import flank


def test_a_sweep_is_the_steady_motion_of_each_point(pair):
    loads = np.array([0.05, 0.1, 0.3])
    data = flank.sweep(pair, mean_load=loads, progress=False)
    assert np.array_equal(data["mean_load"], loads)
    for load in loads:
        point = data.sel(mean_load=load, contact="mesh")
        assert point["kind"] == "periodic"
        # The run of the scene ends on the same orbit.
        mesh = pair.with_(mean_load=load).run().contacts["mesh"]
        assert abs(point["apart_fraction"] - mesh.apart_fraction) < 1e-9


def test_units_are_attributes(spur):
    data = flank.sweep(spur, speed_rpm=[1000, 1200], torque_nm=[20, 30], progress=False, columns=["force_max", "bearing_force_mean"])
    assert data["speed_rpm"].attrs == {"pointer": "/train/speed_rpm", "units": "rev/min"}
    assert data["torque_nm"].attrs["units"] == "N m"
    assert data["force_max_n"].attrs == {"units": "N"}
    assert data["cycle_s"].attrs == {"units": "s"}
    assert set(data["force_max_n"].dims) == {"speed_rpm", "torque_nm", "contact"}


def test_a_failed_point_says_why(pair):
    # A budget of one event: teeth that stay together need none.
    with pytest.warns(flank.SceneWarning, match="1 of 2 points failed"):
        data = flank.sweep(pair.with_(event_budget=1), mean_load=[0.1, 0.5], progress=False)
    failed = data.where(data["error"] != "", drop=True)
    assert np.isnan(failed["apart_fraction"]).all()


def test_all_faults_of_axes_are_reported(pair):
    with pytest.raises(flank.SceneError) as error:
        flank.sweep(pair, {"/train/mean_load": "1:2"}, frequency="a:b:c", progress=False)
    assert len(error.value.faults) >= 2
    with pytest.raises(flank.SceneError, match="mean_load"):
        flank.map(pair, mean_lod=[1, 2], frequency=[0.5, 0.6], progress=False)
    with pytest.raises(flank.SceneError, match="seed"):
        flank.sweep(pair, mean_load=[0.1, 0.2], seed="sideways", progress=False)
    with pytest.raises(flank.SceneError, match="q x, v x"):
        flank.basins(pair, {"q y": [0, 1]}, v=[0, 1], progress=False)


def test_an_interrupted_sweep_goes_on(pair, tmp_path):
    loads, whole = np.linspace(0.03, 0.4, 3000), tmp_path / "whole"
    flank.sweep(pair, mean_load=loads[:3], out=whole, progress=False)
    timer = threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(flank.Interrupted, match="goes on"):
        flank.sweep(pair, mean_load=loads, out=tmp_path / "parts", progress=False)
    kept = len((tmp_path / "parts" / "sweep.journal").read_text().splitlines())
    assert 1 < kept < 3001
    data = flank.sweep(pair, mean_load=loads, out=tmp_path / "parts", progress=False)
    assert data.sizes["mean_load"] == 3000 and (data["error"] == "").all()
    # A finished sweep is read again; another one is refused.
    assert flank.sweep(pair, mean_load=loads, out=tmp_path / "parts", progress=False).equals(data)
    with pytest.raises(flank.Error):
        flank.sweep(pair, mean_load=loads[:3], out=tmp_path / "parts", progress=False)
    flank.sweep(pair, mean_load=loads[:3], out=tmp_path / "parts", replace=True, progress=False)
    assert (tmp_path / "parts" / "sweep.csv").read_bytes() == (whole / "sweep.csv").read_bytes()


def test_a_map_decides_the_kind_of_each_cell(pair):
    shares = []
    data = flank.map(pair, frequency="0.4:1.6:12", mean_load="0.02:0.3:10", threads=2, progress=shares.append)
    assert data["kind"].shape == (12, 10)
    assert set(np.unique(data["impacts"])) <= {"none", "single-sided", "double-sided", "back-flank", ""}
    cell = data.isel(frequency=3, mean_load=4)
    motion = pair.with_(frequency=float(cell["frequency"]), mean_load=float(cell["mean_load"]), cycles=600, transient_cycles=500).run()
    assert abs(float(cell["apart_fraction"].item()) - motion.contacts["mesh"].apart_fraction) < 1e-9
    assert shares[-1] == 1


def test_basins_have_their_attractors(pair):
    data = flank.basins(pair, q=np.linspace(-2, 2, 9), v=np.linspace(-2, 2, 8), progress=False)
    assert data["attractor"].shape == (9, 8)
    shares = np.bincount(data["attractor"].values.ravel() + 1, minlength=2)[1:] / 72
    assert data["attractor_fraction"].values.tolist() == shares.tolist()
    assert data["attractor_kind"].values.tolist() == ["periodic"] * len(shares)


def test_cells_lie_at_their_values_in_any_order(pair, tmp_path):
    loads, frequencies = np.array([0.3, 0.05, 0.1]), [0.8, 0.5]
    data = flank.map(pair, frequency=frequencies, mean_load=loads, progress=False)
    again = flank.map(pair, mean_load=np.sort(loads), frequency="0.5:0.8:2", progress=False)
    assert np.array_equal(data["mean_load"], loads) and np.array_equal(data["frequency"], frequencies)
    for name in ("period_cycles", "apart_fraction"):
        assert data[name].transpose(*again[name].dims).sortby(["mean_load", "frequency"]).equals(again[name])
    alone = flank.sweep(pair, mean_load=0.1, progress=False)
    assert alone.sizes["mean_load"] == 1
    with pytest.raises(flank.SceneError, match="a value twice"):
        flank.sweep(pair, mean_load=[0.1, 0.1], progress=False)


def test_a_finished_folder_with_other_columns_is_refused(pair, tmp_path):
    flank.sweep(pair, mean_load=[0.1, 0.2], columns=["force_max"], out=tmp_path / "out", progress=False)
    with pytest.raises(flank.SceneError, match="replace=True"):
        flank.sweep(pair, mean_load=[0.1, 0.2], columns=["impulse"], out=tmp_path / "out", progress=False)
    data = flank.sweep(pair, mean_load=[0.1, 0.2], columns=["impulse"], out=tmp_path / "out", replace=True, progress=False)
    assert "impulse" in data and "force_max" not in data


@pytest.mark.parametrize(
    ("work", "place"),
    [
        (lambda pair: flank.sweep(pair, mean_load=[0.1, 0.2], tolerance=1.0), "tolerance"),
        (lambda pair: flank.sweep(pair, mean_load=[0.1, 0.2], threads=0), "threads"),
        (lambda pair: flank.sweep(pair, mean_load=[0.1, 0.2], measure_cycles=-1), "measure_cycles"),
        (lambda pair: flank.sweep(pair, mean_load=[0.1, np.inf]), "mean_load"),
        (lambda pair: flank.sweep(pair, mean_load=["a", "b"]), "mean_load"),
        (lambda pair: flank.sweep(pair, mean_load=[]), "mean_load"),
        (lambda pair: flank.sweep(pair, mean_load="0.1,0.10"), "mean_load"),
        (lambda pair: flank.map(pair, mean_load=[0.1, 0.2], frequency=[0.5, 0.6], further=0), "further"),
        (lambda pair: flank.Ensemble(pair, [[np.nan, 0.0]]), "x0"),
        (lambda pair: flank.Ensemble(pair, [[1.0, 0.0]]).run(2**50), "cycles"),
        (lambda pair: flank.Ensemble(pair, [[1.0, 0.0]]).run(-1), "cycles"),
        (lambda pair: flank.orbit(pair, period=0), "period"),
        (lambda pair: flank.exponents(pair, cycles=0), "cycles"),
        (lambda pair: flank.continuation(pair, mean_load="0.1:0.2"), "mean_load"),
        (lambda pair: flank.threshold(pair, mean_load=(1.0, 1.0)), "mean_load"),
        (lambda pair: flank.SectionMap(pair)([1.0]), "x"),
    ],
)
def test_wrong_arguments_are_refused_with_their_place(pair, work, place):
    with pytest.raises(flank.SceneError, match=f"at {place}\\n"):
        work(pair)


@pytest.mark.parametrize("work", ["sections", "exponents", "orbits"])
def test_an_interrupt_ends_all_work(pair, work):
    threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    with pytest.raises(flank.Interrupted):
        if work == "sections":
            flank.Ensemble(pair, np.random.default_rng(1).uniform(-1, 1, (2000, 2))).run(200_000, every=1000)
        elif work == "exponents":
            flank.exponents(pair, cycles=100_000_000)
        else:
            flank.orbits(pair, starts=1_000_000)


def test_members_have_the_bits_of_runs_of_their_own(pair):
    rng = np.random.default_rng(1)
    starts = rng.uniform(-2, 2, (300, 2))
    states = flank.Ensemble(pair, starts).run(20, every=5)
    assert states.shape == (300, 5, 2)
    assert np.array_equal(states[:, 0], starts)
    assert np.array_equal(states, flank.Ensemble(pair, starts).run(20, every=5, threads=1))
    whole = flank.Ensemble(pair, starts).run(20, every=20)
    for member in (0, 17, 299):
        q, v = starts[member]
        run = pair.with_({"/initial": {"q": [q], "v": [v]}}).run(cycles=20, transient_cycles=0)
        assert np.array_equal(whole[member, -1], [*run.outcome.q, *run.outcome.v])
        assert np.allclose(states[member, -1], whole[member, -1], rtol=0, atol=1e-12)
    with pytest.raises(flank.SceneError, match="x0"):
        flank.Ensemble(pair, np.zeros((3, 5))).run(2)


def test_what_to_install_is_said_before_any_work(tmp_path):
    code = (
        "import sys; sys.modules['xarray'] = None\n"
        "import flank\n"
        "scene = flank.load()\n"
        f"try: flank.sweep(scene, speed_rpm=[500, 600], out={str(tmp_path / 'out')!r})\n"
        "except ImportError as error: print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "pip install xarray" in done.stdout
    assert not (tmp_path / "out").exists()


def test_the_import_needs_no_further_package():
    code = "import sys, flank; print([m for m in ('pandas', 'xarray', 'matplotlib', 'polars', 'scipy', 'tqdm') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
