"""Motor sizing: energy balances, closed forms, and ratios that no search improves."""

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from driven_machines import driven
from mechanisms import CATALOG, CLIENTS, NIGHTLY, gated, in_turn, random_machine, with_elbows

import pteron
from pteron.motion import (
    CyclePlace,
    Motion,
    Motor,
    Sizing,
    Span,
    best_ratio,
    best_ratios,
    choose,
    motion_at_place,
    overloads,
    pick_and_place,
    read_motors,
    size,
    with_payload,
)
from pteron.motion.sizing.gearing import peak_span, rated_span, speed_span, torques
from pteron.motion.trajectories.scaling import keeps_margin, least_margin
from pteron.workspace import Box, home_pose

BARE = {
    **{name: CATALOG[name] for name in ("quadrupteron-oblique", "delta-4", "par4", "five-bar")},
    "another mode": with_elbows(CATALOG["quadrupteron"], "+-+-"),
    "mixed": random_machine(0, "PRS"),
    "random": random_machine(0, "PPPP"),
    "sliding": random_machine(0, "PRSSI"),
    "planar": random_machine(0, "CLP"),
}


MACHINES = {name: driven(robot) for name, robot in BARE.items()}
EVERY = in_turn(MACHINES, tuple(MACHINES), share=3)


@lru_cache
def middle(name):
    robot = MACHINES[name]
    return home_pose(robot) if robot.name in CATALOG else np.zeros(robot.freedom)


@lru_cache
def cycle(name, samples=201):
    return pick_and_place(MACHINES[name], middle(name), samples=samples, scale=0.2)


@lru_cache
def sized(name, dwell=0.0):
    return size(MACHINES[name], cycle(name), dwell=dwell)


def friction_work(found: Sizing):
    """Return what friction and offsets take over the motion, by the drives' own formula."""
    total = 0.0
    for drive, speed in zip(found.drives, found.speeds.T, strict=True):
        force = drive.coulomb * np.tanh(speed / drive.rest_speed) + drive.viscous * speed
        total += float(found.integral((force + drive.offset) * speed))
    return total


def stored(robot, found, motion):
    """Return the kinetic energy, motors' included, and the potential energy of each sample."""
    rotors = (0.5 * found.rotor_inertia * found.speeds[::2] ** 2).sum(axis=1)
    return (
        pteron.kinetic_energy(robot, motion.pose, motion.velocity) + rotors,
        pteron.potential_energy(robot, motion.pose),
    )


