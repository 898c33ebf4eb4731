"""Structured Text against CasADi, on a strict controller; syntax as blark reads it."""

import math
import re
from functools import cache
from itertools import product

import numpy as np
import pytest
from exported_code import ROBOTS, identification_file, stiff
from mechanisms import CATALOG, CLIENTS, LARGE, gated, several, states
from structured_text import Block, Runner, Trap, as_elements, parse, read, text_of

import pteron
from pteron.equations.drives import drive_numbers
from pteron.export.structured_text import function_block
from pteron.kernels import Port, program
from pteron.kernels.graph import Graph, Node, graph_of
from pteron.kinematics import assembly_modes
from pteron.motion import with_payload

FUNCTIONS = (
    "inverse_kinematics",
    "inverse_dynamics",
    "closure_poses",
    "direct_step",
    "jacobian",
    "forward_dynamics",
    "feed_forward",
    "joint_feed_forward",
)

BLOCKS = sorted(set(product(ROBOTS, FUNCTIONS)) - {("par4", "closure_poses")})
"""All but what has no closed form."""

SOME_BLOCKS = [
    (machine, what)
    for i, machine in enumerate(ROBOTS)
    for j, what in enumerate(FUNCTIONS)
    if (i + j) % 5 == 0
]
"""Each function on a machine."""


def each(blocks):
    """Parametrize over blocks; not all are in the gate."""
    return pytest.mark.parametrize(("machine", "what"), several(blocks, SOME_BLOCKS))


each_block = each(BLOCKS)

SHORT = (
    ("quadrupteron", "inverse_kinematics"),
    ("quadrupteron", "closure_poses"),
    ("oblique", "jacobian"),
    ("delta", "inverse_kinematics"),
)
"""One of every kind of statement; blark takes 10 ms a line."""


def inputs_of(robot, given, count, seed=0):
    """Return random inputs at which a program has a result."""
    poses, velocities, accelerations = states(robot, count, seed)
    rng = np.random.default_rng(seed)
    drawn = []
    for pose, velocity, acceleration in zip(poses, velocities, accelerations, strict=True):
        known = {
            "pose": pose,
            "velocity": velocity,
            "acceleration": acceleration,
            "joints": pteron.inverse_kinematics(robot, pose),
            "forces": rng.normal(size=len(robot.legs)),
            "parameters": pteron.parameters(robot),
            "drives": drive_numbers(robot),
            "joint_rates": velocity,
            "joint_accelerations": acceleration,
        }
        drawn.append([known[port.name] for port in given.inputs])
    return drawn


@cache
def runner(machine, what):
    return Runner(program(ROBOTS[machine], what))


@CLIENTS
@pytest.mark.parametrize(("machine", "what"), SHORT)
def test_blark_reads_blocks_and_sees_the_tree_that_is_run(machine, what):
    text = runner(machine, what).text
    assert parse(text) == read(text)


LANGUAGE = """
(* Precedence, (* not nested; comments, one over
   two lines. *)
FUNCTION_BLOCK FB_Language
VAR_INPUT
    a, b : LREAL;
    m : ARRAY[0..1, 0..2] OF LREAL; (* a matrix *)
END_VAR
VAR_OUTPUT
    sums : ARRAY[0..5] OF LREAL;
    Truth : BOOL;
    Count : UDINT;
END_VAR
VAR
    p, q : BOOL;
END_VAR
sums[0] := a - b - 2.5E-1;
sums[1] := a + b * m[1, 2] / 4.0;
sums[2] := -a * (-b) - (a - b) * 2.0;
sums[3] := MAX(MIN(a, b), ABS(-3.5)) + SQRT(16.0) - ATAN2(0.0, 1.0) + SIN(0.0) * COS(a);
p := NOT (a < b) OR a >= 1.0 AND b <> 0.0;
q := a = b XOR TRUE;
IF p AND NOT q THEN
    sums[4] := 1.0;
ELSIF a > 100.0 OR FALSE THEN
    sums[4] := 2.0; sums[5] := 7.0;
ELSE
    sums[4] := 3.0;
    IF Q THEN
        SUMS[5] := 4.0;
    END_IF;
END_IF;
Truth := p;
Count := 1;
END_FUNCTION_BLOCK
"""


