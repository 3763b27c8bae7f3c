"""Runs: events, measures, motion."""

import copy
import os
import pickle
import signal
import threading
import time
from decimal import Decimal

import numpy as np
import pandas
import polars
import pyarrow
import pytest
from conftest import SCENES
from scipy import sparse

import flank

BALL = {
    "flank": 1,
    "train": {
        "kind": "wall",
        "mass_kg": 1,
        "load_n": -9.81,
        "wall": {"side": "below", "position_m": 0},
        "law": {"kind": "rigid", "restitution": 0.8},
    },
    "initial": {"q": [1]},
    "run": {"t_end_s": 5},
}


def test_a_ball_strikes_at_the_exact_times():
    run = flank.load(BALL).run()
    first = np.sqrt(2 / 9.81)
    flights = 2 * first * 0.8 ** np.arange(1, 30)
    exact = first + np.concatenate([[0.0], np.cumsum(flights)])
    times = run.events["t_s"][:30]
    assert np.all(np.abs(times - exact) <= 4 * np.finfo(float).eps * exact)
    assert run.events["kind"][0] == "impact"
    assert np.all(np.abs(run.events["approach_m_per_s"][:30] - 9.81 * first * 0.8 ** np.arange(30)) < 1e-13)


def test_exact_times_round_to_the_times(pair):
    run = pair.run()
    exact = run.events.exact_times()
    assert isinstance(exact[0], Decimal)
    assert [float(t) for t in exact] == run.events["t"].tolist()


def test_numbers_of_numpy_are_numbers_of_a_scene(pair):
    ball = {**BALL, "initial": {"q": np.array([1.0])}, "run": {"t_end_s": np.float64(5)}}
    assert flank.load(ball) == flank.load(BALL)
    assert pair.with_(mean_load=np.float64(0.25)) == pair.with_(mean_load=0.25)
    assert pair.with_(cycles=np.int64(700)).resolved["run"]["cycles"] == 700


def test_columns_of_events_agree_in_all_forms(pair):
    events = pair.run().events
    frame, other, table = events.to_pandas(), events.to_polars(), pyarrow.table(events)
    assert list(events) == list(frame.columns) == other.columns == table.column_names == list(events.array.dtype.names)
    assert len(events) == len(frame) == len(other) == table.num_rows == len(events.array) == 999
    for name in events:
        column = events[name]
        if column.dtype.kind == "f":
            absent = np.isnan(column)
            assert table[name].null_count == absent.sum()
            for values in (frame[name], other[name].fill_null(np.nan), table[name].to_numpy(), events.array[name]):
                assert np.array_equal(column, np.asarray(values), equal_nan=True)
        else:
            for values in (frame[name], other[name].cast(polars.String) if column.dtype.kind == "U" else other[name], events.array[name]):
                assert column.tolist() == list(values)
            assert column.tolist() == table[name].to_pylist()
    assert isinstance(frame["kind"].dtype, pandas.CategoricalDtype)


def test_measures_are_attributes_with_the_names_of_the_summary(pair):
    run = pair.run()
    mesh = run.contacts["mesh"]
    assert mesh.apart_fraction == mesh["apart_fraction"] == run.summary.contacts[0].apart_fraction == run.contacts[0].apart_fraction
    assert 0.6 < mesh.apart_fraction < 0.7
    with pytest.raises(AttributeError, match="apart_time"):
        _ = mesh.apart_tim
    with pytest.raises(KeyError, match="mesh"):
        _ = run.contacts["gear"]
    assert run.contacts.to_pandas().loc["mesh", "separations"] == 100
    assert "mesh" in run._repr_html_()


def test_the_motion_is_the_dense_output_at_exact_times(pair):
    run = pair.run(cycles=40, transient_cycles=0)
    events = run.events["t"]
    motion = run.trajectory(events)
    # At a crossing of a flank its deflection is half the backlash, 1.
    assert np.all(np.abs(np.abs(motion.deflection[:, 0]) - 1) < 1e-13)
    cycles = run.trajectory(samples_per_cycle=4)
    assert len(cycles) == 4 * 40 + 1
    # Rounded times differ from exact phases by half a unit in the last place.
    assert np.allclose(run.trajectory(cycles.t[:20]).q, cycles.q[:20], rtol=0, atol=1e-13)
    assert np.array_equal(cycles.q[-1], run.outcome.q)
    assert np.array_equal(cycles.v[-1], run.outcome.v)
    assert cycles.to_xarray()["force"].dims == ("t", "contact")
    # The end of the run, rounded to a double, is its last state.
    assert np.array_equal(run.trajectory(run.outcome.seconds).q[0], run.outcome.q)
    for wrong in ([1.0, 0.5], [-1.0], [1e9]):
        with pytest.raises(flank.SceneError, match="at t\n"):
            run.trajectory(wrong)


