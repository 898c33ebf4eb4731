"""Logs of measurements as tables and controllers write them; what is wrong or unlikely in them."""

import warnings

import numpy as np
import polars as pl
import pytest
from firmware_logs import CFG

import pteron
from pteron.calibration import Place, ReferencePlane, read_measurements
from pteron.errors import DataError, UnlikelyValue
from pteron.export import from_klipper
from pteron.kinematics import random_poses

DELTA = "linear-delta"


def written(folder, text, toml="", name="bed.csv"):
    path = folder / name
    path.write_text(text)
    if toml:
        path.with_suffix(".toml").write_text(toml)
    return path


TABLE = """t (ms);rho1 [mm];rho2 [mm];rho3 [mm];x;y;z;height_mm;distance;from;anchor;mark;plane
0;210,5;220;230;;;;0,02;;;;;
20;211;221;231;0,01;;-0,02;;;;;corner;
40;212;222;232;;;;0,5;;;;corner;bed
60;213;223;233;;;;;0,15;2;;;
80;214;224;234;;;;;0,25;;post;corner;
"""
TOML = """[measured]
noise = { height = 2e-5, readings = 1e-6 }
[marks.corner]
at = [0.02, 0.0, 0.0]
[planes.bed]
known = false
offset = -0.001
[anchors.post]
free = true
[instrument]
frame = "unknown"
"""


def test_every_column_of_a_table_and_of_its_description_is_read(tmp_path):
    found = read_measurements(DELTA, written(tmp_path, TABLE, TOML))
    np.testing.assert_allclose(found.readings[1], [0.211, 0.221, 0.231])
    np.testing.assert_allclose(found.times, [0.0, 0.02, 0.04, 0.06, 0.08])
    np.testing.assert_allclose(found.heights, [2e-5, np.nan, 5e-4, np.nan, np.nan])
    np.testing.assert_allclose(found.positions[1], [0.01, np.nan, -0.02])
    np.testing.assert_allclose(found.distances[3:], [0.15, 0.25])
    assert found.origins.tolist() == [-1, -1, -1, 1, -1]
    assert found.marks == ("", "corner", "corner", "", "corner")
    assert (found.planes[2], found.anchors[4]) == ("bed", "post")
    assert found.places[4] == "bed.csv, line 6"
    setup = found.setup
    assert setup.noise == {"height": 2e-5, "readings": 1e-6}
    assert setup.marks == {"corner": Place((0.02, 0.0, 0.0))}
    assert setup.planes == {"bed": ReferencePlane(offset=-0.001, known=False)}
    assert setup.anchors == {"post": Place(known=False)}
    assert not setup.frame_known


def test_logs_follow_each_other_and_parquet_is_as_csv(tmp_path):
    first = written(tmp_path, TABLE, TOML)
    alone = read_measurements(DELTA, first)
    columns = dict(zip(("rho1", "rho2", "rho3"), alone.readings.T, strict=True))
    columns |= {"distance": alone.distances, "from": [None, None, None, 2, None]}
    columns |= {"mark": alone.marks, "anchor": alone.anchors, "theta": alone.heights}
    second = tmp_path / "second.parquet"
    pl.DataFrame(columns).rename({"theta": "height"}).write_parquet(second)
    second.with_suffix(".toml").write_text(TOML)
    both = read_measurements(DELTA, first, second)
    assert both.origins.tolist() == [-1, -1, -1, 1, -1, -1, -1, -1, 6, -1]
    np.testing.assert_array_equal(both.readings[5:], alone.readings)
    np.testing.assert_array_equal(both.heights[5:], alone.heights)
    assert both.marks == 2 * alone.marks
    second.with_suffix(".toml").write_text(TOML.replace("0.02, 0.0, 0.0", "0.03, 0.0, 0.0"))
    with pytest.raises(DataError, match=r"second.parquet: marks.corner: another than"):
        read_measurements(DELTA, first, second)


def test_all_faults_of_a_log_are_told_with_their_lines(tmp_path):
    text = "rho1,rho2,rho3,height,distance,from,anchor\n"
    text += "0.2,,0.2,a,,,\n0.2,0.2,x,0,0.1,,\n0.2,0.2,0.2,b,0.1,9,\n0.2,0.2,0.2,0,,1,\n"
    with pytest.raises(DataError) as error:
        read_measurements(DELTA, written(tmp_path, text))
    told = str(error.value)
    for words in (
        "line 2), column rho2: no number",
        "line 3), column rho3: 'x' given",
        "line 2), column height: 'a' given",
        "line 4), column height: 'b' given",
        "line 3): a distance with neither from and anchor",
        "line 4), column from: 9 given, another row from 1 to 4",
        "line 5): from or anchor, but no distance",
    ):
        assert words in told
    with pytest.raises(DataError, match=r"no column rho3 .found: rho1, rho2, z"):
        read_measurements(DELTA, written(tmp_path, "rho1,rho2,z\n0.2,0.2,0\n"))
    toml = "[measured]\nnoise = -1\n[marks.a]\n[planes.b]\nnormal = [0, 0, 2]\nslope = 1\n"
    with pytest.raises(DataError) as error:
        read_measurements(DELTA, written(tmp_path, TABLE, toml))
    for words in ("noise", "marks.a: neither at nor free", "planes.b.normal", "planes.b.slope"):
        assert words in str(error.value)