def test_language_is_read_as_blark_reads_it():
    tree = parse(LANGUAGE)
    assert tree == read(LANGUAGE)
    matrix = {(i, j): 1.0 + i + j for i in range(2) for j in range(3)}
    found = Block(tree)(a=1.0, b=3.0, m=matrix)
    expected = [-2.25, 4.0, 7.0, 7.5, 3.0, 4.0]
    assert list(found["sums"].values()) == expected
    assert found["truth"] is True
    assert found["count"] == 1


@pytest.mark.parametrize(
    "statement",
    [
        "y := SQRT(x - 2.0);",
        "y := 1.0 / (x - 1.0);",
        "y := 1.0E+200 * (x * 1.0E+200);",
        "y := ATAN2(0.0, x - 1.0);",
    ],
)
def test_controller_of_the_tests_is_strict(statement):
    text = "FUNCTION_BLOCK F VAR_INPUT x : LREAL; END_VAR VAR_OUTPUT y : LREAL; END_VAR {} {}"
    block = Block(read(text.format(statement, "END_FUNCTION_BLOCK")))
    with pytest.raises(Trap):
        block(x=1.0)
    block(x=3.0) if "200" not in statement else block(x=1e-200)


@each_block
def test_results_are_those_of_casadi(machine, what):
    run = runner(machine, what)
    for values in inputs_of(ROBOTS[machine], run.program, 3):
        found = run(values)
        assert (found.valid, found.status) == (True, 0)
        for output, expected in zip(found.outputs, run.casadi(values), strict=True):
            np.testing.assert_allclose(output, expected, rtol=0, atol=1e-13 * abs(expected).max())


@pytest.mark.parametrize("machine", gated(ROBOTS, ["oblique", "mixed", "five_bar"]))
@pytest.mark.parametrize("what", ["inverse_kinematics", "inverse_dynamics", "forward_dynamics"])
def test_out_of_reach_keeps_the_last_outputs(machine, what):
    run = runner(machine, what)
    (values,) = inputs_of(ROBOTS[machine], run.program, 1)
    last = run(values)
    for axis, far in product(range(len(ROBOTS[machine].platform.lengths)), (3.0, 1e6)):
        pose = values[0].copy()
        pose[axis] = far
        assert np.isnan(run.casadi([pose, *values[1:]])[0]).any()
        found = run([pose, *values[1:]])
        assert (found.valid, found.status) == (False, 1)
        np.testing.assert_array_equal(found.outputs[0], last.outputs[0])
    assert run(values).valid


@pytest.mark.parametrize(("machine", "apart"), [("quadrupteron", 10.0), ("mixed", [9.0, 0.0, 0.0])])
def test_joints_that_allow_no_pose_keep_the_last_poses(machine, apart):
    run = runner(machine, "closure_poses")
    (values,) = inputs_of(ROBOTS[machine], run.program, 1)
    last = run(values)
    found = run([values[0] + np.asarray(apart) * np.arange(1, values[0].size + 1)])
    assert (found.valid, found.status) == (False, 1)
    np.testing.assert_array_equal(found.outputs[0], last.outputs[0])


@each_block
def test_inputs_that_are_no_numbers_keep_the_last_outputs(machine, what):
    run = runner(machine, what)
    (values,) = inputs_of(ROBOTS[machine], run.program, 1)
    graph = graph_of(run.program.function, run.program.inputs)
    used = {node.arguments for node in graph.nodes if node.operation == "input"}
    last = run(values)
    wrong = (math.nan, math.inf, -math.inf, 1e300, -2e6)
    for i, port in enumerate(run.program.inputs):
        for j in range(port.size):
            given = [np.array(value, float) for value in values]
            given[i][j] = wrong[j % len(wrong)]
            found = run(given)
            assert (found.valid, found.status) == ((False, 3) if (i, j) in used else (True, 0))
            np.testing.assert_array_equal(found.outputs[0], last.outputs[0])


def test_a_point_on_the_axis_of_a_crank_does_not_trap():
    """The direction of the crank is 0 / 0 there, and its angle that of no vector."""
    for what in ("inverse_kinematics", "inverse_dynamics"):
        run = runner("delta", what)
        (values,) = inputs_of(ROBOTS["delta"], run.program, 1)
        assert run([[0.205, 0.9, 0.0], *values[1:]]).status in (1, 2)