def test_keys_are_found_and_unknown_ones_refused(spur):
    assert spur.pointer("speed_rpm") == "/train/speed_rpm"
    assert spur.with_(speed_rpm=1800).resolved["train"]["speed_rpm"] == 1800
    with pytest.raises(flank.SceneError, match="speed_rpm") as error:
        spur.with_(speed_rmp=1800, cycles=5, torqe_nm=3)
    assert [fault.pointer for fault in error.value.faults] == ["speed_rmp", "torqe_nm"]
    assert ["speed_rpm" in error.value.faults[0].remedy, "torque_nm" in error.value.faults[1].remedy] == [True, True]
    with pytest.raises(flank.SceneError) as error:
        spur.with_({"/run/cycles": -1, "/train/torque_nm": "much"})
    assert {fault.pointer for fault in error.value.faults} == {"/train/torque_nm", "/run/cycles"}


def test_a_dictionary_has_the_faults_of_a_file(tmp_path):
    import json

    wrong = {**BALL, "run": {"t_end_s": -5}, "trian": {}}
    path = tmp_path / "wrong.json"
    path.write_text(json.dumps(wrong))
    faults = []
    for scene in (wrong, path):
        with pytest.raises(flank.SceneError) as error:
            flank.load(scene)
        faults.append(error.value.faults)
    assert faults[0] == faults[1] and len(faults[0]) >= 2


def test_an_observer_sees_every_event_and_ends_the_run(pair):
    seen = []
    run = pair.run(observer=seen.append)
    assert [event.seconds for event in seen] == run.events["t"].tolist()
    stopped = pair.run(observer=lambda event: event.index < 5)
    assert stopped.outcome.kind == "stopped" and stopped.work.events == 6
    with pytest.raises(ZeroDivisionError):
        pair.run(observer=lambda event: 1 / 0)


def test_runs_release_the_interpreter(pair):
    count, ends = 0, threading.Event()

    def watch():
        nonlocal count
        while not ends.is_set():
            count += 1
            time.sleep(1e-3)

    thread = threading.Thread(target=watch)
    thread.start()
    pair.run(cycles=50_000, log=False)
    ends.set()
    thread.join()
    assert count > 20


@pytest.mark.filterwarnings("ignore:.*budget")
def test_an_interrupt_ends_a_run_cleanly(pair):
    threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    with pytest.raises(flank.Interrupted) as error:
        pair.run(cycles=10**9, log=False)
    run = error.value.run
    assert run.outcome.kind == "interrupted" and run.work.events > 0
    assert isinstance(error.value, KeyboardInterrupt) and isinstance(error.value, flank.Error)


def test_a_spent_budget_warns_and_a_limit_does_not(pair):
    with pytest.warns(flank.SceneWarning, match="event_budget"):
        run = pair.run(event_budget=7)
    assert run.outcome.kind == "event-budget-spent" and len(run.events) == 7
    assert len(pair.run(max_events=7).events) == 7


@pytest.mark.filterwarnings("ignore:.*budget")
def test_a_failed_run_keeps_what_it_had(pair):
    with pytest.raises(flank.Error, match="step") as error:
        pair.run(step_budget=1000)
    run = error.value.run
    assert run.outcome.kind == "failed"
    assert 0 < len(run.events) < 999
    # Its motion up to there is at hand, and the error reaches other processes, without the run.
    assert len(run.trajectory(samples_per_cycle=4)) > 1000
    assert run.trajectory(run.outcome.seconds).t[0] == run.outcome.seconds
    there = pickle.loads(pickle.dumps(error.value))
    assert str(there) == str(error.value) and there.run is None
    with pytest.raises(flank.SceneError) as error:
        pair.with_({"/run/cycles": -1})
    assert pickle.loads(pickle.dumps(error.value)).faults == error.value.faults != []


