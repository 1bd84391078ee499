//! A diagnosis with one of everything, for the tests of what is told of it.

use crate::calibrate::{
    Calibration, ChannelFit as Fit, ChannelNoise, NoiseSource, ParameterEstimate, Preset, Seconds, Status,
};
use crate::diagnose::{
    BaseFit, Candidate, ChannelFit, ChannelGain, Defect, Diagnosis, Finding, Flag, Gain, HoldoutGain, HorizonGain,
    NotTestable, OverTime, Picture, Rejected, Rival, Stability, Unexplained, Verdict,
};
use crate::effect::Row;
use crate::robot::Robot;

/// Every flag.
pub(crate) const FLAGS: [Flag; 7] = [
    Flag::Implausible,
    Flag::AtBoundary,
    Flag::OwnPhase,
    Flag::SingleEvent,
    Flag::NotConstant,
    Flag::ChannelWorse,
    Flag::NotShownByHoldout,
];

/// Numbers and texts of a diagnosis: `number` is what every figure is, `text` what every free text holds.
pub(crate) fn diagnosis(number: f64, text: &str) -> Diagnosis {
    let gain = |share: f64| Gain { share, ci95: Some([share - 0.1 * number, share + 0.1 * number]), blocks: 24 };
    let finding = |effect: &str, share: f64, flags: &[Flag]| Finding {
        effect: effect.into(),
        axes: vec![2],
        row: Row::Motor,
        score: number,
        p_value: number,
        explained_excess: number,
        cv_gain: gain(number),
        holdout_gain: Some(gain(share * number)),
        coverage: number,
        stability: Some(Stability { q: number, dof: 23, p: number }),
        weight: number,
        flags: flags.to_vec(),
        acts_like: Some(format!("acts like {text}")),
        shape_final: false,
        parameters: vec![ParameterEstimate {
            name: format!("{effect}.dv[2]"),
            unit: "N m s/rad".into(),
            initial: number,
            estimate: number,
            std_error: Some(0.1 * number),
            ci95: Some([0.8 * number, 1.2 * number]),
            identifiable: true,
        }],
        aliases: vec!["stribeck".into(), text.into()],
        rivals: vec![Rival { effect: "quadratic_drag".into(), axes: vec![1], score: number, weight: number }],
        gain: vec![ChannelGain {
            horizon_s: 0.5,
            channel: "encoder2".into(),
            rmse_base: number,
            rmse_extended: 0.6 * number,
            gain: 0.4 * number,
            ci95: None,
        }],
    };
    let count = 200_u32;
    let wave = |phase: f64| (0..count).map(|k| number * (0.1 * f64::from(k) + phase).sin()).collect::<Vec<f64>>();
    Diagnosis {
        verdict: Verdict::Named,
        summary: format!("The base model does not fit {text}. The model lacks something."),
        base_fit: BaseFit {
            fits: false,
            chi2_per_dof: vec![
                ChannelFit { channel: "encoder2".into(), value: number },
                ChannelFit { channel: "process.qd[2]".into(), value: number },
            ],
            ahead_500ms_sigma: vec![ChannelFit { channel: "encoder2".into(), value: number }],
            sentence: format!("The base model does not fit {text}."),
        },
        findings: vec![finding("asymmetric_friction", 0.2, &[]), finding("cogging", 0.4, &FLAGS)],
        rejected: vec![Rejected { effect: "encoder_lag".into(), axes: vec![1], why: format!("predicts worse {text}") }],
        holdout_gain: Some(HoldoutGain {
            share: gain(0.5 * number).share,
            ci95: gain(0.5 * number).ci95,
            blocks: gain(0.5 * number).blocks,
            by_horizon: vec![HorizonGain::of(0.5, gain(-0.5 * number))],
            over_time: vec![OverTime {
                channel: "encoder2".into(),
                unit: "rad".into(),
                t_s: (0..count).map(|k| 0.6 + 0.1 * f64::from(k)).collect(),
                measured: wave(0.0),
                base: wave(0.3),
                extended: wave(0.1),
            }],
        }),
        unexplained: Unexplained {
            excess: number,
            ahead_500ms_sigma: vec![ChannelFit { channel: "encoder2".into(), value: number }],
            places: vec![Defect { row: Row::Link, axis: Some(2), argument: "windup_rate".into(), share: number }],
        },
        not_testable: vec![NotTestable { effect: "gyro_lag".into(), why: format!("effect gyro_lag: {text}") }],
        scan: vec![Candidate {
            effect: "cogging".into(),
            axes: vec![2],
            score: number,
            cv_score: number,
            p_value: number,
            vif: None,
        }],
        threshold_p: 0.01,
        curves: vec![Picture {
            row: Row::Motor,
            axis: 2,
            argument: "motor_speed".into(),
            argument_unit: "rad/s".into(),
            at: (0..count).map(|k| 0.1 * f64::from(k) - 10.0).collect(),
            torque: wave(0.0),
            unit: "N m".into(),
            score: number,
        }],
        holdout: Some(text.into()),
        base: calibration(),
        extended: calibration(),
    }
}

fn calibration() -> Calibration {
    Calibration {
        robot: "doggy".into(),
        robot_toml: Robot::builtin("doggy").unwrap().toml().into(),
        preset: Preset::Default,
        noise_source: NoiseSource::Estimated,
        extensions: Vec::new(),
        recordings: Vec::new(),
        status: Status::Converged,
        iterations: 9,
        factorisations: 7,
        cost: 50.0,
        dof: 100.0,
        seconds: Seconds { start: 0.1, noise: 0.3, linearise: 0.4, factor: 0.6, solve: 0.5, total: 1.6 },
        parameters: Vec::new(),
        unobservable: Vec::new(),
        rotations: Default::default(),
        noise: vec![ChannelNoise {
            channel: "encoder2".into(),
            unit: "rad".into(),
            sigma: 1e-3,
            floor: None,
            freedom: Some(0.99),
            chi2_per_dof: None,
            left_out: 0,
        }],
        misfit: Vec::new(),
        notes: Vec::new(),
        pushes: Vec::new(),
        scatter: None,
        fit: vec![Fit { channel: "encoder2".into(), rms: Some(1e-3), nrmse: None }],
        first_states: Vec::new(),
        covariance: Default::default(),
        correlations: Vec::new(),
    }
}
