"""Logs that printers' firmware writes."""

from __future__ import annotations

CFG = """[printer]
kinematics: delta
delta_radius: 141.553523
[stepper_a]
microsteps: 16
rotation_distance: 32
arm_length: 280.0
position_endstop: 372.971746
[stepper_b]
microsteps: 16
rotation_distance: 64
gear_ratio: 80:40
position_endstop: 373.433577
[stepper_c]
step_distance: 0.01
position_endstop: 373.62993
#*# <---------------------- SAVE_CONFIG ---------------------->
#*# DO NOT EDIT THIS BLOCK OR BELOW. The contents are auto-generated.
#*#
#*# [delta_calibrate]
#*# height0 = 17.197
#*# height0_pos = 35612.667,35612.667,35612.667
#*# height1 = 17.197
#*# height1_pos = 41651.333,41651.333,32050.333
#*# manual_height0 = 0.3
#*# manual_height0_pos = 37302.0,37302.0,37302.0
#*# distance0 = 60.5
#*# distance0_pos1 = 35612.667,35612.667,35612.667
#*# distance0_pos2 = 41651.333,41651.333,32050.333
#*#
#*# [stepper_a]
#*# angle = 210.181908
#*#
#*# [stepper_b]
#*# angle = 329.784204
"""