@EVERY
def test_what_the_drives_give_is_stored_or_lost_to_friction(name):
    robot, errors = MACHINES[name], []
    for samples in (51, 101, 201):
        whole = cycle(name, samples)
        # From rest to the middle of the way across, where the platform is fast.
        half = slice(0, samples // 4 + 1)
        parts = (whole.time, whole.pose, whole.velocity, whole.acceleration)
        motion = Motion(*(part[half] for part in parts))
        found = size(robot, motion)
        kinetic, potential = stored(robot, found, motion)
        gained = kinetic[-1] - kinetic[0] + potential[-1] - potential[0]
        errors.append(abs(float(found.energy.sum()) - gained - friction_work(found)))
        scale = float(found.given_energy.sum())
    assert errors[-1] < 1e-5 * scale
    assert errors[-1] < 0.2 * errors[0] + 1e-12 * scale


@EVERY
def test_a_closed_cycle_stores_nothing(name):
    found = sized(name)
    offsets = [
        drive.offset * found.integral(v)
        for drive, v in zip(found.drives, found.speeds.T, strict=True)
    ]
    assert abs(sum(offsets)) < 1e-9
    lost = friction_work(found)
    assert lost > 0.0
    assert float(found.energy.sum()) == pytest.approx(lost, rel=1e-5)
    assert found.energy == pytest.approx(found.integral(found.power), rel=1e-12, abs=1e-12)


def sine(amplitude, omega, offset=0.0):
    """Return a Tripteron whose motors are all there is to move, along x, and its motion.

    Its sliders' coordinates are those of the pose, so that speeds and forces are sines.
    """
    robot = replace(CATALOG["tripteron"], gravity=(0.0, 0.0, 0.0))
    drive = pteron.legs.Drive(viscous=40.0, offset=offset, rotor_inertia=1e-3, ratio=300.0)
    robot = replace(robot, legs=tuple(replace(leg, drive=drive) for leg in robot.legs))
    time = np.linspace(0.0, 2.0 * np.pi / omega, 401)
    x = np.zeros((401, 3))
    pose, velocity, acceleration = x.copy(), x.copy(), x.copy()
    pose[:, 0] = amplitude * np.sin(omega * time)
    velocity[:, 0] = amplitude * omega * np.cos(omega * time)
    acceleration[:, 0] = -amplitude * omega**2 * np.sin(omega * time)
    return robot, Motion(time, pose, velocity, acceleration)


def test_means_and_peaks_are_those_of_closed_forms():
    amplitude, omega = 0.02, 30.0
    robot, motion = sine(amplitude, omega)
    found = size(robot, motion)
    moving = int(np.abs(pteron.jacobian(robot, np.zeros(3))[:, 0]).argmax())
    speed, growth = amplitude * omega, amplitude * omega**2
    assert found.duration == pytest.approx(2.0 * np.pi / omega, rel=1e-14)
    assert found.peak_speeds[moving] == pytest.approx(speed, rel=1e-9)
    assert found.rms_speeds[moving] == pytest.approx(speed / np.sqrt(2.0), rel=1e-8)
    accelerations = np.sqrt(found.mean(found.accelerations**2))
    assert accelerations[moving] == pytest.approx(growth / np.sqrt(2.0), rel=1e-8)
    # Viscous friction takes c v^2 / 2 in the mean; what the masses take comes back.
    assert found.energy[moving] / found.duration == pytest.approx(40.0 * speed**2 / 2.0, rel=1e-8)
    # ratio^2 rotor_inertia = 90 kg.
    own = found.forces - found.loads
    np.testing.assert_allclose(own, 90.0 * found.accelerations, rtol=1e-12, atol=1e-9)
    assert found.rotor_inertia == pytest.approx([90.0] * 3)
    inertia = found.load_inertia[:, moving]
    assert found.inertia_ratios[moving] == pytest.approx(inertia[1] / 90.0, rel=1e-12)
    assert inertia[0] <= pteron.mass_matrix(robot, np.zeros(3))[0, 0] <= inertia[1]


def test_polynomials_of_the_third_degree_are_integrated_exactly():
    time = np.array([0.0, 0.1, 0.35, 0.4, 1.0])
    middles = np.sort(np.concatenate([time, (time[1:] + time[:-1]) / 2.0]))
    found = replace(sized("five-bar"), time=middles)
    cubic = np.stack([middles**3 - middles, 2.0 * middles**2], axis=-1)
    assert found.integral(cubic) == pytest.approx([-0.25, 2.0 / 3.0], rel=1e-14)


def test_a_rest_is_held_and_counts_in_every_mean():
    moving, resting = sized("par4"), sized("par4", 0.3)
    robot, rest = MACHINES["par4"], np.zeros(4)
    held = pteron.drive_forces(robot, cycle("par4").pose[-1], rest, rest)
    assert resting.forces[-1] == pytest.approx(held, rel=1e-12)
    whole = moving.duration + 0.3
    assert resting.duration == pytest.approx(whole)
    squares = (moving.duration * moving.rms_forces**2 + 0.3 * held**2) / whole
    assert resting.rms_forces == pytest.approx(np.sqrt(squares), rel=1e-12)
    assert resting.mean_power == pytest.approx(moving.mean_power * moving.duration / whole)
    assert resting.energy == pytest.approx(moving.energy)
    assert (resting.peak_forces >= np.abs(held)).all()


def test_motions_and_rests_follow_each_other():
    robot, one = MACHINES["par4"], cycle("par4")
    other = pick_and_place(robot, middle("par4"), samples=101, scale=0.1)
    both = size(robot, [one, other], dwell=[0.1, 0.4])
    parts = size(robot, one, dwell=0.1), size(robot, other, dwell=0.4)
    assert both.duration == pytest.approx(sum(part.duration for part in parts), rel=1e-12)
    squares = sum(part.duration * part.rms_forces**2 for part in parts)
    assert both.rms_forces == pytest.approx(np.sqrt(squares / both.duration), rel=1e-12)
    assert both.given_energy == pytest.approx(sum(part.given_energy for part in parts), rel=1e-12)
    assert both.peak_forces.tolist() == np.max([p.peak_forces for p in parts], axis=0).tolist()
    assert both.dwell == 0.5


@pytest.mark.parametrize(
    ("name", "wider"),
    [
        ("five-bar", 0.1),
        pytest.param("delta-4", 0.1, marks=NIGHTLY),
        pytest.param("quadrupteron-oblique", 0.05, marks=NIGHTLY),
    ],
)
def test_places_are_those_that_a_loop_over_all_finds(name, wider):
    robot, tool = MACHINES[name], cycle(name, 31)
    low, high = Box.around(tool.pose).box
    pad = np.where(robot.platform.angular, 0.0, wider * (high - low).max())
    region = Box(tuple(low - pad), tuple(high + pad))
    found = size(robot, tool, dwell=0.1, places=region, friction=0.1)
    assert found.assumed_friction.tolist() == [0.0] * robot.joint_count
    keys = {f"{name}s": name for name in ("peak_force", "rms_force", "peak_speed")}
    some = {i for name in keys.values() for i in found.worst(name)}
    some |= set(range(0, len(found.places), max(1, len(found.places) // 60)))
    alone = {i: size(robot, motion_at_place(robot, tool, found.places[i]), dwell=0.1) for i in some}
    for key in (*keys, "given_energy"):
        for i, one in alone.items():
            assert getattr(found.select_place(i), key) == pytest.approx(getattr(one, key), rel=1e-9)
    for key in keys:
        every = [getattr(one, key) for one in alone.values()]
        assert getattr(found, key) == pytest.approx(np.max(every, axis=0), rel=1e-9)
    # No place or turn between those that were looked at is worse.
    rng, most = np.random.default_rng(0), found.rms_forces
    for _ in range(25):
        other = CyclePlace(tuple(rng.uniform(*region.box)), rng.uniform(0.0, 2.0 * np.pi))
        moved = motion_at_place(robot, tool, other)
        if region.holds(moved.pose).all():
            assert (size(robot, moved, dwell=0.1).rms_forces <= 1.01 * most).all()
    # The best ratio, and those that serve, are of all places.
    every = [found.select_place(i) for i in range(len(found.places))]
    best = best_ratio(found, 1, 3e-5)
    ratios = best * np.array([0.999, 1.0, 1.001])
    least = [torques(found, 1, ratio, 3e-5)[0] for ratio in ratios]
    assert least[1] == pytest.approx(max(torques(one, 1, best, 3e-5)[0] for one in every))
    assert min(least) >= least[1] * (1.0 - 1e-9)
    span, rated = rated_span(found, 1, 3e-5, 1.2 * least[1]), 1.2 * least[1]
    spans = [rated_span(one, 1, 3e-5, rated) for one in every]
    assert span.least == pytest.approx(max(s.least for s in spans), rel=1e-9)
    assert span.greatest == pytest.approx(min(s.greatest for s in spans), rel=1e-9)


@CLIENTS
@pytest.mark.parametrize("name", gated(["quadrupteron", "par4"], ["quadrupteron"], NIGHTLY))
def test_the_platform_turns_with_the_cycle(name):
    robot = CATALOG[name]
    robot = replace(robot, platform=replace(robot.platform, tool=(0.0, 0.0, 0.0)))
    tool = pick_and_place(robot, samples=31, scale=0.2)
    found = size(robot, tool, places="workspace")
    turns, angles = np.array([(place.turn, place.pose[-1]) for place in found.places]).T
    with_it = np.abs(np.angle(np.exp(1j * (angles - turns)))) < 1e-9
    assert (with_it & (turns > 0.1)).sum() > 2
    assert (~with_it & (angles == 0.0)).sum() > 2
    # The whole is turned as one, here by hand.
    i = int(np.flatnonzero(with_it & (turns > 0.1))[0])
    c, s = np.cos(turns[i]), np.sin(turns[i])
    matrix = np.eye(4)
    matrix[:2, :2] = [[c, -s], [s, c]]
    middle = Box.around(tool.pose).box.mean(axis=0)
    pose = (tool.pose - middle) @ matrix.T + found.places[i].pose
    moved = Motion(tool.time, pose, tool.velocity @ matrix.T, tool.acceleration @ matrix.T)
    assert found.select_place(i).rms_forces == pytest.approx(
        size(robot, moved).rms_forces, rel=1e-9
    )
    # No place and turn of the path, or of the whole, between those that were looked at is worse.
    rng, box = np.random.default_rng(0), Box.around(np.array([p.pose for p in found.places])).box
    least = least_margin(robot, home_pose(robot))
    for k in range(40):
        turn = rng.uniform(-0.5, 0.5) if k % 2 else rng.uniform(0.0, 2.0 * np.pi)
        place = CyclePlace((*rng.uniform(*box)[:3], turn if k % 2 else 0.0), turn)
        moved = motion_at_place(robot, tool, place)
        if keeps_margin(robot, moved.pose, least):
            assert (size(robot, moved).rms_forces <= 1.01 * found.rms_forces).all()


def test_a_region_that_is_not_all_in_reach_is_refused_with_the_place():
    robot = BARE["delta-4"]
    with pytest.raises(pteron.DataError, match=r"places: about \[.*: pose.*misses it by"):
        size(robot, cycle("delta-4", 31), places=Box((-2.0, 0.0, -1.0, 0.0), (2.0, 0.1, -0.8, 0.5)))
    with pytest.raises(pteron.DataError, match=r"places\[0\]: pose \[0.0\] given, x y z phi"):
        size(robot, cycle("delta-4", 31), places=[CyclePlace((0.0,))])


def test_friction_is_assumed_where_the_file_has_none():
    bare = size(BARE["five-bar"], cycle("five-bar"))
    assert bare.net_energy == 0.0
    found = size(BARE["five-bar"], cycle("five-bar"), friction=0.1)
    assert found.assumed_friction == pytest.approx(0.1 * bare.peak_forces, rel=1e-12)
    work = found.integral(found.assumed_friction * np.abs(found.speeds))
    assert found.net_energy == pytest.approx(work.sum(), rel=1e-3)
    with pytest.raises(pteron.DataError, match=r"friction: -0\.1 given"):
        size(BARE["five-bar"], cycle("five-bar"), friction=-0.1)


def test_forces_are_those_of_the_drives_with_payload_and_wrench():
    robot, motion = with_payload(MACHINES["random"], 0.7), cycle("random")
    state = motion.pose, motion.velocity, motion.acceleration
    wrench = np.array([1.0, -2.0, 3.0, 0.2])
    found = size(robot, motion, wrench=wrench)
    expected = pteron.drive_forces(robot, *state, wrench, smooth=True)
    np.testing.assert_allclose(found.forces[::2], expected, rtol=1e-12)
    assert found.peak_forces == pytest.approx(np.abs(found.forces).max(axis=0))
    assert not np.allclose(found.peak_forces, sized("random").peak_forces, rtol=0.01)


@EVERY
def test_the_best_ratio_is_the_least_of_a_search(name):
    found = sized(name, 0.1)
    for leg in range(1, found.robot.freedom + 1):
        for rotor in (1e-6, 3e-5):
            best = best_ratio(found, leg, rotor)
            least, _ = torques(found, leg, best, rotor)
            ratios = best * np.geomspace(0.5, 2.0, 101)
            others = [torques(found, leg, ratio, rotor)[0] for ratio in ratios]
            assert min(others) >= least * (1.0 - 1e-12)
            assert int(np.argmin(others)) == 50
    own = [best_ratio(found, i, 3e-5) for i in range(1, found.robot.freedom + 1)]
    assert best_ratios(found) == pytest.approx(own)


def test_a_motors_torque_is_that_of_the_drive_at_its_own_ratio():
    found = sized("mixed", 0.2)
    rms, peak = found.motor_torques
    for i, drive in enumerate(found.drives):
        own = torques(found, i + 1, drive.gear, drive.rotor_inertia)
        assert own == pytest.approx((rms[i], peak[i]), rel=1e-9)


@EVERY
def test_the_ratios_that_serve_are_all_that_a_search_finds(name):
    found = sized(name, 0.1)
    rng = np.random.default_rng(5)
    some = 0
    for leg in range(1, found.robot.freedom + 1):
        rotor = 3e-5
        best = best_ratio(found, leg, rotor)
        rms, peak = torques(found, leg, best, rotor)
        rated, most = rms * rng.uniform(0.9, 1.6), peak * rng.uniform(0.9, 1.6)
        fastest = best * found.peak_speeds[leg - 1] * rng.uniform(0.8, 1.5)
        spans = (
            rated_span(found, leg, rotor, rated),
            peak_span(found, leg, rotor, most),
            speed_span(found, leg, fastest),
        )
        for ratio in best * np.geomspace(0.2, 5.0, 401):
            rms, peak = torques(found, leg, ratio, rotor)
            asked = rms <= rated, peak <= most, ratio * found.peak_speeds[leg - 1] <= fastest
            assert tuple(ratio in span for span in spans) == asked
            some += all(asked)
    assert some


def test_without_a_rotor_only_speed_bounds_the_ratio():
    found = sized("five-bar")
    assert best_ratio(found, 1, 0.0) == np.inf
    assert peak_span(found, 1, 0.0, 1.0).greatest == np.inf
    assert rated_span(found, 1, 0.0, 1.0).greatest == np.inf
    fit = choose(found, [Motor("ideal", 0.0, 1.0, 2.0, 400.0)])[0]
    assert fit.ratio * found.peak_speeds[0] == pytest.approx(400.0)
    assert fit.fits
    assert fit.inertia_ratio == np.inf


def test_the_smallest_motor_that_serves_comes_first():
    found = sized("delta-4")
    motors = [
        Motor("weak", 1e-6, 1e-4, 2e-4, 600.0),
        Motor("400 W", 2.6e-5, 1.27, 3.8, 600.0),
        Motor("100 W", 4e-6, 0.32, 0.95, 600.0),
        Motor("slow", 4e-6, 0.32, 0.95, 0.1),
    ]
    fits = choose(found, motors)
    assert [fit.leg for fit in fits] == sorted([1, 2, 3, 4] * 4)
    for leg in range(1, 5):
        own = [fit for fit in fits if fit.leg == leg]
        serving = [fit for fit in own if fit.fits]
        assert [fit.motor.name for fit in own[:2]] == ["100 W", "400 W"]
        assert own[: len(serving)] == serving
        for fit in own:
            rms, peak = torques(found, leg, fit.ratio, fit.motor.rotor_inertia)
            assert fit.rated_margin == pytest.approx(fit.motor.rated_torque / rms)
            assert fit.peak_margin == pytest.approx(fit.motor.peak_torque / peak)
            assert fit.fits == (fit.margin >= 1.0 - 1e-9)
            assert fit.scarcest in ("rated torque", "peak torque", "speed")
            if fit.fits:
                assert fit.ratio in fit.span
    weak = next(fit for fit in fits if fit.motor.name == "weak")
    assert not weak.fits
    assert (weak.scarcest, weak.margin) == ("rated torque", weak.rated_margin)


def test_a_margin_is_kept_at_every_ratio_that_serves():
    found = sized("mixed")
    motor = Motor("400 W", 2.6e-5, 1.27, 3.8, 600.0)
    for plain, careful in zip(
        choose(found, [motor]), choose(found, [motor], margin=1.5), strict=True
    ):
        assert careful.fits
        assert plain.span.least < careful.span.least
        assert careful.span.greatest < plain.span.greatest
        assert careful.margin >= 1.5 * (1.0 - 1e-9)
    with pytest.raises(pteron.DataError, match=r"margin: 0\.5 given"):
        choose(found, [motor], margin=0.5)


def test_what_is_more_than_the_drives_can_do_is_told_by_leg_and_amount():
    weak = driven(BARE["five-bar"], rated_torque=1e-3, max_force=0.01, max_speed=0.1)
    found = size(weak, cycle("five-bar"))
    told = found.overloads
    assert len(told) == 6
    assert [text[:6] for text in told] == ["leg 1:"] * 2 + ["leg 2:"] * 2 + ["leg 1:", "leg 2:"]
    assert f"{found.rms_forces[0]:.4g} N m RMS" in told[4]
    assert "0.02 N m continuously" in told[4]
    assert sized("five-bar").overloads == ()


def test_a_motor_that_gives_too_little_at_a_speed_is_told_with_its_place():
    """Neither force nor speed is too much by itself: one moment has too much of both."""
    bare = BARE["quadrupteron-oblique"]
    free = size(bare, cycle("quadrupteron-oblique"))
    force, speed = free.peak_forces[1], free.peak_speeds[1]
    shares = np.abs(free.forces[:, 1]) / force + np.abs(free.speeds[:, 1]) / speed
    assert 1.0 < shares.max() < 1.95
    between = 0.5 * (1.0 + shares.max())
    falls = (0.0, between * force), (between * speed, 0.0)
    legs = list(bare.legs)
    legs[1] = replace(legs[1], drive=pteron.legs.Drive(curve=falls))
    robot = replace(bare, legs=tuple(legs))
    found = size(robot, cycle("quadrupteron-oblique"))
    (one,) = found.margins
    asked = np.abs(found.forces[:, 1]) / np.interp(np.abs(found.speeds[:, 1]), *np.transpose(falls))
    assert (one.leg, one.limit, one.quantity) == (2, "curve", "force_at_speed")
    assert asked.max() > 1.0
    assert one.margin == pytest.approx(1.0 / asked.max(), rel=1e-12)
    (told,) = found.overloads
    assert told == (
        f"leg 2: the motion takes {one.needed:.4g} N at a speed at which its drive gives "
        f"{one.most:.4g} N (curve)"
    )
    assert overloads(robot, found.forces, found.speeds) == (told,)
    legs[1] = replace(legs[1], drive=pteron.legs.Drive(curve=((0.0, force), (0.5 * speed, 0.0))))
    none = overloads(replace(bare, legs=tuple(legs)), found.forces, found.speeds)
    assert none[0].endswith("its drive gives 0 N (curve)")
    here = CyclePlace(tuple(cycle("quadrupteron-oblique").pose.mean(axis=0)))
    places = size(robot, cycle("quadrupteron-oblique"), places=[here])
    assert str(here) in places.overloads[0]


def test_the_table_has_a_row_a_leg_and_no_number_that_is_not_one():
    found = size(BARE["mixed"], cycle("mixed"))
    table = found.table()
    assert table["leg"].to_list() == [1, 2, 3]
    assert table["force_unit"].to_list() == ["N", "N m", "N"]
    assert table["speed_unit"].to_list() == ["m/s", "rad/s", "m/s"]
    for name in ("rotor_inertia", "inertia_ratio", "ratio", "best_ratio", "rms_motor_torque"):
        assert table[name].null_count() == 3
        assert sized("mixed").table()[name].null_count() == 0
    assert table["rms_force"].to_list() == found.rms_forces.tolist()
    assert np.isfinite(table.select("peak_force", "given_energy").to_numpy()).all()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"time": np.zeros(201)}, "ascend"),
        (
            dict.fromkeys(("pose", "velocity", "acceleration"), np.zeros((201, 3))),
            "motion.pose: shape (201, 3) given, (201, 2) expected",
        ),
        ({"velocity": np.zeros((7, 2))}, "motion.velocity: shape (7, 2)"),
    ],
)
def test_a_motion_that_is_none_of_the_machine_is_refused(change, words):
    with pytest.raises(pteron.DataError) as caught:
        size(MACHINES["five-bar"], replace(cycle("five-bar"), **change))
    assert words in str(caught.value)


