//! Which row of a spherical image an elevation belongs to: a table, since beams need not lie evenly.

/// The row as a function of the elevation, linear between beams, and past the first and the last as between them and
/// their neighbours, by up to one row. It is tabulated at even steps of a sixteenth of the least distance of two beams,
/// which misplaces no point by more than a 64th of a row, and none that is half-way between two beams.
#[derive(Clone, Debug)]
pub struct Rows {
    /// The row, counted from the image's border, at the start of each interval, and its rise over the interval.
    pub entries: Vec<[f32; 2]>,
    /// The elevation at which the table starts.
    pub start: f32,
    /// Negative if elevations fall.
    pub intervals_per_radian: f32,
    mean_spacing: f64,
    widest_spacing: f64,
}

/// Intervals in the least distance of two beams.
const FINENESS: f64 = 16.0;

impl Rows {
    /// Tabulates elevations that all rise or all fall. A row alone is `lone` radians high.
    pub fn new(elevations: &[f64], lone: f64) -> Self {
        let spacing: Vec<f64> = elevations.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let [first, last] = [spacing.first(), spacing.last()].map(|spacing| spacing.copied().unwrap_or(-lone));
        // One more beam at either end.
        let mut knots = vec![elevations[0] - first];
        knots.extend_from_slice(elevations);
        knots.push(elevations[elevations.len() - 1] + last);

        let spacings = || spacing.iter().chain([&first]).map(|spacing| spacing.abs());
        let least = spacings().fold(f64::INFINITY, f64::min);
        let (start, span) = (knots[0], knots[knots.len() - 1] - knots[0]);
        let intervals = (span.abs() / least * FINENESS).ceil();
        let mut after = 1;
        let mut row_at = |interval: usize| {
            let elevation = start + span * interval as f64 / intervals;
            while after + 1 < knots.len() && (elevation - knots[after]) * span > 0.0 {
                after += 1;
            }
            // Knot 1 is the middle of row 0.
            after as f64 - 0.5 - (knots[after] - elevation) / (knots[after] - knots[after - 1])
        };
        let rows: Vec<f64> = (0..=intervals as usize).map(&mut row_at).collect();
        let rise = |i: usize| if i + 1 < rows.len() { rows[i + 1] - rows[i] } else { 0.0 };
        Self {
            entries: (0..rows.len()).map(|i| [rows[i] as f32, rise(i) as f32]).collect(),
            start: start as f32,
            intervals_per_radian: (intervals / span) as f32,
            mean_spacing: span.abs() / (knots.len() - 1) as f64,
            widest_spacing: spacings().fold(0.0, f64::max),
        }
    }

    /// The row of an elevation, counted from the image's border; beyond the table that at its end.
    #[inline(always)]
    pub fn row(&self, elevation: f32) -> f32 {
        let position = (elevation - self.start) * self.intervals_per_radian;
        let last = (self.entries.len() - 1) as f32;
        // Written as selects, so that NaN ends in the table too.
        let position = if position > 0.0 { position } else { 0.0 };
        let position = if position < last { position } else { last };
        // SAFETY: between 0 and the last entry's number, which is exact in `f32`.
        let index = unsafe { position.to_int_unchecked::<i32>() };
        let [row, rise] = unsafe { *self.entries.get_unchecked(index as usize) };
        row + (position - index as f32) * rise
    }

    /// From row to row on average, radians.
    pub fn mean_spacing(&self) -> f64 {
        self.mean_spacing
    }

    /// From row to row at most, radians.
    pub fn widest_spacing(&self) -> f64 {
        self.widest_spacing
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_beam_is_the_middle_of_its_row() {
        // Beams as uneven as those of real sensors.
        let elevations: Vec<f64> = (0..40).map(|i| 0.2 - 0.008 * f64::from(i) - 0.0001 * f64::from(i * i)).collect();
        for elevations in [elevations.clone(), elevations.into_iter().rev().collect(), vec![0.1]] {
            let rows = Rows::new(&elevations, 0.01);
            for (i, &elevation) in elevations.iter().enumerate() {
                // A 64th as the table is made, a thousandth for rounding.
                let off = f64::from(rows.row(elevation as f32)) - (i as f64 + 0.5);
                assert!(off.abs() < 1.0 / 64.0 + 1e-3, "row {i} is off by {off}");
            }
            for (i, pair) in elevations.windows(2).enumerate() {
                let off = f64::from(rows.row((0.5 * (pair[0] + pair[1])) as f32)) - (i as f64 + 1.0);
                assert!(off.abs() < 1e-3, "the border below row {i} is off by {off}");
            }
            // Half a row beyond the border, on the side of the first row and on that of the last.
            let [first, last] =
                if elevations[0] < elevations[elevations.len() - 1] { [-1.5, 1.5] } else { [1.5, -1.5] };
            assert!((rows.row(first) + 0.5).abs() < 1e-3);
            assert!((rows.row(last) - (elevations.len() as f32 + 0.5)).abs() < 1e-3);
        }
    }
}
