//! Tests of the library and the program from outside, in one program.

mod alternating;
mod audit_command;
mod bad_images;
mod bad_input;
mod bad_points;
mod bad_views;
mod calibration_file;
mod commands;
mod common;
mod cross_checks;
mod data_files;
mod device_commands;
mod examples;
mod experiments;
mod export_command;
mod export_folder;
mod export_mesh;
mod export_out;
mod import_command;
mod joint_estimate;
mod known_faults;
mod lengths;
mod match_noise;
mod methods;
mod model_choice;
mod point_sigma;
mod printed_targets;
mod rays_command;
mod schemas;
mod starting_points;
mod target_command;
mod uncertainty;
mod verify;
mod weak_geometry;
#[path = "../../benches/common/weak_rigs.rs"]
mod weak_rigs;
