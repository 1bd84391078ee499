//! What a robot is: its description file, kinematic chain and inertia.