def test_singular_orientations_give_status_2_or_numbers():
    robot = ROBOTS["quadrupteron"]
    runs = [runner("quadrupteron", what) for what in ("inverse_dynamics", "forward_dynamics")]
    for run, angle in product(runs, pteron.kinematics.singular_orientations(robot)):
        for values in inputs_of(robot, run.program, 3):
            found = run([[*values[0][:3], angle], *values[1:]])
            assert found.status in (0, 1, 2)
            assert np.isfinite(found.outputs[0]).all()


EXTREMES = (0.0, -0.0, 5e-324, 1e-160, -1e-20, 1e-9, 0.23, 0.28, math.pi / 2, -1.0, 1e3, -1e6, 1e6)


def sweep(run, robot, count):
    """Return what becomes of inputs some of which are extreme."""
    rng = np.random.default_rng(3)
    seen = []
    for values in inputs_of(robot, run.program, count):
        for share in (0.1, 0.5, 1.0):
            given = [
                np.where(rng.random(value.shape) < share, rng.choice(EXTREMES, value.shape), value)
                for value in values
            ]
            found = run(given)
            assert found.valid == (found.status == 0)
            assert all(np.isfinite(output).all() for output in found.outputs)
            seen.append(found.status)
    return seen


@each_block
def test_extreme_inputs_do_not_trap(machine, what):
    assert 3 not in sweep(runner(machine, what), ROBOTS[machine], 3)


def test_smallest_divisors_and_largest_factors_do_not_trap():
    """A determinant of 2 by 2, its powers and quotients: numbers leave LREAL without guards."""
    nodes = [Node("input", (0, k)) for k in range(4)]
    nodes += [Node("mul", (0, 3)), Node("mul", (1, 2)), Node("sub", (4, 5)), Node("div", (0, 6))]
    for k in range(5):
        nodes += [Node("mul", (7 + 2 * k, 7 + 2 * k)), Node("div", (8 + 2 * k, 6))]
    graph = Graph(tuple(nodes), ((len(nodes) - 1,),))
    ports = [Port("m", (2, 2))], [Port("y", ())]
    seen = set()
    block = Block(read(function_block("F", graph, *ports)))
    sizes = (0.0, 1e-10, 1e-9, 1.0, 1e6)
    for numbers in product(sizes, repeat=4):
        found = block(m=as_elements(ports[0][0], numbers))
        assert math.isfinite(found["y"])
        seen.add(found["status"])
    assert seen == {0, 2}


def test_guards_of_factors_are_needed():
    nodes = [Node("input", (0, 0))] + [Node("mul", (k, k)) for k in range(6)]
    given = Graph(tuple(nodes), ((6,),)), [Port("x", ())], [Port("y", ())]
    with pytest.raises(Trap, match="overflow"):
        Block(read(function_block("F", *given, largest=math.inf)))(x=1e6)
    block = Block(read(function_block("F", *given)))
    assert block(x=1e6)["status"] == 2
    assert block(x=2.0) == {"y": 2.0**64, "valid": True, "status": 0}


def test_an_angle_of_no_vector_is_singular():
    nodes = (Node("input", (0, 0)), Node("input", (0, 1)), Node("atan2", (0, 1)))
    ports = [Port("v", (2,))], [Port("angle", ())]
    block = Block(read(function_block("F", Graph(nodes, ((2,),)), *ports)))
    assert block(v={(0,): 3.0, (1,): 0.0})["angle"] == math.pi / 2
    assert block(v={(0,): 0.0, (1,): 0.0})["status"] == 2


@CLIENTS
def test_a_machine_with_drives_has_its_feed_forward_too(tmp_path):
    for name, more in (
        ("par4", ["Par4_FeedForward.st", "Par4_JointFeedForward.st"]),
        ("delta", []),
    ):
        files = pteron.export_st(ROBOTS[name], folder=tmp_path)
        assert [path.name for path in files[2:]] == more


