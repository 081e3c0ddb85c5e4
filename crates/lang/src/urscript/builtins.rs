//! The routines of URScript itself.
//!
//! Source: Universal Robots, *The URScript Programming Language*, versions 3.15, 5.11 and 5.23: modules motion, internals, urmath
//! and interfaces, and the Ethernet/IP adapter. A name that is not here may change anything.

/// The effect of a routine of the controller.
#[derive(Clone, Copy, Debug)]
pub(super) enum Builtin {
    /// Changes nothing on which a motion depends, and has no value.
    Quiet,
    /// Returns a value that is known only at run time.
    Reads,
    /// Returns a value of its arguments that is not computed here.
    Computes,
    PoseTrans,
    PoseAdd,
    PoseInv,
    InverseKin,
    Degrees,
    Radians,
    Length,
    Rpy,
    /// A function of one number.
    Number(fn(f64) -> f64),
    SetTcp,
    SetPayload,
    /// Shifts positions from here on.
    Shifts,
    /// Ends the shift.
    Unshifts,
    /// May leave the arm at an unknown position.
    Stops,
}

/// The number of a routine by its name; `None` if it is not one of URScript.
pub(super) fn find(name: &[u8]) -> Option<u16> {
    let name = std::str::from_utf8(name).ok()?;
    let at = NAMES.iter().position(|(names, _)| names.split_ascii_whitespace().any(|known| known == name))?;
    u16::try_from(at).ok()
}

pub(super) fn of(number: u16) -> Builtin {
    NAMES.get(usize::from(number)).map_or(Builtin::Reads, |(_, builtin)| *builtin)
}

