//! Mass matrix and joint torques.

use super::super::vector::{Arithmetic, add, constant, cross, cross_constant, dot, scale};
use super::{Chain, GravityLoad, JointKind, Link, MAX_JOINTS, Symmetric};
use solve::simd::compiled_for_this_machine;

/// Motion of a link at its origin, in its own axes.
#[derive(Clone, Copy)]
struct Motion<T> {
    rate: [T; 3],
    angular: [T; 3],
    linear: [T; 3],
}

/// What a body needs to move as it does, at its origin and in its own axes.
#[derive(Clone, Copy)]
struct Wrench<T> {
    force: [T; 3],
    moment: [T; 3],
}

/// Links of a short chain: what is known of its links stands in short arrays, which take less time to clear. It decides the time alone.
const SHORT: usize = 3;

impl Chain {
    /// Joint-space mass matrix M(q), n×n by rows, kg m² (kg, kg m for prismatic joints).
    pub fn mass_matrix<T: Arithmetic>(&self, q: &[T], m: &mut [T]) {
        compiled_for_this_machine(
            #[inline(always)]
            || self.composite_bodies(q, m),
        );
    }

    /// [`Self::mass_matrix`] by composite rigid bodies.
    #[inline(always)]
    fn composite_bodies<T: Arithmetic>(&self, q: &[T], m: &mut [T]) {
        let n = self.links.len();
        let mut turns = [(T::from(0.0), T::from(1.0)); MAX_JOINTS];
        for (i, link) in self.links.iter().enumerate() {
            turns[i] = link.turn(q[i]);
        }
        let mut composite = Composite::nothing();
        for i in (0..n).rev() {
            composite = composite.with(&self.links[i]);
            let mut wrench = composite.unit_acceleration(self.links[i].kind);
            let mut j = i;
            loop {
                let entry = match self.links[j].kind {
                    JointKind::Revolute => wrench.moment[2],
                    JointKind::Prismatic => wrench.force[2],
                };
                m[i * n + j] = entry;
                m[j * n + i] = entry;
                if j == 0 {
                    break;
                }
                wrench = wrench.on_previous(&self.links[j], turns[j], q[j]);
                j -= 1;
            }
            if i > 0 {
                composite = composite.on_previous(&self.links[i], turns[i], q[i]);
            }
        }
    }

    /// Inverse dynamics without gravity: τ = M(q) q̈ + c(q, q̇).
    ///
    /// `qd`: speeds, or `None` to leave Coriolis and centrifugal terms out. Slices hold one value a joint; N m or N.
    pub fn inverse_dynamics<T: Arithmetic>(&self, q: &[T], qd: Option<&[T]>, qdd: &[T], tau: &mut [T]) {
        self.newton_euler(Motion::rest(), q, qd, Some(qdd), tau);
    }

    /// Gravity torque g(q): what the joints have to hold. Zero where gravity is compensated.
    pub fn gravity_torque<T: Arithmetic>(&self, q: &[T], tau: &mut [T]) {
        self.newton_euler(self.free_fall(), q, None, None, tau);
        for (link, tau) in self.links.iter().zip(tau) {
            if link.gravity == GravityLoad::Compensated {
                *tau = T::from(0.0);
            }
        }
    }

    /// Everything that the description puts on the joints: τ = M(q) q̈ [+ c(q, q̇)] [+ g(q)].
    pub fn link_torque<T: Arithmetic>(&self, q: &[T], qd: &[T], qdd: &[T], tau: &mut [T]) {
        let qd = self.coriolis.then_some(qd);
        let has_gravity = self.has_gravity();
        if has_gravity && self.bears_gravity() {
            self.newton_euler(self.free_fall(), q, qd, Some(qdd), tau);
            return;
        }
        self.inverse_dynamics(q, qd, qdd, tau);
        if has_gravity {
            let mut gravity = [T::from(0.0); MAX_JOINTS];
            self.gravity_torque(q, &mut gravity[..self.links.len()]);
            for (tau, gravity) in tau.iter_mut().zip(gravity) {
                *tau += gravity;
            }
        }
    }

    /// The torques besides M(q) q̈: [c(q, q̇)] [+ g(q)]. Costs nothing where the description has neither.
    pub fn bias_torque<T: Arithmetic>(&self, q: &[T], qd: &[T], tau: &mut [T]) {
        tau.fill(T::from(0.0));
        let has_gravity = self.has_gravity();
        if has_gravity && self.coriolis && self.bears_gravity() {
            self.newton_euler(self.free_fall(), q, Some(qd), None, tau);
            return;
        }
        if has_gravity {
            self.gravity_torque(q, tau);
        }
        if self.coriolis {
            let mut coriolis = [T::from(0.0); MAX_JOINTS];
            self.newton_euler(Motion::rest(), q, Some(qd), None, &mut coriolis[..self.links.len()]);
            for (tau, coriolis) in tau.iter_mut().zip(coriolis) {
                *tau += coriolis;
            }
        }
    }

