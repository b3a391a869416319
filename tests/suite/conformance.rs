//! The protocol checklist, item by item; the number of an item is in the name of its test.

mod autopilot_state;
mod codec;
mod detection;
mod discovery;
mod gimbal_parameters;
mod gimbals;
mod gremsy;
mod gremsy_by_name;
mod identity;
mod manager;
mod mavlink_v1;
mod mavsdk_trace;
mod own_commands;
mod presented_device;
mod px4_client;

mod rivals;
mod spoken_for;
mod state_for_gimbals;