def test_what_a_row_names_must_be_described(tmp_path):
    with pytest.raises(DataError, match=r"3 faults") as error:
        read_measurements(DELTA, written(tmp_path, TABLE))
    assert "line 3: mark 'corner' is not described; give [marks.corner]" in str(error.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("rho1,rho2,rho3,height\n210,220,230,0\n", "are these mm"),
        ("rho1,rho2,rho3,height\n2.1,0.2,0.2,0\n", "rho1 = 2.1 is far beyond its limits"),
        ("rho1,rho2,rho3,height\n0.2,0.2,0.2,5\n", "height 5 is more than the machine's size"),
        ("rho1,rho2,rho3,distance,from\n.2,.2,.2,,\n.2,.2,.3,0,1\n", "a distance of 0"),
        ("rho1,rho2,rho3,hieght\n.2,.2,.2,0\n", "hieght: not read"),
        ("rho1,rho2,rho3,height\n.2,.2,.2,\n.2,.2,.2,0\n", "line 2: nothing is measured there"),
    ],
)
def test_what_is_unlikely_is_doubted(tmp_path, text, words):
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        read_measurements(DELTA, written(tmp_path, text))
    assert any(words in str(one.message) for one in told)
    assert {one.category for one in told} == {UnlikelyValue}


def test_klippers_stable_positions_are_readings(tmp_path):
    robot = from_klipper(CFG)
    found = read_measurements(robot, written(tmp_path, CFG, name="printer.cfg"))
    np.testing.assert_allclose(found.heights[:3], [0.017197, 0.017197, 0.0003])
    poses = pteron.direct_kinematics(robot, found.readings)[:, 0]
    # As Klipper itself finds them with what it saved: the first two of the FLSUN printer's heights.
    np.testing.assert_allclose(1e3 * poses[:2, 2], [17.220, 17.252], atol=6e-4)
    assert found.origins.tolist() == [-1, -1, -1, -1, 3]
    assert found.distances[4] == pytest.approx(0.0605)
    assert found.places[1] == "printer.cfg, height1_pos"
    bad = CFG.replace("41651.333,41651.333,32050.333\n#*# manual", "3,4\n#*# manual")
    with pytest.raises(DataError, match=r"height1_pos: '3,4' given"):
        read_measurements(robot, written(tmp_path, bad, name="printer.cfg"))


MAP = """RepRapFirmware height map file v2 generated at 2026-01-01 10:00, mean error 0.05
xmin,xmax,ymin,ymax,radius,xspacing,yspacing,xnum,ynum
-50.00,50.00,-40.00,40.00,-1.00,50.00,80.00,3,2
      0,  0.100, -0.050
  0.020,  0.000,  0.300
"""
TOUCHED = [(0.0, -40.0, 0.1), (50.0, -40.0, -0.05), (-50.0, 40.0, 0.02), (0.0, 40.0, 0.0)]
LOGS = {
    "heightmap.csv": (MAP, [*TOUCHED, (50.0, 40.0, 0.3)]),
    "new.csv": (
        MAP.replace(
            "xmin,xmax,ymin,ymax,radius,xspacing,yspacing,xnum,ynum\n",
            "axis0,axis1,min0,max0,min1,max1,radius,spacing0,spacing1,num0,num1\n",
        ).replace("\n-50", "\nX,Y,-50"),
        [*TOUCHED, (50.0, 40.0, 0.3)],
    ),
    "first.csv": (
        MAP.replace("v2", "v1")
        .replace("xspacing,yspacing", "spacing")
        .replace("50.00,80.00,3,2", "80.00,3,2")
        .replace("-50.00,50.00,", "-80.00,80.00,"),
        [(x * 1.6, y, z) for x, y, z in (*TOUCHED, (50.0, 40.0, 0.3))],
    ),
    "console.txt": (
        "G30 P0 X0 Y-40 Z-99999\nG30 P1 X50 Y-40 Z-99999\nG30 P2 X-50 Y40 Z-99999 S-1\n"
        "G32 bed probe heights: 0.100 -0.050 0.020, mean 0.023, deviation from mean 0.061\n",
        TOUCHED[:3],
    ),
    "klippy.log": (
        "[probe]\nz_offset = 0.0\nprobe at 0.000,-40.000 is z=0.100000\n"
        "// probe: at 50.000,-40.000 bed will contact at z=-0.050000\n",
        TOUCHED[:2],
    ),
    "octoprint.log": ("Recv: Bed X: 0.000 Y: -40.000 Z: 0.100\n", TOUCHED[:1]),
    "probe.txt": (
        "0.0 -40.0 0.1 0 0 0 0 0 0\n50.0 -40.0 -0.05 0 0 0 0 0 0\n",
        TOUCHED[:2],
    ),
}


