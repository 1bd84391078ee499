//! The chain in base axes, four samples at once: M(q), and ∂(M(q) a)/∂q in closed form.
//!
//! With joint twists S, composite inertias I (about one fixed point, in base axes), A_j = Σ_{l≤j} S_l a_l the acceleration of link j, and
//! F_j = I_j A_j + Σ_{l>j} I_l S_l a_l the force that moves everything from link j on,
//!
//! ```text
//! M_ij = S_jᵀ I_i S_i, j ≤ i          ∂τ_i/∂q_j = −(I_i S_i)ᵀ (S_j × A_j)                  j ≤ i
//!                                     ∂τ_i/∂q_j = S_iᵀ (S_j ×* F_j − I_j (S_j × A_j))      j > i
//! ```
//! (turning joint j turns the twists and inertias of all links from j on, and takes A_j with it). A chain whose joints meet in one point,
//! as Doggy's, needs the rotational halves only. Joints are revolute.
//!
//! Gravity γ is a base that accelerates by −γ and does not turn. With f_i the force in I_i S_i and z_j the joints' axes,
//!
//! ```text
//! g_i = −f_i · γ          ∂g_i/∂q_j = ∂g_j/∂q_i = f_i · (z_j × γ), j ≤ i: a potential's
//! ```
//! on the joints that feel it.

use super::elementary::sin_cos;
use super::vector::{Vector, add, add_scaled, combine, constant, cross, dot, scale, sub, zero};
use crate::robot::chain::LinkFrame;
use crate::robot::{GravityLoad, Matrix3, Vector3, chain::Chain};
use solve::simd::{Simd, Wide};

/// The links of a chain.
#[derive(Debug, Clone)]
pub struct Links {
    links: Vec<LinkFrame>,
    /// All axes go through one point.
    concentric: bool,
    /// Acceleration of free fall in base axes, m/s², where a joint feels it.
    gravity: Option<Vector3>,
}

impl Links {
    pub(super) fn of(chain: &Chain) -> Self {
        let links: Vec<_> = chain.frames().collect();
        let concentric = links[1..].iter().all(|link| link.origin_m == [0.0; 3]);
        Links { links, concentric, gravity: chain.has_gravity().then(|| chain.gravity_m_s2()) }
    }

    pub(super) fn count(&self) -> usize {
        self.links.len()
    }

    #[inline(always)]
    fn feels_gravity(&self, joint: usize) -> bool {
        self.links[joint].gravity == GravityLoad::Acts
    }

    /// The axes of link `body` → the body's own axes.
    #[inline(always)]
    pub(super) fn to_body(&self, body: usize) -> Matrix3 {
        self.links[body].to_body
    }
}

/// A motion or a unit motion: angular and, at the reference point, linear.
#[derive(Clone, Copy)]
struct Twist<S: Simd> {
    angular: Vector<S>,
    linear: Vector<S>,
}

/// A force at the reference point with its moment.
#[derive(Clone, Copy)]
struct Wrench<S: Simd> {
    moment: Vector<S>,
    force: Vector<S>,
}

/// Mass, first moment and inertia (xx, yy, zz, xy, xz, yz) about the reference point, in base axes.
#[derive(Clone, Copy)]
struct Body<S: Simd> {
    mass_kg: f64,
    first_moment: Vector<S>,
    inertia: [Wide<S>; 6],
}

/// A chain at its positions.
#[derive(Clone, Copy)]
pub struct Bodies<S: Simd, const L: usize> {
    simd: S,
    concentric: bool,
    /// Axes of every link in base axes.
    axes: [[Vector<S>; 3]; L],
    twists: [Twist<S>; L],
    /// Everything from a link on, frozen.
    composite: [Body<S>; L],
    /// composite · twist.
    wrenches: [Wrench<S>; L],
}

impl<S: Simd> Body<S> {
    /// What moves this body as `twist` says.
    #[inline(always)]
    fn times(&self, concentric: bool, twist: &Twist<S>) -> Wrench<S> {
        let [xx, yy, zz, xy, xz, yz] = self.inertia;
        let w = twist.angular;
        let moment = [
            xx.mul_add(w[0], xy.mul_add(w[1], xz * w[2])),
            xy.mul_add(w[0], yy.mul_add(w[1], yz * w[2])),
            xz.mul_add(w[0], yz.mul_add(w[1], zz * w[2])),
        ];
        if concentric {
            return Wrench { moment, force: zero(xx.simd) };
        }
        let mass = Wide::splat(xx.simd, self.mass_kg);
        Wrench {
            moment: add(moment, cross(self.first_moment, twist.linear)),
            force: add_scaled(cross(w, self.first_moment), mass, twist.linear),
        }
    }
}