def test_exported_blocks_are_those_of_the_library(tmp_path):
    """Both closed-form poses of a Delta, its forces with the parameters folded in, a wrench."""
    robot = ROBOTS["delta"]
    names = ["direct_kinematics", "inverse_dynamics", "inverse_kinematics"]
    files = pteron.export_st(robot, names, tmp_path, wrench=True)
    assert [path.name for path in files] == [
        "Delta_ClosurePoses.st",
        "Delta_InverseDynamics.st",
        "Delta_InverseKinematics.st",
    ]
    poses, forces, joints = (Block(read(path.read_text())) for path in files)
    assert {"leg1_n2", "leg2_l_l_x"} <= set(forces.names("VAR"))
    assert "joint coordinates leg by leg, rad" in files[0].read_text()
    assert "It calls ATAN2(y, x)" in files[2].read_text()
    push = np.array([1.0, -2.0, 30.0])
    for pose, velocity, acceleration in zip(*states(robot, 3), strict=True):
        motion = {"pose": pose, "velocity": velocity, "acceleration": acceleration}
        given = {name: dict(enumerate_places(value)) for name, value in motion.items()}
        loaded = forces(**given, wrench=dict(enumerate_places(push)))["forces"]
        expected = pteron.inverse_dynamics(robot, *motion.values(), push)
        np.testing.assert_allclose(list(loaded.values()), expected, rtol=1e-12)
        angles = joints(pose=given["pose"])["joints"]
        found = np.reshape(list(poses(joints=angles)["poses"].values()), (2, 3))
        expected = assembly_modes(robot, np.array(list(angles.values())), all_branches=True)
        np.testing.assert_allclose(found, expected, atol=1e-13)
        assert min(np.linalg.norm(found - pose, axis=-1)) < 1e-13


def test_blocks_take_identified_values_and_tell_drives_per_cent(tmp_path):
    robot = stiff(CATALOG["five-bar"], rated_torque=0.5)
    base = pteron.base_parameters(robot)
    values = base.values() * 1.1
    path = identification_file(tmp_path / "i.json", base, values, [(1.0, 0.2, 0.3)] * 2)
    files = pteron.export_st(robot, folder=tmp_path, base=path, output="percent")
    assert [file.name for file in files] == [
        "FiveBar_InverseKinematics.st",
        "FiveBar_FeedForwardBase.st",
        "FiveBar_JointFeedForwardBase.st",
    ]
    assert "per cent of the motors' rated torques, 0.5 N m" in files[1].read_text()
    block = Block(read(files[1].read_text()))
    for motion in zip(*states(robot, 3), strict=True):
        names = ("pose", "velocity", "acceleration")
        given = {name: dict(enumerate_places(v)) for name, v in zip(names, motion, strict=True)}
        rates = pteron.kinematics.joint_rates(robot, *motion[:2]).actuated
        forces = pteron.base_regressor(robot, base, *motion) @ values
        forces += np.tanh(rates / 1e-3) + 0.2 * rates + 0.3
        expected = 100.0 * forces / (0.5 * np.array([leg.drive.ratio for leg in robot.legs]))
        found = block(**given)["percent_of_rated"]
        np.testing.assert_allclose(list(found.values()), expected, rtol=1e-11)


def enumerate_places(values):
    return (((k,), float(value)) for k, value in enumerate(values))


@pytest.mark.parametrize("name", gated(["par4", "3-rrr", "stewart"], ["par4"], CLIENTS))
def test_a_payload_is_set_while_the_blocks_run(tmp_path, name):
    robot = pteron.load(name)
    files = pteron.export_st(robot, ["set_payload", "inverse_dynamics"], tmp_path)
    load, forces = (Block(read(file.read_text())) for file in files)

    def array(values):
        return {(i,): float(value) for i, value in enumerate(values)}

    center, inertia = (0.03, -0.02, 0.0), (2e-3,)
    if robot.platform.tilts:
        inertia = (2e-3, 1e-4, -2e-4, 3e-3, 1e-4, 4e-3)
    loaded = load(mass=array([0.7]), center=array(center), inertia=array(inertia))
    state = [part[0] for part in states(robot, 1)]
    given = dict(zip(("pose", "velocity", "acceleration"), map(array, state), strict=True))
    found = forces(**given, parameters=loaded["loaded_parameters"])
    carrying = with_payload(robot, 0.7, center, inertia)
    expected = pteron.inverse_dynamics(carrying, *state)
    atol = 1e-12 * np.abs(expected).max()
    np.testing.assert_allclose(list(found["forces"].values()), expected, rtol=0, atol=atol)


