//! A robot for the tests: flexible joints side by side, without coupling, with the figures of Doggy.
//!
//! b θ̈ = τ_c + k_pwm U u − k_mi θ̇ − τ_f,  J q̈ = −τ_c,  τ_c = k_s (q − θ) + d_s (q̇ − θ̇); RK4 at 0.25 ms.

/// Counts per radian of Doggy's joints.
pub const COUNTS_PER_RAD: f64 = 1024.0 * 42.092 / core::f64::consts::TAU;
/// Axes of the joints in the zero position: yaw, pitch, and a roll to the back.
pub const AXES: [[f32; 3]; 3] = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]];
/// Mount of a gyro along the body's axes.
pub const ALONG: [[f32; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// Radians per second of a gyro word at ±1000 °/s.
pub const RAD_S_PER_LSB: f64 = 1000.0 / 32768.0 * core::f64::consts::PI / 180.0;

#[derive(Clone, Copy)]
pub struct Joint {
    pub k_pwm_u: f64,
    pub k_mi: f64,
    pub b: f64,
    pub j: f64,
    pub mu: f64,
    pub k_s: f64,
    pub d_s: f64,
    /// q, q̇, θ, θ̇.
    pub state: [f64; 4],
}

impl Joint {
    pub fn doggy(index: usize) -> Self {
        let (mu, k_s, d_s) = [(1.6, 448.0, 1.5), (2.7, 416.0, 1.7), (4.8, 559.0, 2.8)][index % 3];
        Joint { k_pwm_u: 161.7, k_mi: 35.4, b: 2.62, j: 0.52, mu, k_s, d_s, state: [0.0; 4] }
    }

    /// A joint with a soft belt and a link half as heavy as its motor: the host's `one_joint`.
    pub fn soft() -> Self {
        Joint { k_pwm_u: 36.0, k_mi: 3.0, b: 0.25, j: 0.139, mu: 0.6, k_s: 80.0, d_s: 0.3, state: [0.0; 4] }
    }

    /// Angle by which the belt gives way while full duty accelerates motor and link together, rad; a third more, for the
    /// figures are known to 15 %.
    pub fn give_rad(&self) -> f32 {
        (1.35 * self.k_pwm_u * self.j / (self.b + self.j) / self.k_s) as f32
    }

    /// Inertia of the link over the torque at full duty, s², as well.
    pub fn carried_s2(&self) -> f32 {
        (1.35 * self.j / self.k_pwm_u) as f32
    }

    /// (motor + link inertia) / back-EMF, s.
    pub fn coast_s(&self) -> f32 {
        ((self.b + self.j) / self.k_mi) as f32
    }

    /// Time for which the belt at the top of a swing may hold the motor against full duty, s, as well.
    pub fn held_s(&self) -> f32 {
        (1.26 * 4.0 * (self.mu / self.k_pwm_u).sqrt() / (self.k_s / self.j).sqrt()) as f32
    }

    fn rates(&self, [q, qd, th, thd]: [f64; 4], u: f64) -> [f64; 4] {
        let belt = self.k_s * (q - th) + self.d_s * (qd - thd);
        let friction = 2.0 * self.mu * (1.0 / (1.0 + (-400.0 * thd).exp()) - 0.5);
        [qd, -belt / self.j, thd, (belt + self.k_pwm_u * u - self.k_mi * thd - friction) / self.b]
    }

    /// One millisecond under the duty `u`, a fraction.
    pub fn advance(&mut self, u: f64) {
        let h = 0.25e-3;
        for _ in 0..4 {
            let x = self.state;
            let at = |k: [f64; 4], f: f64| core::array::from_fn(|i| x[i] + f * h * k[i]);
            let k1 = self.rates(x, u);
            let k2 = self.rates(at(k1, 0.5), u);
            let k3 = self.rates(at(k2, 0.5), u);
            let k4 = self.rates(at(k3, 1.0), u);
            self.state = core::array::from_fn(|i| x[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
        }
    }
}

/// Noise from a seed: a linear congruential generator, twelve uniforms to a Gaussian.
pub struct Noise(pub u64);

impl Noise {
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn gaussian(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

/// A robot and its sensors.
pub struct Plant {
    pub joints: Vec<Joint>,
    /// What its firmware is told of them.
    pub described: Vec<Joint>,
    pub noise: Noise,
}

impl Plant {
    pub fn doggy(joints: usize, seed: u64) -> Self {
        Self::of((0..joints).map(Joint::doggy).collect(), seed)
    }

    /// One joint with a soft belt.
    pub fn soft(seed: u64) -> Self {
        Self::of(vec![Joint::soft()], seed)
    }

    fn of(joints: Vec<Joint>, seed: u64) -> Self {
        Plant { described: joints.clone(), joints, noise: Noise(seed) }
    }

    /// The same with every figure drawn within ±20 %.
    pub fn drawn(joints: usize, seed: u64) -> Self {
        let mut plant = Self::doggy(joints, seed);
        for joint in &mut plant.joints {
            for figure in
                [&mut joint.k_pwm_u, &mut joint.k_mi, &mut joint.b, &mut joint.mu, &mut joint.k_s, &mut joint.d_s]
            {
                *figure *= 0.8 + 0.4 * plant.noise.uniform();
            }
        }
        plant
    }

    pub fn counts(&self, joint: usize) -> i32 {
        (self.joints[joint].state[2] * COUNTS_PER_RAD).floor() as i32
    }

    /// Words of a gyro, the first on the first body, the second on the last, mounted along the body's axes: the body's
    /// rates with noise and a zero of 2.6°/s.
    pub fn words(&mut self, gyro: usize) -> [i16; 3] {
        let joints = if gyro == 0 { 1 } else { self.joints.len() };
        let joint = |i: usize| self.joints.get(i).filter(|_| i < joints).map_or([0.0; 2], |j| [j.state[0], j.state[1]]);
        let [[_, yaw], [q2, pitch], [q3, roll]] = [0, 1, 2].map(joint);
        // Rz(q₁) Ry(q₂) Rx(−q₃), backwards.
        let [x, y, z] = [-q2.sin() * yaw - roll, pitch, q2.cos() * yaw];
        let rates = [x, q3.cos() * y - q3.sin() * z, q3.sin() * y + q3.cos() * z];
        rates.map(|rate| ((rate + 0.0456 + 1.745e-3 * self.noise.gaussian()) / RAD_S_PER_LSB).round() as i16)
    }
}