impl<S: Simd> Twist<S> {
    #[inline(always)]
    fn dot(&self, concentric: bool, wrench: &Wrench<S>) -> Wide<S> {
        let turning = dot(self.angular, wrench.moment);
        if concentric { turning } else { turning + dot(self.linear, wrench.force) }
    }

    /// self × other.
    #[inline(always)]
    fn cross(&self, concentric: bool, other: &Self) -> Self {
        let angular = cross(self.angular, other.angular);
        if concentric {
            return Twist { angular, linear: other.linear };
        }
        Twist { angular, linear: add(cross(self.angular, other.linear), cross(self.linear, other.angular)) }
    }

    /// self ×* wrench.
    #[inline(always)]
    fn cross_wrench(&self, concentric: bool, wrench: &Wrench<S>) -> Wrench<S> {
        let moment = cross(self.angular, wrench.moment);
        if concentric {
            return Wrench { moment, force: wrench.force };
        }
        Wrench { moment: add(moment, cross(self.linear, wrench.force)), force: cross(self.angular, wrench.force) }
    }

    #[inline(always)]
    fn add_scaled(&self, s: Wide<S>, other: &Self) -> Self {
        Twist { angular: add_scaled(self.angular, s, other.angular), linear: add_scaled(self.linear, s, other.linear) }
    }
}

impl<S: Simd, const L: usize> Bodies<S, L> {
    /// The chain at positions q, rad.
    #[inline(always)]
    pub(super) fn at(simd: S, links: &Links, q: &[Wide<S>; L]) -> Self {
        let (zeros, one) = (zero(simd), Wide::splat(simd, 1.0));
        let nothing = Twist { angular: zeros, linear: zeros };
        let nobody = Body { mass_kg: 0.0, first_moment: zeros, inertia: [zeros[0]; 6] };
        let mut bodies = Bodies {
            simd,
            concentric: links.concentric,
            axes: [[zeros; 3]; L],
            twists: [nothing; L],
            composite: [nobody; L],
            wrenches: [Wrench { moment: zeros, force: zeros }; L],
        };
        let mut previous = [zeros; 3];
        for i in 0..3 {
            previous[i][i] = one;
        }
        // Positions are seen from the first joint's origin.
        let mut position = zeros;
        for k in 0..L {
            let link = &links.links[k];
            if k > 0 && !links.concentric {
                position = add(position, combine(&previous, link.origin_m));
            }
            let x = combine(&previous, link.from_previous[0]);
            let y = combine(&previous, link.from_previous[1]);
            let z = combine(&previous, link.from_previous[2]);
            let (sin, cos) = sin_cos(q[k]);
            previous = [add_scaled(scale(x, cos), sin, y), sub(scale(y, cos), scale(x, sin)), z];
            bodies.twists[k] = Twist { angular: z, linear: cross(position, z) };
            bodies.axes[k] = previous;
            bodies.composite[k] = Self::body(simd, links, k, &previous, position);
        }
        for k in (0..L).rev() {
            if k + 1 < L {
                let outer = bodies.composite[k + 1];
                let own = &mut bodies.composite[k];
                own.mass_kg += outer.mass_kg;
                own.first_moment = add(own.first_moment, outer.first_moment);
                for i in 0..6 {
                    own.inertia[i] += outer.inertia[i];
                }
            }
            bodies.wrenches[k] = bodies.composite[k].times(links.concentric, &bodies.twists[k]);
        }
        bodies
    }