def test_a_rest_that_cannot_be_is_refused():
    robot, whole = MACHINES["five-bar"], cycle("five-bar")
    with pytest.raises(pteron.DataError, match=r"dwell: -1\.0 given"):
        size(robot, whole, dwell=-1.0)
    parts = (whole.time, whole.pose, whole.velocity, whole.acceleration)
    cut = Motion(*(part[:50] for part in parts))
    with pytest.raises(pteron.DataError, match="does not end at rest"):
        size(robot, cut, dwell=0.1)
    with pytest.raises(pteron.DataError, match=r"wrench: shape \(3,\) given, \(2,\) expected"):
        size(robot, whole, wrench=np.zeros(3))


def test_a_pose_out_of_reach_has_the_index_of_the_motions_sample():
    whole = cycle("five-bar")
    pose = whole.pose.copy()
    pose[7] = 9.0
    with pytest.raises(pteron.UnreachablePose) as caught:
        size(MACHINES["five-bar"], replace(whole, pose=pose))
    assert caught.value.index == (7,)


HEADER = "name,rotor_inertia,rated_torque,peak_torque,max_speed\n"


def write(folder: Path, name, text):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_motors_are_read_from_csv_and_toml_alike(tmp_path):
    table = write(
        tmp_path, "motors.csv", HEADER + "100 W,4e-6,0.32,0.95,600\nB,3e-5,1.27,3.8,500\n"
    )
    keys = HEADER.strip().split(",")
    lines = "".join(
        "[[motors]]\n" + "".join(f"{k} = {v}\n" for k, v in zip(keys, row, strict=True))
        for row in (('"100 W"', 4e-6, 0.32, 0.95, 600), ('"B"', 3e-5, 1.27, 3.8, 500))
    )
    found = read_motors(table)
    assert found == read_motors(write(tmp_path, "motors.toml", lines))
    assert found[0] == Motor("100 W", 4e-6, 0.32, 0.95, 600.0)
    assert found[0].warnings == ()
    nameless = HEADER.removeprefix("name,") + "4e-6,0.32,0.95,6000\n"
    with pytest.warns(pteron.UnlikelyValue, match="^motor 1: max_speed .* revolutions per minute"):
        assert read_motors(write(tmp_path, "nameless.csv", nameless))[0].name == "1"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is empty"),
        (HEADER, "has no rows"),
        (HEADER.replace(",max_speed", "") + "A,1,2,3\n", "no column max_speed"),
        (HEADER + "A,-1e-6,0.3,0.9,600\n", "motor A: rotor_inertia: -1e-06 given, 0 or more"),
        (HEADER + "A,1e-6,0.3,0.1,600\n", "peak_torque: 0.1 N m given, at least rated_torque"),
        (HEADER + "A,1e-6,abc,0.1,600\n", "column rated_torque: 'abc' given"),
        (HEADER + "A,1e-6,0,1,0\n", "2 faults"),
        (HEADER + "A,1e-6,0.3,0.9,600\nA,1e-6,0.3,0.9,600\n", "motor A is listed twice"),
    ],
)
def test_a_list_of_motors_with_a_mistake_is_refused(tmp_path, text, words):
    with pytest.raises(pteron.DataError) as caught:
        read_motors(write(tmp_path, "motors.csv", text))
    assert words in str(caught.value)
    assert "motors.csv" in str(caught.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "motors: missing"),
        ("motors = []", "lists no motor"),
        ('[[motors]]\nname = "A"\npower = 3.0\n', "unknown key"),
        ("motors = 3", "3 given, a list"),
    ],
)
def test_a_toml_list_with_a_mistake_is_refused(tmp_path, text, words):
    with pytest.raises(pteron.DataError) as caught:
        read_motors(write(tmp_path, "motors.toml", text))
    assert words in str(caught.value)
    assert "motors.toml" in str(caught.value)


def test_other_units_are_doubted():
    assert "revolutions per minute" in Motor("A", 4e-6, 0.32, 0.95, 6000.0).warnings[0]
    assert "kg cm^2" in Motor("A", 0.04, 0.32, 0.95, 600.0).warnings[0]
    assert Span(2.0, 1.0).intersect(Span(0.0, 3.0)) == Span(2.0, 1.0)
    assert not Span(2.0, 1.0)