const NAMES: [(&str, Builtin); 25] = [
    ("pose_trans", Builtin::PoseTrans),
    ("pose_add", Builtin::PoseAdd),
    ("pose_inv", Builtin::PoseInv),
    ("get_inverse_kin", Builtin::InverseKin),
    ("r2d", Builtin::Degrees),
    ("d2r", Builtin::Radians),
    ("length get_list_length size", Builtin::Length),
    ("rpy2rotvec", Builtin::Rpy),
    ("sqrt", Builtin::Number(f64::sqrt)),
    ("sin", Builtin::Number(f64::sin)),
    ("cos", Builtin::Number(f64::cos)),
    ("tan", Builtin::Number(f64::tan)),
    ("asin", Builtin::Number(f64::asin)),
    ("acos", Builtin::Number(f64::acos)),
    ("atan", Builtin::Number(f64::atan)),
    ("ceil", Builtin::Number(f64::ceil)),
    ("floor", Builtin::Number(f64::floor)),
    ("set_tcp", Builtin::SetTcp),
    ("set_payload set_payload_mass set_payload_cog set_target_payload", Builtin::SetPayload),
    (
        "force_mode path_offset_enable path_offset_set track_conveyor_linear track_conveyor_circular freedrive_mode \
         teach_mode screw_driving backdrive_mode set_conveyor_tick_count",
        Builtin::Shifts,
    ),
    (
        "end_force_mode path_offset_disable stop_conveyor_tracking end_freedrive_mode end_teach_mode \
         end_screw_driving end_backdrive_mode",
        Builtin::Unshifts,
    ),
    ("stopj stopl stop_program", Builtin::Stops),
    (
        "sleep sync textmsg popup set_digital_out set_standard_digital_out set_configurable_digital_out \
         set_tool_digital_out set_analog_out set_standard_analog_out set_flag set_tool_voltage set_gravity \
         set_analog_inputrange set_analog_outputdomain set_standard_analog_input_domain set_tool_analog_input_domain \
         set_tool_communication set_tool_output_mode set_tool_digital_output_mode set_runstate_outputs \
         set_runstate_configurable_digital_output_to_value set_runstate_standard_digital_output_to_value \
         set_runstate_tool_digital_output_to_value set_runstate_standard_analog_output_to_value \
         set_runstate_gp_boolean_output_to_value set_input_actions_to_default set_standard_digital_input_action \
         set_configurable_digital_input_action set_tool_digital_input_action set_gp_boolean_input_action \
         set_safety_mode_transition_hardness set_baselight_iec set_euromap_output set_euromap_runstate_output \
         set_joint_speed_scaling socket_close socket_set_var socket_send_byte socket_send_int socket_send_line \
         socket_send_string modbus_add_signal modbus_add_rw_signal modbus_delete_signal modbus_set_output_register \
         modbus_set_output_signal modbus_set_runstate_dependent_choice modbus_set_signal_update_frequency \
         modbus_set_signal_watchdog modbus_send_custom_command modbus_add_rtu_signal write_output_boolean_register write_output_float_register \
         write_output_integer_register write_port_bit write_port_register rtde_set_watchdog enable_external_ft_sensor \
         zero_ftsensor ft_rtde_input_enable tool_wrench_limit_set tool_wrench_limit_disable reset_world_model \
         position_deviation_warning protective_stop reset_revolution_counter force_mode_set_damping \
         force_mode_set_gain_scaling conveyor_pulse_decode encoder_enable_pulse_decode encoder_enable_set_tick_count \
         encoder_set_tick_count set_servo_behaviour eoat_set_payload varmsg rtde_report assert pass \
         enter_critical exit_critical set_max_speed collision_detection_disable collision_detection_enable \
         set_base_acceleration calibrate start_calibration path_offset_set_alpha_filter path_offset_set_max_offset \
         jointcontrol_enable high_holding_torque_disable high_holding_torque_enable set_arm_outputs",
        Builtin::Quiet,
    ),
    (
        "get_actual_tcp_pose get_target_tcp_pose get_actual_joint_positions get_target_joint_positions \
         get_actual_joint_positions_history get_actual_joint_speeds get_actual_tcp_speed get_target_tcp_speed get_target_joint_speeds \
         get_target_waypoint get_actual_tool_flange_pose get_forward_kin get_tcp_force get_joint_torques \
         get_joint_temp get_tcp_offset get_target_payload get_target_payload_cog get_target_payload_inertia \
         get_controller_temp get_tool_accelerometer_reading get_tool_current get_tool_temp get_steptime \
         get_conveyor_tick_count get_digital_in get_standard_digital_in get_configurable_digital_in \
         get_tool_digital_in get_analog_in get_standard_analog_in get_tool_analog_in get_digital_out \
         get_standard_digital_out get_configurable_digital_out get_tool_digital_out get_analog_out \
         get_standard_analog_out get_flag get_euromap_input get_euromap_output get_inverse_kin_has_solution \
         is_steady is_within_safety_limits powerdown read_input_boolean_register read_input_float_register \
         read_input_integer_register read_output_boolean_register read_output_float_register \
         read_output_integer_register read_port_bit read_port_register request_boolean_from_primary_client \
         request_float_from_primary_client request_integer_from_primary_client request_string_from_primary_client \
         socket_get_var socket_open socket_read_ascii_float socket_read_binary_integer socket_read_byte_list \
         socket_read_line socket_read_string rpc_factory rpc_call modbus_get_signal_status modbus_get_error \
         modbus_get_time_since_signal_invalid eip_reader_factory eip_writer_factory get_jacobian \
         get_jacobian_time_derivative get_mass_matrix get_coriolis_and_centrifugal_torques force \
         tool_contact tool_contact_examples random time get_jerk_limits get_max_payload encoder_get_tick_count \
         encoder_unwind_delta_tick_count get_freedrive_status freedrive_mode_no_incorrect_payload_check \
         get_program_state is_protective_stopped get_robot_mode",
        Builtin::Reads,
    ),
    (
        "interpolate_pose pose_dist pose_sub point_dist norm normalize dot cross inv transpose atan2 pow log \
         rotvec2rpy wrench_trans binary_list_to_integer integer_to_binary_list integer_to_byte_list str_at str_cat str_empty str_find str_len \
         str_sub to_num to_str struct make_list get_bits vector_normalize polyfit abs max min round",
        Builtin::Computes,
    ),
];