    /// The own body of link k, seen from the reference point.
    #[inline(always)]
    fn body(simd: S, links: &Links, k: usize, axes: &[Vector<S>; 3], p: Vector<S>) -> Body<S> {
        let link = &links.links[k];
        let rows = [combine(axes, link.inertia[0]), combine(axes, link.inertia[1]), combine(axes, link.inertia[2])];
        let mut inertia = [Wide::splat(simd, 0.0); 6];
        for (entry, (r, c)) in inertia.iter_mut().zip([(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]) {
            *entry = axes[0][r].mul_add(rows[0][c], axes[1][r].mul_add(rows[1][c], axes[2][r] * rows[2][c]));
        }
        let mut first_moment = zero(simd);
        if !links.concentric {
            // Steiner: + (2 h·p + m p·p) 1 − h pᵀ − p hᵀ − m p pᵀ
            let mass = Wide::splat(simd, link.mass_kg);
            let h = combine(axes, link.first_moment);
            first_moment = add_scaled(h, mass, p);
            let diagonal = dot(add(h, first_moment), p);
            for (i, (r, c)) in [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)].into_iter().enumerate() {
                inertia[i] -= h[r] * p[c] + p[r] * first_moment[c];
                if r == c {
                    inertia[i] += diagonal;
                }
            }
        } else if links.gravity.is_some() {
            first_moment = combine(axes, link.first_moment);
        }
        Body { mass_kg: link.mass_kg, first_moment, inertia }
    }

    /// M(q), its lower triangle.
    #[inline(always)]
    pub(super) fn mass_matrix(&self) -> [[Wide<S>; L]; L] {
        let mut m = [[Wide::splat(self.simd, 0.0); L]; L];
        for i in 0..L {
            for j in 0..=i {
                m[i][j] = self.twists[j].dot(self.concentric, &self.wrenches[i]);
            }
        }
        m
    }

    /// ∂(M(q) a + g(q))_i/∂q_j at fixed a.
    #[inline(always)]
    pub(super) fn torque_by_position(&self, links: &Links, a: &[Wide<S>; L]) -> [[Wide<S>; L]; L] {
        let zeros = zero(self.simd);
        let mut out = [[zeros[0]; L]; L];
        let mut motion = Twist { angular: zeros, linear: zeros };
        for j in 0..L {
            let twist = &self.twists[j];
            motion = motion.add_scaled(a[j], twist);
            let carried = twist.cross(self.concentric, &motion);
            for i in j..L {
                out[i][j] = -carried.dot(self.concentric, &self.wrenches[i]);
            }
            if j == 0 {
                continue;
            }
            let mut force = self.composite[j].times(self.concentric, &motion);
            for l in j + 1..L {
                force.moment = add_scaled(force.moment, a[l], self.wrenches[l].moment);
                force.force = add_scaled(force.force, a[l], self.wrenches[l].force);
            }
            let turned = twist.cross_wrench(self.concentric, &force);
            let lost = self.composite[j].times(self.concentric, &carried);
            let change = Wrench { moment: sub(turned.moment, lost.moment), force: sub(turned.force, lost.force) };
            for i in 0..j {
                out[i][j] = self.twists[i].dot(self.concentric, &change);
            }
        }
        let Some(gravity) = links.gravity else { return out };
        let gravity = constant(self.simd, gravity);
        for j in 0..L {
            let turned = cross(self.turning(j), gravity);
            for i in j..L {
                let slope = dot(self.force(i), turned);
                if links.feels_gravity(i) {
                    out[i][j] += slope;
                }
                if i > j && links.feels_gravity(j) {
                    out[j][i] += slope;
                }
            }
        }
        out
    }

    /// Adds g(q).
    #[inline(always)]
    pub(super) fn add_gravity(&self, links: &Links, torque: &mut [Wide<S>; L]) {
        let Some(gravity) = links.gravity else { return };
        let gravity = constant(self.simd, gravity);
        for i in 0..L {
            if links.feels_gravity(i) {
                torque[i] -= dot(self.force(i), gravity);
            }
        }
    }

    /// The force in I_i S_i.
    #[inline(always)]
    fn force(&self, i: usize) -> Vector<S> {
        match self.concentric {
            true => cross(self.turning(i), self.composite[i].first_moment),
            false => self.wrenches[i].force,
        }
    }

    /// The axes of link `body` in base axes.
    #[inline(always)]
    pub(super) fn axes(&self, body: usize) -> &[Vector<S>; 3] {
        &self.axes[body]
    }

    /// What joint j adds to the angular rate of all links from it on, per unit of speed; base axes.
    #[inline(always)]
    pub(super) fn turning(&self, j: usize) -> Vector<S> {
        self.twists[j].angular
    }
}
