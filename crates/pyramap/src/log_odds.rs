//! Log-odds (Eq. 3 to 5) and the fixed-point numbers that store them.
//!
//! Evidence is an integer multiple of [`UNIT`]. Integers add without rounding, so the map is the same
//! whatever the order of its frames, and a frame can be taken back exactly.

/// Fixed-point steps in a log-odd of one.
pub const STEPS: f32 = 4096.0;
/// One fixed-point step as a log-odd: 2^-12, a probability error of at most 3e-5.
pub const UNIT: f64 = 1.0 / STEPS as f64;

/// The log-odd of a probability (Eq. 4).
pub fn from_probability(p: f64) -> f64 {
    libm::log(p / (1.0 - p))
}

/// The probability of a log-odd (Eq. 5).
pub fn to_probability(log_odds: f64) -> f64 {
    1.0 - 1.0 / (1.0 + libm::exp(log_odds))
}

/// The nearest fixed-point number; saturates at the ends of `i32`.
pub fn to_fixed(log_odds: f64) -> i32 {
    (log_odds * f64::from(STEPS)).round_ties_even() as i32
}

/// The log-odd of a fixed-point number.
pub fn from_fixed(evidence: i32) -> f64 {
    f64::from(evidence) * UNIT
}

/// The range of stored evidence: that of `i32`, or less in a clamped map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// The smallest value.
    pub low: i32,
    /// The largest value.
    pub high: i32,
}

impl Limits {
    /// The sum within the limits, and whether `i32` was too small for it. Being clamped is no loss: it is asked for.
    #[inline(always)]
    pub fn add(self, value: i32, increment: i32) -> (i32, bool) {
        let sum = value.saturating_add(increment);
        (sum.clamp(self.low, self.high), sum != value.wrapping_add(increment))
    }
}