def test_progress_is_reported(pair):
    shares = []
    pair.run(cycles=100_000, log=False, progress=shares.append)
    assert shares == sorted(shares) and shares[0] > 0 and shares[-1] == 1


def test_scenes_are_values(pair):
    again = pickle.loads(pickle.dumps(pair))
    assert again == pair and hash(again) == hash(pair)
    assert pickle.loads(pickle.dumps(pair.run().contacts["mesh"])) == pair.run().contacts["mesh"]
    contacts = pickle.loads(pickle.dumps(pair.run().contacts))
    assert copy.deepcopy(contacts) == contacts and contacts.mesh == contacts["mesh"]
    assert pair.check().name == pair.name
    assert flank.load().resolved["train"]["kind"] == "planetary"


def test_matrices_make_the_train_of_the_same_scene():
    contact = {
        "name": "stop",
        "direction": np.array([1.0, 0.0]),
        "half_backlash_m": 1e-4,
        "stiffness": 1e6,
        "law": {"kind": "kelvin-voigt", "damping_n_s_per_m": 10.0},
    }
    run = {"cycles": 50}
    harmonic = [{"vector_n": [30.0, 0.0], "frequency_rad_per_s": 300.0}]
    stiffness = np.array([[2e5, -1e5], [-1e5, 1e5]])
    dense = flank.Matrices([1.0, 2.0], None, stiffness, contacts=[contact], load_harmonics=harmonic, run=run)
    other = flank.Matrices(
        sparse.diags_array([1.0, 2.0]), None, sparse.csr_array(stiffness), contacts=[contact], load_harmonics=harmonic, run=run
    )
    assert other.freedoms == ["q1", "q2"]
    assert len(dense.run().events) > 0
    assert dense.run().events["t_s"].tolist() == other.run().events["t_s"].tolist()
    with pytest.raises(flank.SceneError, match="mass_kg"):
        flank.Matrices([1.0, -2.0], run=run)


def test_every_example_scene_loads():
    for path in sorted(SCENES.glob("*.json")):
        scene = flank.load(path)
        assert scene.freedoms and repr(scene)


@pytest.mark.parametrize(
    ("settings", "place"),
    [
        ({"max_events": -1}, "max_events"),
        ({"max_events": 2.5}, "max_events"),
        ({"trajectory": True}, "trajectory"),
        ({"replace": True}, "replace"),
        ({"cycles": -3}, "cycles"),
        ({"cycles": None}, "cycles"),
        ({"mean_load": "much"}, "mean_load"),
        ({"mean_load": float("nan")}, "mean_load"),
        ({"mean_load": [1, 2]}, "mean_load"),
        ({"log": "no"}, "log"),
        ({"observer": "print"}, "observer"),
        ({"progress": "x"}, "progress"),
    ],
)
def test_wrong_arguments_are_refused_with_their_place(pair, settings, place):
    with pytest.raises(flank.SceneError, match=place) as error:
        pair.run(**settings)
    assert error.value.faults and all(fault.allowed for fault in error.value.faults)


def test_times_and_samples_are_refused_with_their_place(pair):
    run = pair.run(max_events=20)
    for wrong in ("never", [[1.0], [2.0]], [np.nan], 1e9, -1.0):
        with pytest.raises(flank.SceneError, match="at t\n"):
            run.trajectory(wrong)
    for wrong in (0, -1, 1.5, True):
        with pytest.raises(flank.SceneError, match="samples_per_cycle"):
            run.trajectory(samples_per_cycle=wrong)
    with pytest.raises(flank.SceneError, match="samples_per_cycle"):
        run.trajectory([1.0], samples_per_cycle=3)
    with pytest.raises(flank.SceneError, match="contact"):
        run.plot("gear")
    with pytest.raises(TypeError, match="pickled"):
        pickle.dumps(run)


def test_columns_have_their_types_without_events(pair):
    empty, full = pair.run(max_events=20, log=False).events, pair.run().events
    assert len(empty) == 0
    assert pyarrow.table(empty).schema == pyarrow.table(full).schema
    assert empty["kind"].dtype.kind == "U" and empty["index"].dtype == np.int64


def test_a_record_keeps_its_events_beside_the_files(pair, tmp_path):
    run = pair.run(out=tmp_path / "out")
    assert len(run.events) == len((tmp_path / "out" / "events.csv").read_text().splitlines()) - 1


