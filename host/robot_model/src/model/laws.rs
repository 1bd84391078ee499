//! The laws of a model, with their parameters and states put in their places.

use std::sync::Arc;

use super::drive::JointLaw;
use super::law::{Law, LowPass};
use super::links::Links;
use super::number::quantity::Quantity;
use super::parameters::Source;
use super::{Coordinates, Layout};
use crate::robot::chain::Chain;
use crate::robot::{Body, Robot, RobotError, Symbol};

/// How far one step of a lagging gyro's state may be wrong, rad/s over 1 ms: as far as one of the link's speed.
const LAG_SIGMA: f64 = 1e-4;
/// How large that state may be, rad/s.
const LAG_SIZE: f64 = 10.0;

/// The laws of a model.
#[derive(Debug, Clone, Default)]
pub(super) struct Laws {
    list: Vec<Arc<dyn Law>>,
    joints: Vec<OfJoint>,
    /// Joint of the chain, and the coordinates that are ln k and ln d.
    pub(super) passive: Vec<(usize, usize, usize)>,
    pub(super) lags: Vec<Lag>,
    input_delay: Option<usize>,
    /// Of each joint, the coordinate that is ln κ of its friction, where a law changes that.
    pub(super) friction_slope: Vec<Option<usize>>,
    /// Of the robot.
    gyros: usize,
    /// How far a step of each own state may be wrong over 1 ms.
    own_sigma: Vec<f64>,
    /// How large each may be.
    own_size: Vec<f64>,
    /// Which law changes the supply, and its coordinate.
    pub(super) supply: Option<(usize, usize)>,
}

/// What the laws at one joint read.
#[derive(Debug, Clone, Default)]
pub(super) struct OfJoint {
    /// Law, its first local parameter, how many, its local state.
    laws: Vec<(usize, usize, usize, Option<usize>)>,
    /// The coordinate of every local parameter.
    pub(super) parameters: Vec<usize>,
    /// The state component of every local state; that of the input's error, if there is one, stands last.
    pub(super) states: Vec<usize>,
    /// Whether it is there.
    pub(super) has_input_error: bool,
}

/// What a gyro with a low-pass reads.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lagging {
    /// The first of its three states ω_f, by axis in the body's axes.
    pub state: usize,
    /// g of the reading ω_f + g (ω_f − ω).
    pub beyond: f64,
}

impl Lagging {
    /// The rate that is read, in the body's axes, where the body's is `omega`: numbers or formulas.
    pub fn rate<T: Quantity>(&self, x: &[T], omega: [T; 3]) -> [T; 3] {
        std::array::from_fn(|axis| {
            let filtered = x[self.state + axis];
            if self.beyond == 0.0 { filtered } else { filtered + (filtered - omega[axis]) * self.beyond }
        })
    }
}

/// A gyro that lags behind its body.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lag {
    gyro: usize,
    /// Link of the chain.
    pub(super) body: usize,
    /// First of three own states.
    pub(super) state: usize,
    /// The coordinate that is ln T.
    pub(super) coordinate: usize,
    beyond: f64,
}