    /// A base that falls upwards loads the bodies as gravity does.
    fn free_fall<T: Arithmetic>(&self) -> Motion<T> {
        Motion { linear: constant(self.gravity_m_s2.map(|g| -g)), ..Motion::rest() }
    }

    /// Newton and Euler: the motion from link to link outwards from that of the base, then the wrenches back inwards. Speeds or accelerations that are none
    /// are zero and cost nothing.
    fn newton_euler<T: Arithmetic>(
        &self,
        base: Motion<T>,
        q: &[T],
        qd: Option<&[T]>,
        qdd: Option<&[T]>,
        tau: &mut [T],
    ) {
        if self.links.len() <= SHORT {
            compiled_for_this_machine(
                #[inline(always)]
                || self.out_and_back::<T, SHORT>(base, q, qd, qdd, tau),
            );
        } else {
            compiled_for_this_machine(
                #[inline(always)]
                || self.out_and_back::<T, MAX_JOINTS>(base, q, qd, qdd, tau),
            );
        }
    }

    /// [`Self::newton_euler`] of a chain of at most `L` links.
    #[inline(always)]
    fn out_and_back<T: Arithmetic, const L: usize>(
        &self,
        base: Motion<T>,
        q: &[T],
        qd: Option<&[T]>,
        qdd: Option<&[T]>,
        tau: &mut [T],
    ) {
        let mut needs = [Wrench::nothing(); L];
        let mut turns = [(T::from(0.0), T::from(1.0)); L];
        let mut motion = base;
        for (i, link) in self.links.iter().enumerate() {
            turns[i] = link.turn(q[i]);
            motion = link.motion(turns[i], &motion, (q[i], qd.map(|qd| qd[i]), qdd.map(|qdd| qdd[i])));
            needs[i] = link.needs(&motion, qd.is_some());
        }
        let mut outer = Wrench::nothing();
        for (i, link) in self.links.iter().enumerate().rev() {
            let total = Wrench { force: add(needs[i].force, outer.force), moment: add(needs[i].moment, outer.moment) };
            tau[i] = match link.kind {
                JointKind::Revolute => total.moment[2],
                JointKind::Prismatic => total.force[2],
            };
            if i > 0 {
                outer = total.on_previous(link, turns[i], q[i]);
            }
        }
    }
}

impl Link {
    /// Its motion by that of the previous link, its position and, where they are not zero, its speed and acceleration.
    #[inline(always)]
    fn motion<T: Arithmetic>(
        &self,
        turn: (T, T),
        previous: &Motion<T>,
        (q, qd, qdd): (T, Option<T>, Option<T>),
    ) -> Motion<T> {
        let mut linear = add(previous.linear, self.cross_origin(previous.angular, q));
        if qd.is_some() {
            linear = add(linear, cross(previous.rate, self.cross_origin(previous.rate, q)));
        }
        let mut motion = Motion {
            rate: previous.rate,
            angular: self.inwards(turn, previous.angular),
            linear: self.inwards(turn, linear),
        };
        if let Some(qd) = qd {
            motion.rate = self.inwards(turn, previous.rate);
            // ω × z q̇ = (ω_y, −ω_x, 0) q̇
            let swept = [motion.rate[1] * qd, -motion.rate[0] * qd];
            match self.kind {
                JointKind::Revolute => {
                    motion.angular[0] += swept[0];
                    motion.angular[1] += swept[1];
                    motion.rate[2] += qd;
                }
                JointKind::Prismatic => {
                    motion.linear[0] += swept[0] * 2.0;
                    motion.linear[1] += swept[1] * 2.0;
                }
            }
        }
        if let Some(qdd) = qdd {
            match self.kind {
                JointKind::Revolute => motion.angular[2] += qdd,
                JointKind::Prismatic => motion.linear[2] += qdd,
            }
        }
        motion
    }

    /// a × p, p where its origin stands in the previous link's axes.
    #[inline(always)]
    fn cross_origin<T: Arithmetic>(&self, a: [T; 3], q: T) -> [T; 3] {
        match self.kind {
            JointKind::Revolute => cross_constant(a, self.origin_m),
            JointKind::Prismatic => cross(a, self.origin(q)),
        }
    }

