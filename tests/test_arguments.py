"""Arguments of public functions: of another kind, or too large, they are refused in one line."""

import inspect
import pickle

import numpy as np
import pytest

import pteron
from pteron import identification, indices, maps, motion, workspace
from pteron.kernels import bounded_function, bounds


class Odd:
    """Nothing that a function asks for."""

    def __repr__(self):
        return "<odd>"


def public_functions():
    spaces = [pteron, *(getattr(pteron, name) for name in dir(pteron))]
    spaces = [space for space in spaces if inspect.ismodule(space)]
    public = (getattr(space, name) for space in spaces for name in space.__all__)
    return sorted({*filter(inspect.isfunction, public), bounded_function, bounds}, key=called)


def called(function):
    return f"{function.__module__}.{function.__name__}"


def arguments(function):
    """Return positional and keyword arguments by name, all those that may be given."""
    given = inspect.signature(function).parameters.values()
    alone = [p.name for p in given if p.kind is p.POSITIONAL_OR_KEYWORD]
    return alone, [p.name for p in given if p.kind is p.KEYWORD_ONLY]


def test_there_are_functions_to_be_tried():
    assert len(public_functions()) > 150
    assert pteron.load in public_functions()


@pytest.mark.parametrize("function", public_functions(), ids=called)
def test_arguments_of_no_kind_are_refused_in_one_line(function):
    alone, named = arguments(function)
    if not alone and not named:
        return
    with pytest.raises(pteron.PteronError) as caught:
        function(*[Odd() for _ in alone], **{name: Odd() for name in named})
    assert "\n" not in str(caught.value)


GOOD = {
    **{name: [0.01, 0.25] for name in ("pose", "velocity", "acceleration", "forces", "start")},
    "robot": "five-bar",
    "joints": [0.2, 0.1],
    "wrench": [0.0, 0.0],
    "reference": [0.01, 0.25],
}
KINDS = [None, Odd(), "nonsense", [Odd()], {"a": 1.0}, b"x", True, [True, False], 10**400, 3.5]


@pytest.mark.parametrize("function", public_functions(), ids=called)
def test_each_argument_alone_is_refused_in_one_line(function):
    """Of functions that check machines and arrays where they convert them."""
    alone, named = arguments(function)
    if hasattr(function, "__wrapped__") or not set(alone) <= GOOD.keys():
        return
    required = [
        name
        for name in alone
        if inspect.signature(function).parameters[name].default is inspect.Parameter.empty
    ]
    for name in (*alone, *named):
        for wrong in KINDS:
            given = {key: GOOD[key] for key in required} | {name: wrong}
            hint = inspect.signature(function).parameters[name].annotation
            if wrong is None or hint == "bool":  # may be left out; is true or not, as in Python
                continue
            with pytest.raises(pteron.PteronError) as caught:
                function(**given)
            assert "\n" not in str(caught.value)


def test_all_that_is_wrong_is_told_at_once():
    with pytest.raises(pteron.DataError) as caught:
        pteron.random_poses("delta", 2.5, seed="a")
    assert str(caught.value) == (
        "count: 2.5 given, a whole number expected; "
        "seed: 'a' given, a whole number of 0 or more or a Generator expected"
    )


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: motion.with_payload("delta", "1"), "mass: '1' given, a number expected"),
        (lambda: motion.with_payload("delta", True), "mass: True given, a number expected"),
        (lambda: pteron.save("delta", 3), "path: 3 given, a text or a path expected"),
        (
            lambda: identification.identify("delta", Odd()),
            "logs: <odd> given, a Log, a LogFile or a sequence .each a Log or a LogFile. exp",
        ),
        (
            lambda: pteron.random_poses("delta", 1, seed=-7),
            "seed: -7 given, a whole number of 0 or",
        ),
        (
            lambda: maps.map_index("five-bar", "condition", maps.pose_grid("five-bar"), workers=0),
            "workers: 0 given, a whole number from 1 to 1024 expected",
        ),
        (
            lambda: pteron.inverse_kinematics("five-bar", [True, False]),
            "pose: not an array of real numbers",
        ),
        (
            lambda: pteron.compile("delta", ["inverse_dynamics"]),
            "what: \\['inverse_dynamics'\\] giv",
        ),
    ],
)
def test_a_wrong_kind_is_told_in_words(call, message):
    with pytest.raises(pteron.PteronError, match=f"^{message}"):
        call()


def test_numbers_of_other_libraries_are_numbers():
    few = pteron.random_poses("delta", np.int64(3), type_i=np.float32(0.1), type_ii=np.array(0.1))
    assert few.shape == (3, 3)
    assert pteron.random_poses("delta", 2, seed=np.random.default_rng(0)).shape == (2, 3)
    assert motion.with_payload("delta", np.float32(0.5)).platform.inertia.mass > 0.5
    assert workspace.reach_slice("five-bar", [0.0, 0.25], extent=[-0.1, 0.1, 0.2, 0.3], points=3)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: pteron.Manipulator("m", 4, [1]), "platform: 4 given, a Platform expected; legs: "),
        (lambda: identification.Terms(stribeck="slow"), "stribeck: 'slow' given, a number, a seq"),
        (lambda: motion.MotionLimits(speed=Odd()), "speed: <odd> given, an array expected"),
        (lambda: indices.Tolerances(Odd()), "joints: <odd> given"),
        (lambda: maps.Grid("xy", [], "xy"), "coordinates: 'xy' given, a sequence"),
    ],
)
def test_what_a_user_makes_is_made_of_the_right_kinds(make, message):
    with pytest.raises(pteron.DataError, match=f"^{message}"):
        make()


FAR = 10**12
TOO_MANY = {
    "random_poses": lambda: pteron.random_poses("delta", FAR),
    "reach_slice": lambda: workspace.reach_slice("five-bar", [0.0, 0.25], points=FAR),
    "reach_volume": lambda: workspace.reach_volume("five-bar", [0.0, 0.25], count=FAR),
    "quadrature_volume": lambda: workspace.quadrature_volume("delta", [0, 0, -0.9], lines=FAR),
    "global_conditioning": lambda: indices.global_conditioning("delta", [0, 0, -0.9], count=FAR),
    "pick_and_place": lambda: motion.pick_and_place("delta", samples=FAR),
    "map_index": lambda: maps.map_index(
        "five-bar", "condition", maps.pose_grid("five-bar", points=10**6)
    ),
    "random_excitation": lambda: identification.random_excitation("delta", harmonics=FAR),
    "repeat": lambda: motion.pick_and_place("delta", scale=0.5).repeat(FAR),
}


@pytest.mark.parametrize("name", TOO_MANY)
def test_sizes_that_cannot_fit_are_refused_before_memory_is_taken(name):
    with pytest.raises(
        pteron.DataError, match=r"given, which takes .* GB of memory; this computer"
    ):
        TOO_MANY[name]()


def test_what_checks_is_the_function_still():
    function = pteron.random_poses
    assert pickle.loads(pickle.dumps(function)) is function
    assert list(inspect.signature(function).parameters)[:2] == ["robot", "count"]
    assert function.__doc__.startswith("Return poses drawn at random")
    assert inspect.getmodule(function).__dict__ is function.__globals__  # doctests find it