impl Laws {
    /// Own states are added to `layout`.
    pub(super) fn of(
        robot: &Robot,
        list: Vec<Arc<dyn Law>>,
        coordinates: &Coordinates,
        layout: &mut Layout,
        bodies: &[usize],
    ) -> Self {
        let mut laws = Laws::default();
        let (mut own_sigma, mut own_size) = (Vec::new(), Vec::new());
        let errors: Vec<_> = (0..robot.joints.len()).map(|joint| layout.input(joint)).collect();
        let mut add_state = |sigma: f64, size: f64| {
            own_sigma.push(sigma);
            own_size.push(size);
            layout.own += 1;
            layout.size() - 1
        };
        laws.joints.resize_with(robot.joints.len(), OfJoint::default);
        laws.friction_slope.resize(robot.joints.len(), None);
        for (index, law) in list.iter().enumerate() {
            let first = coordinates.first_of_law(index);
            for (joint, of) in laws.joints.iter_mut().enumerate() {
                if law.hooks().is_empty() {
                    continue;
                }
                let local = law.local(joint);
                let state = law.has_state(joint).then(|| {
                    of.states.push(add_state(law.state_sigma(joint), law.state_size(joint)));
                    of.states.len() - 1
                });
                of.laws.push((index, of.parameters.len(), local.len(), state));
                of.parameters.extend(local.into_iter().map(|own| first + own));
            }
            for (joint, slope) in laws.friction_slope.iter_mut().enumerate() {
                *slope = slope.or(law.friction_slope(joint).map(|own| first + own));
            }
            for (gyro, sensor) in robot.gyros().enumerate() {
                if let Some(LowPass { coordinate: own, beyond }) = law.gyro_lag(gyro) {
                    let [state, _, _] = [LAG_SIGMA; 3].map(|sigma| add_state(sigma, LAG_SIZE));
                    laws.lags.push(Lag { gyro, body: bodies[sensor.body], state, coordinate: first + own, beyond });
                }
            }
            laws.input_delay = laws.input_delay.or(law.input_delay().map(|own| first + own));
            let volts = crate::robot::chain::Lanes::from(1.0);
            if law.supply_v(1.0, volts, volts, volts).is_some() {
                laws.supply = Some((index, first));
            }
        }
        for (of, error) in laws.joints.iter_mut().zip(errors) {
            of.states.extend(error);
            of.has_input_error = error.is_some();
        }
        let before = list.iter().enumerate().flat_map(|(i, law)| law.base_joints().iter().map(move |j| (i, *j)));
        let after = list.iter().enumerate().filter_map(|(i, law)| Some((i, law.structure()?.1)));
        let after = after.flat_map(|(i, joints)| joints.iter().map(move |j| (i, *j)));
        let places: Vec<usize> = layout.passive().collect();
        let joints = before.chain(after).zip(places).map(|((law, joint), place)| {
            let first = coordinates.first_of_law(law);
            (place, first + joint.stiffness, first + joint.damping)
        });
        let passive = joints.collect();
        Laws { list, passive, own_sigma, own_size, gyros: robot.gyros().count(), ..laws }
    }

    pub(super) fn list(&self) -> &[Arc<dyn Law>] {
        &self.list
    }

    /// Whether drives are those of the base law with inputs that are known.
    pub(super) fn is_empty(&self) -> bool {
        self.list.is_empty() && !self.joints.iter().any(|joint| joint.has_input_error)
    }

    /// How many own states a law brings at joints and gyros. The states of laws follow one another as the laws do.
    pub(super) fn own_states_of(&self, law: &dyn Law) -> usize {
        let at_joints = (0..self.joints.len()).filter(|joint| !law.hooks().is_empty() && law.has_state(*joint)).count();
        let at_gyros = (0..self.gyros).filter(|gyro| law.gyro_lag(*gyro).is_some()).count();
        at_joints + 3 * at_gyros
    }

    pub(super) fn own_sigma(&self) -> &[f64] {
        &self.own_sigma
    }

    pub(super) fn own_size(&self) -> &[f64] {
        &self.own_size
    }

    pub(super) fn input_delay(&self) -> Option<usize> {
        self.input_delay
    }

    pub(super) fn lagging(&self, gyro: usize) -> Option<Lagging> {
        let lag = self.lags.iter().find(|lag| lag.gyro == gyro)?;
        Some(Lagging { state: lag.state, beyond: lag.beyond })
    }

    /// Whether a law changes a drive or the supply.
    pub(super) fn at_drives(&self) -> bool {
        self.supply.is_some() || self.joints.iter().any(|joint| !joint.laws.is_empty())
    }

    /// What the laws at a joint read.
    pub(super) fn at(&self, joint: usize) -> &OfJoint {
        &self.joints[joint]
    }

    /// The states at a joint beyond its positions and speeds: of the laws, and the input's error.
    pub(super) fn own_states(&self, joint: usize) -> &[usize] {
        self.joints.get(joint).map_or(&[], |joint| &joint.states)
    }