    /// Newton and Euler at the link's origin: f = m a + α × h + ω × (ω × h), n = I α + ω × I ω + h × a.
    #[inline(always)]
    fn needs<T: Arithmetic>(&self, motion: &Motion<T>, with_rate: bool) -> Wrench<T> {
        let h = self.first_moment;
        let [x, y, z] = motion.linear;
        let mut force = add([x * self.mass_kg, y * self.mass_kg, z * self.mass_kg], cross_constant(motion.angular, h));
        let along = cross_constant(motion.linear, h);
        let mut moment = self.inertia.apply(motion.angular);
        for axis in 0..3 {
            moment[axis] -= along[axis];
        }
        if with_rate {
            force = add(force, cross(motion.rate, cross_constant(motion.rate, h)));
            moment = add(moment, cross(motion.rate, self.inertia.apply(motion.rate)));
        }
        Wrench { force, moment }
    }
}

impl<T: Arithmetic> Motion<T> {
    fn rest() -> Self {
        let zero = [T::from(0.0); 3];
        Self { rate: zero, angular: zero, linear: zero }
    }
}

impl<T: Arithmetic> Wrench<T> {
    #[inline(always)]
    fn nothing() -> Self {
        Wrench { force: [T::from(0.0); 3], moment: [T::from(0.0); 3] }
    }

    /// The same wrench at the previous link's origin and in its axes.
    #[inline(always)]
    fn on_previous(&self, link: &Link, turn: (T, T), q: T) -> Self {
        let force = link.outwards(turn, self.force);
        let [x, y, z] = link.cross_origin(force, q);
        let turned = link.outwards(turn, self.moment);
        Self { force, moment: [turned[0] - x, turned[1] - y, turned[2] - z] }
    }
}

/// Bodies frozen into one: mass, first moment and inertia at a link's origin, in its axes.
#[derive(Clone, Copy)]
struct Composite<T> {
    mass_kg: f64,
    first_moment: [T; 3],
    inertia: Symmetric<T>,
}

impl<T: Arithmetic> Composite<T> {
    fn nothing() -> Self {
        let zero = T::from(0.0);
        let inertia = Symmetric { xx: zero, yy: zero, zz: zero, xy: zero, xz: zero, yz: zero };
        Self { mass_kg: 0.0, first_moment: [zero; 3], inertia }
    }

    #[inline(always)]
    fn with(mut self, link: &Link) -> Self {
        self.mass_kg += link.mass_kg;
        self.first_moment = add(self.first_moment, constant(link.first_moment));
        let own: Symmetric<T> = link.inertia.constant();
        let sum = &mut self.inertia;
        sum.xx += own.xx;
        sum.yy += own.yy;
        sum.zz += own.zz;
        sum.xy += own.xy;
        sum.xz += own.xz;
        sum.yz += own.yz;
        self
    }

    /// The wrench that accelerates the composite by one unit about or along z.
    #[inline(always)]
    fn unit_acceleration(&self, kind: JointKind) -> Wrench<T> {
        let h = self.first_moment;
        let zero = T::from(0.0);
        match kind {
            JointKind::Revolute => {
                Wrench { force: [-h[1], h[0], zero], moment: [self.inertia.xz, self.inertia.yz, self.inertia.zz] }
            }
            JointKind::Prismatic => Wrench { force: [zero, zero, T::from(self.mass_kg)], moment: [h[1], -h[0], zero] },
        }
    }

    /// The same composite at the previous link's origin and in its axes.
    #[inline(always)]
    fn on_previous(&self, link: &Link, turn: (T, T), q: T) -> Self {
        let h = link.outwards(turn, self.first_moment);
        let p = link.origin(q);
        let p_mass = scale(p, T::from(self.mass_kg));
        let first_moment = add(h, p_mass);

        // Rows of (R I) are R applied to the columns of I; a second time gives R I Rᵀ.
        let i = &self.inertia;
        let columns = [[i.xx, i.xy, i.xz], [i.xy, i.yy, i.yz], [i.xz, i.yz, i.zz]].map(|c| link.outwards(turn, c));
        let rows: [[T; 3]; 3] =
            std::array::from_fn(|row| link.outwards(turn, [columns[0][row], columns[1][row], columns[2][row]]));
        // Steiner for an origin moved by p: + (2 h·p + m p·p) 1 − h pᵀ − p hᵀ − m p pᵀ
        let k = [h[0] + first_moment[0], h[1] + first_moment[1], h[2] + first_moment[2]];
        let diagonal = dot(k, p);
        let off = |a: usize, b: usize| h[a] * p[b] + p[a] * first_moment[b];
        Self {
            mass_kg: self.mass_kg,
            first_moment,
            inertia: Symmetric {
                xx: rows[0][0] + diagonal - off(0, 0),
                yy: rows[1][1] + diagonal - off(1, 1),
                zz: rows[2][2] + diagonal - off(2, 2),
                xy: rows[0][1] - off(0, 1),
                xz: rows[0][2] - off(0, 2),
                yz: rows[1][2] - off(1, 2),
            },
        }
    }
}
