//! What two jogs of a joint, there and back, say about its motor, its encoder and the gyros that it carries.

use protocol::{Fault, Hello, Side};

use super::Contradiction;
use super::jog::{Counted, Response, length};
use super::mounting::{Seen, dot};
use crate::robot::{Robot, Vector3};

/// Part of the largest way from which on something has moved, or not.
const PART: f64 = 0.3;
/// A count that stays within so many has not moved: an open phase, and noise at an edge.
const DITHER: i32 = 2;
/// How far encoder and gyro may differ, as a part: the scale of a gyro, a mounting, a jog's accuracy.
const RATIO: f64 = 0.1;
/// Factors by which counts per turn are off where edges are counted otherwise, and how near one must be.
const EDGES: [f64; 4] = [0.25, 0.5, 2.0, 4.0];
const NEAR_EDGES: f64 = 0.06;
/// Cosine from which on a direction is one, rather than another.
const ALONG: f64 = 0.8;

/// A joint that was jogged there and back, by the same duty.
#[derive(Debug)]
pub(super) struct Jogged {
    /// The joint.
    pub joint: usize,
    /// Magnitude of the duty.
    pub duty: f64,
    /// By encoder: its joint's way along the duty, mean of both, rad or m.
    moved: Vec<f64>,
    /// By gyro: its turn along the duty, mean of both, rad.
    turned: Vec<Vector3>,
    counted: Vec<Counted>,
    fault: Option<Fault>,
}

/// What is known of a joint that has no contradiction.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Judged {
    /// Way by the encoder over the turn by the gyros; none where no gyro sees the joint.
    pub encoder_over_gyro: Option<f64>,
    /// By gyro: how it saw the joint.
    pub seen: Vec<Option<Seen>>,
}

impl Jogged {
    /// From responses with the sign of their duty.
    pub fn new(joint: usize, duty: f64, responses: &[(f64, Response)]) -> Self {
        let n = responses.len().max(1) as f64;
        let Some((_, first)) = responses.first() else {
            return Self { joint, duty, moved: Vec::new(), turned: Vec::new(), counted: Vec::new(), fault: None };
        };
        let mean =
            |value: &dyn Fn(&Response) -> f64| responses.iter().map(|(sign, r)| sign * value(r)).sum::<f64>() / n;
        let counted = |index: usize| {
            let all = responses.iter().map(|(_, response)| response.counted[index]);
            // The jog with the wider span: an open phase may begin at either of its two counts.
            all.fold(Counted::default(), |a, b| {
                let wider = if b.highest - b.lowest > a.highest - a.lowest { b } else { a };
                Counted { changes: a.changes + b.changes, ..wider }
            })
        };
        Self {
            joint,
            duty,
            moved: (0..first.moved.len()).map(|index| mean(&|r| r.moved[index])).collect(),
            turned: (0..first.turned.len())
                .map(|gyro| std::array::from_fn(|axis| mean(&|r| r.turned[gyro][axis])))
                .collect(),
            counted: (0..first.counted.len()).map(counted).collect(),
            fault: responses.iter().find_map(|(_, response)| response.fault),
        }
    }

    /// Looks for the first contradiction. `expected` is the axis of every joint in axes of every gyro; `mountings_known`
    /// says whether its directions are to be believed.
    pub fn judge(
        &self,
        robot: &Robot,
        hello: &Hello,
        expected: &[Vec<Vector3>],
        mountings_known: bool,
    ) -> Result<Judged, Contradiction> {
        let joint = self.joint;
        let own = self.encoder_of(hello, joint);
        let way = own.map_or(0.0, |own| self.moved[own]);
        let turned = self.most_turned();
        let reach = self.moved.iter().fold(turned, |reach, moved| reach.max(moved.abs()));
        if reach < MOVED_RAD {
            return Err(match self.fault {
                Some(fault) if !matches!(fault, Fault::EncoderStuck { .. }) => Contradiction::Fault { joint, fault },
                _ => Contradiction::NothingMoves { joint, duty: self.duty },
            });
        }
        self.right_encoder(hello, expected, way, mountings_known)?;
        self.right_way(expected, way, mountings_known)?;
        let seen = self.right_bodies(robot, expected, way)?;
        let encoder_over_gyro = self.right_scale(hello, own, way, &seen)?;
        match self.fault {
            Some(fault) => Err(Contradiction::Fault { joint, fault }),
            None => Ok(Judged { encoder_over_gyro, seen }),
        }
    }

    /// Its own encoder counts, and no other one does.
    fn right_encoder(
        &self,
        hello: &Hello,
        expected: &[Vec<Vector3>],
        way: f64,
        mountings_known: bool,
    ) -> Result<(), Contradiction> {
        let (joint, turned) = (self.joint, self.most_turned());
        let others = (0..hello.layout.joints()).filter(|other| *other != joint);
        let others = others.filter_map(|other| Some((other, self.moved[self.encoder_of(hello, other)?].abs())));
        let most = others.fold(None, |most: Option<(usize, f64)>, now| match most {
            Some(most) if most.1 >= now.1 => Some(most),
            _ => Some(now),
        });
        if let Some((other, moved)) = most
            && moved > MOVED_RAD
            && way.abs() < PART * moved
        {
            return Err(match self.which_turns(hello, expected, other, mountings_known) {
                Some(true) => Contradiction::EncodersSwapped { joint, other },
                Some(false) => Contradiction::MotorsSwapped { joint, other },
                None => Contradiction::Swapped { joint, other },
            });
        }
        if let Some(own) = self.encoder_of(hello, joint)
            && turned > MOVED_RAD
        {
            let Counted { lowest, highest, changes } = self.counted[own];
            let span = highest - lowest;
            if span <= DITHER {
                return Err(match changes {
                    0 => Contradiction::NoCounts { joint, turned_rad: turned },
                    _ => Contradiction::OpenPhase { joint, turned_rad: turned, span },
                });
            }
        }
        Ok(())
    }