    /// The laws at every joint, ready to be asked.
    pub(super) fn ready(&self) -> Vec<Vec<JointLaw<'_>>> {
        let of = |joint: &OfJoint| {
            let law = |&(index, first, count, state): &(usize, usize, usize, Option<usize>)| JointLaw {
                law: &*self.list[index],
                first,
                count,
                state,
            };
            joint.laws.iter().map(law).collect()
        };
        self.joints.iter().map(of).collect()
    }

    /// Most variables that the laws at one joint depend on.
    pub(super) fn most_variables(&self) -> usize {
        self.joints.iter().map(|joint| joint.parameters.len() + joint.states.len()).max().unwrap_or(0)
    }
}

/// The chain of `robot` without passive joints, and its terms.
pub(super) fn base_links(robot: &Robot, coordinates: &Coordinates) -> (Chain, Links) {
    with_unknown_inertia(robot.chain(), 0, robot, coordinates)
}

/// `chain`, whose joint `first` is the robot's first, with what bodies are known to have beyond their descriptions; and its terms, one more for
/// everything of that kind that is estimated.
fn with_unknown_inertia(mut chain: Chain, first: usize, robot: &Robot, coordinates: &Coordinates) -> (Chain, Links) {
    let mut unknown = Vec::new();
    for joint in 0..robot.joints.len() {
        for symbol in Symbol::OF_BODIES {
            match coordinates.source(robot, symbol, joint) {
                Source::Known(value) => chain = chain.with_moment(first + joint, symbol, value),
                Source::Free { coordinate, .. } => unknown.push((joint, symbol, coordinate)),
            }
        }
    }
    let mut links = Links::of(chain.clone());
    for (joint, symbol, coordinate) in unknown {
        links.add_mass(chain.massless().with_moment(first + joint, symbol, 1.0), coordinate);
    }
    (chain, links)
}

/// The chain of `robot` with the passive joints of `laws`, and its terms.
pub(super) fn links(
    robot: &Robot,
    laws: &[Arc<dyn Law>],
    coordinates: &Coordinates,
) -> Result<(Chain, Links), RobotError> {
    let base: Vec<_> = laws.iter().flat_map(|law| law.base_joints().iter().map(|joint| joint.axis)).collect();
    let structure = laws.iter().find_map(|law| law.structure());
    let on_passive_joints = |robot: &Robot, outer: Option<Body>| {
        let chain = robot.chain().with_base_joints([0.0; 3], &base)?;
        match (&structure, outer) {
            (Some((_, joints)), Some(outer)) => {
                let axes: Vec<_> = joints.iter().map(|joint| joint.axis).collect();
                chain.with_structure(&outer, &axes)
            }
            _ => Ok(chain),
        }
    };
    let chain = on_passive_joints(robot, structure.as_ref().map(|(outer, _)| *outer))?;
    let (chain, mut links) = with_unknown_inertia(chain, base.len(), robot, coordinates);
    for (index, law) in laws.iter().enumerate() {
        let Some(payload) = law.payload() else { continue };
        let mut alone = robot.clone();
        let nothing = Body { mass_kg: 0.0, centre_m: [0.0; 3], inertia_kg_m2: [[0.0; 3]; 3] };
        let mass = Body { mass_kg: 1.0, centre_m: payload.at_m, ..nothing };
        for (joint, of) in alone.joints.iter_mut().enumerate() {
            of.body = if joint == payload.joint { mass } else { nothing };
        }
        let outermost = payload.joint + 1 == robot.joints.len();
        let mass_alone = on_passive_joints(&alone, Some(if outermost { mass } else { nothing }))?;
        links.add_mass(mass_alone, coordinates.first_of_law(index) + payload.mass);
    }
    for (index, law) in laws.iter().enumerate() {
        if let Some(own) = law.coriolis() {
            links.scale_coriolis(coordinates.first_of_law(index) + own);
        }
    }
    Ok((chain, links))
}
