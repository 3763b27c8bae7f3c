"""Sections, orbits, exponents, branches, thresholds."""

import numpy as np
import pytest
from conftest import SCENES

import flank


def test_derivatives_of_the_map_are_those_of_its_differences(pair):
    section_map = flank.SectionMap(pair)
    x = np.array([0.21, 0.16])
    step = 1e-6
    columns = [(section_map(x + step * e).x - section_map(x - step * e).x) / (2 * step) for e in np.eye(2)]
    # Central differences: truncation of the order of the step squared, rounding of 1e-16 over the step.
    assert np.allclose(section_map.jacobian(x), np.column_stack(columns), rtol=1e-7, atol=1e-8)

    def shifted(load):
        return flank.SectionMap(pair.with_(mean_load=load))(x).x

    slope = (shifted(0.1 + step) - shifted(0.1 - step)) / (2 * step)
    assert np.allclose(section_map.derivative(x, "mean_load")[:, 0], slope, rtol=1e-7, atol=1e-8)
    assert section_map.derivative(x, "mean_load", "damping_ratio").shape == (2, 2)


def test_the_volume_of_the_map_is_that_of_its_damping(pair):
    # Damping in the gap too: div f = -2 zeta at every instant.
    section_map = flank.SectionMap(pair)
    determinant = np.linalg.det(section_map.jacobian(section_map.start()))
    assert abs(determinant / np.exp(-2 * 0.05 * section_map.cycle) - 1) < 1e-12


def test_an_orbit_is_a_fixed_point_and_its_multipliers_are_eigenvalues(pair):
    orbit, section_map = flank.orbit(pair), flank.SectionMap(pair)
    assert orbit.is_stable and orbit.period == 1 and orbit.word == "c0+ s0+"
    assert np.allclose(section_map(orbit.x).x, orbit.x, rtol=0, atol=1e-13)
    eigenvalues = np.linalg.eigvals(section_map.jacobian(orbit.x))
    assert np.allclose(np.sort_complex(eigenvalues), np.sort_complex(orbit.multipliers), atol=1e-12)
    # The scene of the orbit starts on it.
    run = orbit.scene.run(cycles=3, transient_cycles=0)
    assert np.allclose([*run.outcome.q, *run.outcome.v], orbit.x, atol=1e-12)


def test_further_starts_find_unstable_orbits(pair):
    found = flank.orbits(pair, starts=30)
    assert {(orbit.period, orbit.is_stable) for orbit in found} >= {(1, True), (1, False), (2, True)}


def test_no_orbit_is_an_error_with_its_reason():
    ball = flank.load(SCENES / "ball-on-wall.json")
    for work in (flank.orbit, flank.exponents, flank.SectionMap):
        with pytest.raises(flank.Error, match="period"):
            work(ball)


def test_exponents_sum_to_the_damping(pair):
    found = flank.exponents(pair, cycles=400, without_saltation=True, finite=10)
    assert found.exponents.shape == found.band.shape == (2,)
    assert abs(found.exponents.sum() + 0.1) < 1e-10 and found.sum_rule == pytest.approx(-0.1, rel=1e-12)
    assert found.cycles == 400
    assert found.without_saltation is not None and found.finite is not None and found.finite.cycles == 10


def test_a_branch_passes_its_special_points(pair):
    branches = flank.continuation(pair, mean_load=(0.05, 0.3))
    first = branches[0]
    assert first.x.shape == (len(first), 2) and first.is_stable.dtype == bool
    kinds = [special.kind for special in first.specials]
    assert "fold" in kinds and "period-doubling" in kinds
    fold = next(special for special in first.specials if special.kind == "fold")
    assert abs(fold.multiplier - 1) < 1e-6
    # Every point is an orbit of its scene.
    place = len(first) // 2
    section_map = flank.SectionMap(pair.with_(mean_load=first.values[place]))
    image = section_map(first.x[place], int(first.periods[place]))
    assert np.allclose(image.x, first.x[place], atol=1e-8)
    with pytest.raises(flank.SceneError, match="own value"):
        flank.continuation(pair, mean_load=(0.2, 0.3))
    with pytest.raises(TypeError):
        flank.continuation(pair)


def test_a_threshold_is_a_graze_of_the_motion(spur):
    found = flank.threshold(spur)
    assert found.threshold.kind == "graze" and found.pointer == "/train/torque_nm"
    torque = found.threshold.value
    for factor, is_apart in ((1 + 1e-6, False), (1 - 1e-6, True)):
        data = flank.sweep(spur, torque_nm=[torque * factor], progress=False)
        assert bool(data["apart_fraction"].item() > 0) == is_apart
    # The stated uncertainty covers the differences of searches in other ranges.
    others = [flank.threshold(spur, torque_nm=ends).threshold for ends in ((24, 26), (10, 40))]
    for other in others:
        assert abs(other.value - torque) <= other.uncertainty + found.threshold.uncertainty
    with pytest.raises(flank.SceneError, match="by"):
        flank.threshold(spur, by="sound")


def test_an_orbit_starts_again_where_it_closes(pair):
    # The run of the scene begins within a period; sections are at phase 0.
    period = flank.SectionMap(pair).cycle
    shifted = pair.with_({"/run/period": 0.3 * period, "/run/start_cycle": 5}, transient_cycles=0, cycles=50)
    section_map, orbit = flank.SectionMap(shifted), flank.orbit(shifted)
    assert np.allclose(section_map(orbit.section).x, orbit.x, atol=1e-12)
    again = orbit.scene
    state = flank.SectionMap(again).start()
    assert np.allclose(state.x, orbit.x, atol=1e-12)
    inside = section_map.section([0.5, 0.0])
    assert inside.contacts == ["separated"] and section_map.section([1.5, 0.0]).contacts == ["drive"]
    assert section_map.section(orbit.x, orbit.contacts).contacts == orbit.contacts