def test_plots_show_the_last_cycles_or_all_of_a_run(pair):
    import matplotlib as mpl

    mpl.use("Agg")
    run = pair.run()
    above, below = run.plot("mesh", cycles=3).axes
    (start, end), period = above.lines[0].get_xdata()[[0, -1]], run.summary.train.cycle
    assert end == run.outcome.seconds and abs(end - start - 3 * period) < 1e-9
    # The line passes each event at its deflection.
    events = above.lines[-1]
    assert len(events.get_xdata()) >= 6
    assert np.allclose(np.abs(events.get_ydata()), 1)
    # A flank far from the motion would flatten its line.
    labels = [text.get_text() for text in pair.with_(mean_load=0.2).run().plot().axes[0].get_legend().get_texts()]
    assert "drive flank" in labels and "back flank" not in labels
    assert below.get_ylabel() == "force" and above.get_ylabel() == "deflection"
    assert flank.load(BALL).run().plot().axes[0].get_ylabel() == "deflection in µm"


def test_the_time_of_an_impact_gives_the_state_after_it():
    ball = flank.load(SCENES / "bouncing-ball.json").run(cycles=40, transient_cycles=0)
    events = ball.events
    impacts = events["kind"] == "impact"
    speeds = ball.trajectory(events["t_s" if "t_s" in events else "t"][impacts]).v[:, 0]
    assert impacts.sum() > 30
    # The table moves, so that the speed after an impact has no sign of its own; it differs from that before.
    just_before = ball.trajectory(np.nextafter(np.nextafter(events["t_s" if "t_s" in events else "t"][impacts], -np.inf), -np.inf)).v[:, 0]
    release = events["release_m_per_s" if "t_s" in events else "release"][impacts]
    approach = events["approach_m_per_s" if "t_s" in events else "approach"][impacts]
    assert np.allclose(np.abs(speeds - just_before), release + approach, rtol=1e-9)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", ["spur-pair", "helical-pair", "bouncing-ball"])
def test_the_start_alone_is_a_sample(name):
    run = flank.load(SCENES / f"{name}.json").run()
    assert np.array_equal(run.trajectory(0.0).q[0], run.trajectory([0.0, 1e-6]).q[0])


def test_runs_that_end_early_have_their_last_state(pair):
    for run in (pair.run(max_events=13), pair.run(observer=lambda event: event.index < 7)):
        last = run.trajectory(run.outcome.seconds)
        assert np.allclose([*last.q[0], *last.v[0]], [*run.outcome.q, *run.outcome.v], rtol=0, atol=1e-13)
        assert len(run.trajectory(np.linspace(0, run.outcome.seconds, 9))) == 9


def test_a_key_is_that_of_the_scene_as_it_is_given():
    box = flank.load(SCENES / "three-shaft-box.json")
    assert box.pointer("total_backlash_m") == "/train/mesh/total_backlash_m"


def test_an_observer_may_return_anything(pair):
    assert pair.run(observer=lambda event: 0).outcome.kind == "reached-end"
    assert pair.run(observer=lambda event: np.bool_(False)).outcome.kind == "stopped"


def test_values_that_contradict_or_have_no_place_are_refused(pair):
    with pytest.raises(flank.SceneError, match="mean_load"):
        pair.with_({"/train/mean_load": 3}, mean_load=4)
    with pytest.raises(flank.SceneError, match="/train/mean_load"):
        pair.with_({"train/mean_load": 3})
    with pytest.raises(flank.SceneError, match="at /train/mass_kg/1"):
        flank.Matrices([1, np.nan], run={"cycles": 20})
    with pytest.raises(flank.SceneError, match="initial"):
        pair.with_({"/initial": {"q": [Decimal(1)]}})
    with pytest.raises(flank.SceneError, match="at /run/cycles"):
        pair.with_(cycles=10**400)
    with pytest.raises(flank.SceneError, match="scene"):
        flank.sweep("spur-pair.json", mean_load=[1, 2])


def test_absent_numbers_are_null_in_polars(pair):
    events = pair.run().events
    assert events.to_polars()["restitution"].null_count() == np.isnan(events["restitution"]).sum() > 0
    with pytest.raises(TypeError, match="to_pandas"):
        pickle.dumps(events)