@pytest.mark.parametrize("name", LOGS)
def test_controllers_logs_are_found_by_their_contents(tmp_path, name):
    text, touched = LOGS[name]
    found = read_measurements(DELTA, written(tmp_path, text, name=name))
    poses = 1e-3 * np.array(touched)
    np.testing.assert_allclose(found.readings, pteron.inverse_kinematics(DELTA, poses), atol=1e-12)
    np.testing.assert_array_equal(found.heights, 0.0)


def test_a_linuxcnc_of_a_hexapod_has_angles_and_its_tool(tmp_path):
    robot = pteron.load("stewart")
    pose = random_poses(robot, 1, seed=1)[0]
    place, turn = robot.platform.placement(pose)
    tool = 1e3 * (place + np.array(robot.platform.tool) @ turn)
    line = " ".join(f"{v:.9f}" for v in (*tool, *np.degrees(pose[3:]), 0.0, 0.0, 0.0))
    found = read_measurements(robot, written(tmp_path, line + "\n", name="probe.log"))
    np.testing.assert_allclose(found.readings[0], pteron.inverse_kinematics(robot, pose), atol=1e-9)


def test_a_log_of_nothing_known_is_refused_and_places_out_of_reach_are_told(tmp_path):
    with pytest.raises(DataError, match="neither a table"):
        read_measurements(DELTA, written(tmp_path, "hello\n", name="notes.txt"))
    text = "probe at 0.000,900.000 is z=0.100000\n"
    with pytest.raises(DataError, match="line 1: the machine as drawn does not reach X0 Y900"):
        read_measurements(DELTA, written(tmp_path, text, name="klippy.log"))


G33 = """Send: G33 {}
Recv: G33 Auto Calibrate
Recv: .Height:303.60    Ex:-6.34  Ey:-5.20  Ez:+0.00    Radius:110.05
Recv: . c:+0.57    x:+0.52  y:+0.47  z:+0.55
Recv: .          yz:+0.45 zx:+0.49 xy:+0.50
Recv: Calibration OK                                    std dev:0.510
"""


def test_marlins_g33_is_read_with_its_radius_and_asks_for_it(tmp_path):
    path = written(tmp_path, G33.format("P3 V2"), name="marlin.log")
    with pytest.raises(DataError, match=r"on which radius it probes; give \[g33\] radius"):
        read_measurements(DELTA, path)
    (tmp_path / "marlin.toml").write_text("[g33]\nradius = 0.05\n")
    found = read_measurements(DELTA, path)
    poses = 1e3 * pteron.direct_kinematics(DELTA, found.readings)[:, 0]
    angles = np.radians([210.0, 330.0, 90.0, 30.0, 150.0, 270.0])
    rim = 50.0 * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    np.testing.assert_allclose(poses[:, :2], [(0.0, 0.0), *rim], atol=1e-9)
    np.testing.assert_allclose(poses[:, 2], [0.57, 0.52, 0.47, 0.55, 0.45, 0.49, 0.5], atol=1e-9)
    assert found.places[1] == "marlin.log, line 4, x"
    path.write_text(G33.format("P4 V2"))
    with pytest.warns(UnlikelyValue, match="means of neighbouring points"):
        read_measurements(DELTA, path)
    path.write_text("Recv: .Height:303.60\nRecv: . c:+0.57\n")
    with pytest.raises(DataError, match="P1 probes the middle alone"):
        read_measurements(DELTA, path)


def test_a_place_that_the_drawn_machine_does_not_reach_is_left_out_and_named(tmp_path):
    text = "probe at 0.000,900.000 is z=0.1\n" + "probe at 1.0,2.0 is z=0.1\n" * 3
    with pytest.warns(UnlikelyValue, match="line 1: the machine as drawn does not reach X0 Y900"):
        found = read_measurements(DELTA, written(tmp_path, text, name="klippy.log"))
    assert len(found) == 3
