//! The simulated robot: plant, microcontroller running the firmware's control core, serial line with faults.