@pytest.mark.parametrize("specialised", [None, False])
def test_beside_a_payload_only_what_it_changes_is_an_input(tmp_path, specialised):
    robot = stiff(CATALOG["five-bar"])
    names = ["set_payload", "feed_forward", "computed_torque", "inverse_dynamics"]
    files = pteron.export_st(robot, names, tmp_path, specialised=specialised)
    texts = [file.read_text() for file in files]
    assert len(texts) == len(names)
    for text in texts:
        assert "table" not in text
        declared = re.findall(r"^ +(\w+) : ARRAY", text.partition("END_VAR")[0], re.MULTILINE)
        assert not {"gains", "drives"} & set(declared), declared
    assert all("SetPayload" in text or "set_payload returns them" in text for text in texts)


def test_text_can_be_read():
    robot = ROBOTS["quadrupteron"]
    given = program(robot, "inverse_dynamics")
    graph = graph_of(given.function, given.inputs)
    first, second, third = graph.operations()[:3]
    text = text_of(
        given,
        comments=["Quadrupteron; SI units.", "Ends *) nothing, opens (* nothing. " + "word " * 50],
        descriptions={"pose": "x, y, z in m, phi in rad"},
        labels={first: "leg1_u_x", second: "LEG1_U_X", third: "pose"},
    )
    lines = text.splitlines()
    assert max(map(len, lines)) <= 100
    assert text.isascii()
    assert "    pose : ARRAY[0..3] OF LREAL; (* x, y, z in m, phi in rad *)" in lines
    names = Block(read(text)).names("VAR")
    assert {"leg1_u_x", "leg1_u_x_2", "pose_2", "t", "t_2"} <= set(names)


@CLIENTS
@pytest.mark.parametrize("left_out", gated([(), LARGE], [LARGE]), ids=len)
def test_every_function_can_be_a_block(tmp_path, left_out):
    """What a machine has not, such as a rod's angle, is left alone."""
    names = [what for what in pteron.kernels.FUNCTIONS if what not in ("base_regressor", *left_out)]
    for path in pteron.export_st(ROBOTS["five_bar"], names, tmp_path):
        Block(read(path.read_text()))


def test_constants_are_literals():
    values = (5.0, -1e-5, 1e22, 1.2345678901234567e-300, 0.1)
    nodes = tuple(Node("constant", value=value) for value in values)
    graph = Graph(nodes, (tuple(range(len(values))),))
    text = function_block("F", graph, [Port("x", ())], [Port("y", (len(values),))])
    assert parse(text) == read(text)
    found = Block(read(text))(x=math.nan)
    assert tuple(found["y"].values()) == values
    assert found["valid"]
    bad = Graph((Node("constant", value=math.inf),), ((0,),))
    with pytest.raises(ValueError, match="constant is too large"):
        function_block("F", bad, [Port("x", ())], [Port("y", ())])


def test_selections_are_numbers_or_failures():
    nodes = (
        Node("input", (0, 0)),
        Node("constant", value=2.0),
        Node("less", (0, 1)),
        Node("select", (2, 0)),
        Node("constant", value=math.nan),
        Node("input", (0, 1)),
        Node("less", (5, 1)),
        Node("select", (6, 4)),
        Node("add", (3, 7)),
    )
    ports = [Port("x", (2,))], [Port("y", ())]
    block = Block(read(function_block("F", Graph(nodes, ((8,),)), *ports)))
    assert block(x={(0,): 1.5, (1,): 2.0}) == {"y": 1.5, "valid": True, "status": 0}
    assert block(x={(0,): 3.0, (1,): 9.0}) == {"y": 0.0, "valid": True, "status": 0}
    assert block(x={(0,): 1.0, (1,): 1.0}) == {"y": 0.0, "valid": False, "status": 1}
    for wrong in (Node("mul", (0, 4)), Node("neg", (2,)), Node("less", (0, 1))):
        with pytest.raises(ValueError, match="in a selection"):
            function_block("F", Graph((*nodes, wrong), ((9,),)), *ports)
    with pytest.raises(ValueError, match="without a comparison"):
        function_block("F", Graph((*nodes, Node("select", (0, 1))), ((9,),)), *ports)
