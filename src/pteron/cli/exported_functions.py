"""The names of the functions that can be exported to a controller.

They are written out, since help and completion are shown before CasADi is loaded; a test holds them
against those of the library.
"""

_NAMES = """\
adaptive adaptive_drives any_branch_step bias_forces clearances closure_errors closure_poses
closure_rows computed_torque computed_torque_base constraint coriolis_matrix direct_kinematics
direct_step discriminants drive_accelerations drive_forces drive_forces_base feed_forward
feed_forward_base feed_forward_pd feed_forward_pd_base followed_step forward_dynamics
gravity_forces inverse_dynamics inverse_dynamics_base inverse_kinematics jacobian
joint_accelerations joint_coordinates joint_feed_forward joint_feed_forward_base joint_points
joint_rates joint_screws kinetic_energy least_clearances link_jacobians link_vectors
load_regressor mass_matrix motion_at_point newton_step paper_regressor paper_terms
passive_friction passive_room pd_gravity pd_gravity_base platform_motion platform_points
potential_energy radicands reach regressor room set_payload set_payload_base squared_type_i twist
twist_jacobian type_ii type_ii_distances velocity_of_twist
"""

FUNCTIONS = tuple(_NAMES.split())
"""Names that `--function` takes."""
