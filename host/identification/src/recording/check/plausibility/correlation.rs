//! How two quantities go together, their means taken off.

/// Sums of pairs.
#[derive(Debug, Default, Clone, Copy)]
pub(super) struct Correlation {
    pub count: usize,
    a: f64,
    b: f64,
    aa: f64,
    bb: f64,
    ab: f64,
}

impl Correlation {
    /// Of two columns, where both have a value.
    pub(super) fn of(a: &[f64], b: &[f64]) -> Self {
        let mut sums = Self::default();
        for (&a, &b) in a.iter().zip(b) {
            if !a.is_nan() && !b.is_nan() {
                sums.add(a, b);
            }
        }
        sums
    }

    fn add(&mut self, a: f64, b: f64) {
        self.count += 1;
        self.a += a;
        self.b += b;
        self.aa += a * a;
        self.bb += b * b;
        self.ab += a * b;
    }

    fn centred(&self) -> (f64, f64, f64) {
        let n = self.count.max(1) as f64;
        (self.aa - self.a * self.a / n, self.bb - self.b * self.b / n, self.ab - self.a * self.b / n)
    }

    /// −1 to 1; 0 if one of them is constant.
    pub(super) fn coefficient(&self) -> f64 {
        let (aa, bb, ab) = self.centred();
        let scale = (aa * bb).sqrt();
        if scale > 0.0 { ab / scale } else { 0.0 }
    }

    /// b over a, least squares.
    pub(super) fn gain(&self) -> f64 {
        let (aa, _, ab) = self.centred();
        ab / aa
    }
}
