//! Why an effect cannot be had.

/// Why an effect cannot be had.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EffectError {
    /// No such id.
    #[error("no effect `{id}`{suggestion}; `host effects` lists the {known} there are")]
    Unknown {
        /// What was asked for.
        id: String,
        /// How many there are.
        known: usize,
        /// "; did you mean …?" or nothing.
        suggestion: String,
    },
    /// Neither a name of a size nor a positive number.
    #[error("effect {effect}: size `{size}` is neither small, medium, large, a level as @-1.5, nor a positive number")]
    Size {
        /// Of which effect.
        effect: &'static str,
        /// What was given.
        size: String,
    },
    /// A time constant that the plant's step cannot follow.
    #[error("effect {effect}: {time_constant_s} s is too short to be simulated; give at least {least_s} s")]
    TooShort {
        /// Which effect.
        effect: &'static str,
        /// What was given.
        time_constant_s: f64,
        /// The shortest.
        least_s: f64,
    },
    /// The robot has nothing that the effect could act on.
    #[error("effect {effect}: {reason}")]
    Unsuited {
        /// Which effect.
        effect: &'static str,
        /// What the robot lacks.
        reason: &'static str,
    },
}

impl EffectError {
    pub(super) fn unknown<const N: usize>(id: &str, known: [&str; N]) -> Self {
        let nearest = known
            .iter()
            .map(|other| (strsim::jaro_winkler(id, other), other))
            .filter(|(likeness, _)| *likeness > 0.8)
            .max_by(|a, b| a.0.total_cmp(&b.0));
        let suggestion = nearest.map_or(String::new(), |(_, best)| format!("; did you mean `{best}`?"));
        Self::Unknown { id: id.to_owned(), known: N, suggestion }
    }
}