    /// Whether the joint that was jogged turns (and not the other one), if the gyros can tell.
    fn which_turns(
        &self,
        hello: &Hello,
        expected: &[Vec<Vector3>],
        other: usize,
        mountings_known: bool,
    ) -> Option<bool> {
        let most = self.most_turned();
        if most < MOVED_RAD {
            return None;
        }
        for (gyro, turned) in hello.gyros.iter().zip(&self.turned) {
            let carried = |joint: usize| joint <= usize::from(gyro.body);
            if carried(self.joint) != carried(other) {
                return Some((length(*turned) > PART * most) == carried(self.joint));
            }
        }
        // Both carry it: the direction tells, where it is one of the two.
        let turning = self.turned.iter().zip(expected).filter(|(turned, _)| length(**turned) > PART * most);
        turning.filter(|_| mountings_known).find_map(|(turned, axes)| {
            let along = |joint: usize| (dot(*turned, axes[joint]) / length(*turned)).abs();
            let (this, that) = (along(self.joint), along(other));
            (this.max(that) > ALONG && this.min(that) < 1.0 - ALONG / 2.0).then_some(this > that)
        })
    }

    /// The largest turn of a gyro, rad.
    fn most_turned(&self) -> f64 {
        self.turned.iter().map(|turned| length(*turned)).fold(0.0, f64::max)
    }

    /// The joint goes the way of its duty.
    fn right_way(&self, expected: &[Vec<Vector3>], way: f64, mountings_known: bool) -> Result<(), Contradiction> {
        if way >= 0.0 {
            return Ok(());
        }
        let joint = self.joint;
        let along = self.turned.iter().zip(expected).filter(|(turned, _)| length(**turned) > MOVED_RAD);
        let along = along.map(|(turned, axes)| dot(*turned, axes[joint]) / length(*turned));
        let clear = along.into_iter().find(|cosine| mountings_known && cosine.abs() > ALONG);
        Err(match clear {
            Some(cosine) if cosine > 0.0 => Contradiction::EncoderReversed { joint },
            Some(_) => Contradiction::LeadsReversed { joint },
            None => Contradiction::WrongWay { joint },
        })
    }

    /// The gyros that the joint carries turn, and no others.
    fn right_bodies(
        &self,
        robot: &Robot,
        expected: &[Vec<Vector3>],
        way: f64,
    ) -> Result<Vec<Option<Seen>>, Contradiction> {
        let joint = self.joint;
        let most = self.most_turned();
        // Nobody turns, although the encoder has gone some way.
        let none_turns = most < MOVED_RAD.max(0.1 * way);
        let mut seen = Vec::new();
        for (gyro, (described, turned)) in robot.gyros().zip(&self.turned).enumerate() {
            let (angle, axis) = (length(*turned), expected[gyro][joint]);
            let carried = length(axis) > 0.5;
            let turns = !none_turns && angle > PART * most;
            if turns != carried {
                return Err(Contradiction::GyroElsewhere { gyro, body: described.body, joint, turns });
            }
            seen.push(turns.then(|| Seen { joint, direction: turned.map(|part| part / angle), expected: axis }));
        }
        Ok(seen)
    }

    /// Encoder and gyros agree on how far it went.
    fn right_scale(
        &self,
        hello: &Hello,
        own: Option<usize>,
        way: f64,
        seen: &[Option<Seen>],
    ) -> Result<Option<f64>, Contradiction> {
        let joint = self.joint;
        let turns = self.turned.iter().zip(seen).filter(|(_, seen)| seen.is_some());
        let (sum, n) = turns.fold((0.0, 0.0), |(sum, n), (turned, _)| (sum + length(*turned), n + 1.0));
        let (true, Some(own)) = (n > 0.0, own) else { return Ok(None) };
        let measured = way / (sum / n);
        if (measured - 1.0).abs() <= RATIO {
            return Ok(Some(measured));
        }
        let encoder = &hello.encoders[own];
        let edges = EDGES.into_iter().find(|factor| (measured / factor - 1.0).abs() < NEAR_EDGES);
        Err(match edges {
            Some(factor) => {
                Contradiction::Counts { joint, factor, measured, said: encoder.counts_per_turn.unsigned_abs() }
            }
            None => Contradiction::Gear { joint, gear: encoder.gear * measured, said: encoder.gear, measured },
        })
    }

    /// The encoder on the motor of a joint.
    fn encoder_of(&self, hello: &Hello, joint: usize) -> Option<usize> {
        hello.encoders.iter().position(|encoder| usize::from(encoder.joint) == joint && encoder.side == Side::Motor)
    }
}

/// A way from which on something has moved, rad: ten times what the noise of a gyro adds up to in a jog.
pub(super) const MOVED_RAD: f64 = 0.0015;
