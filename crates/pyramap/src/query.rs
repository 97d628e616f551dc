//! Questions at points: log-odds, probability, and whether a voxel is free, occupied or unknown.

use crate::block::{BLOCK_VOXELS, Block, BlockKey, Blocks, NarrowBlockData, VoxelIndex, locate};
use crate::error::{Error, Result};
use crate::grid::OccupancyGrid;
use crate::log_odds;
use crate::ray::{each, floor, whole};
use crate::simd::{Instructions, Kernel, Simd};
use crate::state::{State, Threshold};
use crate::window::{Layout, Lookup, Window, window_for};
use rayon::prelude::*;

/// How values at voxel centres become values at points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// That of the voxel which contains the point.
    Nearest,
    /// Linear along each axis between the eight voxels whose centres surround the point.
    Trilinear,
}

impl OccupancyGrid {
    /// Log-odds at world points, metres: evidence plus prior, and 0 where unknown, as in [`Self::block_log_odds`].
    ///
    /// With [`Interpolation::Trilinear`] a point in an unknown voxel is unknown; anywhere else those of the eight
    /// surrounding voxels that are unknown are left out and the weights of the others scaled to a sum of one. So points
    /// are known or not by their voxels alone, and known ones are not drawn towards 0 where knowledge ends.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the first point that is not finite; or if the device fails.
    pub fn log_odds(&self, points: &[[f64; 3]], interpolation: Interpolation) -> Result<Vec<f32>> {
        let l_0 = self.prior_log_odds();
        match interpolation {
            Interpolation::Nearest => self.nearest(points, |evidence| known_log_odds(evidence, l_0)),
            Interpolation::Trilinear => self.trilinear(points, |evidence| match evidence {
                None => 0.0,
                Some(evidence) => (evidence + l_0) as f32,
            }),
        }
    }

    /// Probabilities of being occupied at world points (Eq. 5); the prior where unknown.
    ///
    /// What is interpolated are the log-odds, as in [`OccupancyGrid::log_odds`].
    ///
    /// # Errors
    /// As [`OccupancyGrid::log_odds`].
    pub fn probability(&self, points: &[[f64; 3]], interpolation: Interpolation) -> Result<Vec<f32>> {
        let l_0 = self.prior_log_odds();
        let probability = |evidence: f64| log_odds::to_probability(evidence + l_0) as f32;
        match interpolation {
            Interpolation::Nearest => self.nearest(points, |evidence| probability(log_odds::from_fixed(evidence))),
            Interpolation::Trilinear => self.trilinear(points, |evidence| probability(evidence.unwrap_or(0.0))),
        }
    }

    /// Whether the voxels at world points are unknown, free or occupied.
    ///
    /// # Errors
    /// As [`OccupancyGrid::log_odds`].
    pub fn state(&self, points: &[[f64; 3]]) -> Result<Vec<State>> {
        let threshold = Threshold::of(self);
        self.nearest(points, |evidence| threshold.state(evidence))
    }

    /// The keys of all blocks that hold something, sorted.
    pub fn block_coords(&self) -> Vec<BlockKey> {
        let mut keys = self.keys();
        keys.par_sort_unstable();
        keys
    }

    /// Log-odds of whole blocks, one after the other, each with `z` running fastest; 0 where unknown, evidence plus
    /// prior elsewhere.
    ///
    /// # Errors
    /// If the device fails, or has taken the map along.
    pub fn block_log_odds(&self, keys: &[BlockKey]) -> Result<Vec<f32>> {
        self.fetch()?;
        let l_0 = self.prior_log_odds();
        let mut out = vec![0.0; keys.len() * BLOCK_VOXELS];
        out.par_chunks_mut(BLOCK_VOXELS).zip(keys).for_each(|(out, &key)| match self.block(key) {
            None => {}
            Some(Block::Uniform(evidence)) => out.fill(known_log_odds(evidence, l_0)),
            Some(block) => {
                let voxels = out.iter_mut().zip(block.to_data());
                voxels.for_each(|(out, evidence)| *out = known_log_odds(evidence, l_0));
            }
        });
        Ok(out)
    }

    /// Answers by the evidence of the voxels that contain the points.
    fn nearest<T: Copy + Default + Send>(
        &self,
        points: &[[f64; 3]],
        answer: impl Fn(i32) -> T + Sync,
    ) -> Result<Vec<T>> {
        self.fetch()?;
        let (voxel_size, mut answers) = (self.voxel_size(), vec![T::default(); points.len()]);
        let chunks = answers.par_chunks_mut(CHUNK).zip(points.par_chunks(CHUNK)).with_min_len(16);
        let all_finite = match window_for(self, points.len(), Values::of(Block::Uniform(0)), Values::of) {
            Some(window) => {
                let (window, answer, instructions) = (&window, &answer, Instructions::widest());
                let find = |(answers, points): (&mut [T], &[_])| {
                    instructions.run(Find { window, voxel_size, points, answers, answer })
                };
                chunks.map(find).reduce(|| true, |one, other| one & other)
            }
            None => {
                let answer = |point: &[f64; 3]| answer(evidence(self, each(|a| floor(point[a] / voxel_size))));
                chunks.for_each(|(out, points)| out.iter_mut().zip(points).for_each(|(out, at)| *out = answer(at)));
                false
            }
        };
        if !all_finite {
            check_finite("points", points)?;
        }
        Ok(answers)
    }

    /// Answers by interpolated evidence.
    fn trilinear<T: Send>(&self, points: &[[f64; 3]], answer: impl Fn(Option<f64>) -> T + Sync) -> Result<Vec<T>> {
        check_finite("points", points)?;
        self.fetch()?;
        let (blocks, voxel_size) = (Lookup::new(self, points.len()), self.voxel_size());
        let answer = |point: &[f64; 3]| answer(interpolated(&blocks, each(|a| point[a] / voxel_size)));
        Ok(points.par_iter().with_min_len(1024).map(answer).collect())
    }
}

/// So many points at a time: first which voxels all of them are in, then what those hold.
const CHUNK: usize = 64;

/// The evidence of a block's voxels, in whatever form it is stored, as a sum of three numbers: to find it takes no branch,
/// and a processor that guesses the form of a block would often be wrong.
#[derive(Clone, Copy)]
struct Values<'a> {
    narrow: &'a NarrowBlockData,
    /// A number a voxel, or one for all.
    wide: &'a [i32],
    all: i32,
}

impl<'a> Values<'a> {
    fn of(block: Block<'a>) -> Self {
        const NOTHING: Values = Values { narrow: &[0; BLOCK_VOXELS], wide: &[0], all: 0 };
        match block {
            Block::Uniform(all) => Self { all, ..NOTHING },
            Block::Narrow(narrow) => Self { narrow, ..NOTHING },
            Block::Dense(wide) => Self { wide, ..NOTHING },
        }
    }

    #[inline(always)]
    fn get(&self, offset: usize) -> i32 {
        i32::from(self.narrow[offset]) + self.wide[offset & (self.wide.len() - 1)] + self.all
    }
}

/// Up to [`CHUNK`] points, answered by the voxels that contain them; gives whether all points are finite.
struct Find<'a, T, A> {
    window: &'a Window<Values<'a>>,
    voxel_size: f64,
    points: &'a [[f64; 3]],
    answers: &'a mut [T],
    answer: &'a A,
}

impl<T, A: Fn(i32) -> T> Kernel for Find<'_, T, A> {
    type Output = bool;

    #[inline(always)]
    fn run<S: Simd>(self) -> bool {
        let Self { window, voxel_size, points, answers, answer } = self;
        let (layout, mut all_finite) = (window.layout(), true);
        let (mut along, mut places, mut offsets) = ([[0; CHUNK]; 3], [0; CHUNK], [0; CHUNK]);
        for (a, along) in along.iter_mut().enumerate() {
            for (along, point) in along.iter_mut().zip(points) {
                *along = layout.along(a, whole(point[a] / voxel_size));
                all_finite &= point[a].abs() <= f64::MAX;
            }
        }
        for n in 0..CHUNK {
            let along = each(|a| along[a][n]);
            (places[n], offsets[n]) = (layout.place(along), Layout::offset(along));
        }
        let mut evidence = [0; CHUNK];
        for n in 0..points.len().min(CHUNK) {
            evidence[n] = window.at(places[n]).get(offsets[n] as usize % BLOCK_VOXELS);
        }
        answers.iter_mut().zip(evidence).for_each(|(out, evidence)| *out = answer(evidence));
        all_finite
    }
}

/// Stored evidence of a voxel; 0 wherever nothing is stored.
#[inline(always)]
fn evidence(blocks: &impl Blocks, voxel: VoxelIndex) -> i32 {
    let (key, offset) = locate(voxel);
    blocks.block(key).map_or(0, |block| block.value(offset))
}

/// Evidence as log-odds, interpolated between known voxels; `None` in unknown ones.
fn interpolated(blocks: &impl Blocks, point: [f64; 3]) -> Option<f64> {
    if evidence(blocks, each(|a| floor(point[a]))) == 0 {
        return None;
    }
    let first = each(|a| floor(point[a] - 0.5));
    let share = each(|a| point[a] - 0.5 - f64::from(first[a]));
    let mut last = (locate(first).0, None);
    last.1 = blocks.block(last.0);
    let (mut sum, mut weights) = (0.0, 0.0);
    for corner in 0..8 {
        let step = each(|a| corner >> (2 - a) & 1);
        let (key, offset) = locate(each(|a| first[a] + step[a]));
        if key != last.0 {
            last = (key, blocks.block(key));
        }
        let evidence = last.1.map_or(0, |block| block.value(offset));
        if evidence != 0 {
            let weight: f64 = each(|a| if step[a] == 1 { share[a] } else { 1.0 - share[a] }).iter().product();
            sum += weight * log_odds::from_fixed(evidence);
            weights += weight;
        }
    }
    // The voxel that contains the point has a weight of an eighth or more.
    Some(sum / weights)
}

/// Refuses rows that are not finite, by the name of the argument.
pub(crate) fn check_finite<const N: usize>(name: &'static str, rows: &[[f64; N]]) -> Result<()> {
    match first_row(rows, |row| row.iter().fold(false, |any, c| any | !c.is_finite())) {
        None => Ok(()),
        Some(row) => Err(Error::Parameter {
            name,
            got: format!("{:?} in row {row}", rows[row]),
            expected: "finite coordinates, metres".into(),
        }),
    }
}

/// The first row that is such; best without a branch in `such`, since nearly all are not.
pub(crate) fn first_row<const N: usize>(rows: &[[f64; N]], such: impl Fn(&[f64; N]) -> bool + Sync) -> Option<usize> {
    /// So many rows are looked through without asking whether one was found.
    const CHUNK: usize = 1024;
    let any = |rows: &[[f64; N]]| rows.iter().fold(false, |any, row| any | such(row));
    let first = CHUNK * rows.par_chunks(CHUNK).with_min_len(8).position_first(any)?;
    rows[first..].iter().position(such).map(|n| first + n)
}

pub(crate) fn known_log_odds(evidence: i32, l_0: f64) -> f32 {
    if evidence == 0 { 0.0 } else { (log_odds::from_fixed(evidence) + l_0) as f32 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::GridConfig;

    /// Points in and around a map, whatever instructions find their voxels.
    #[test]
    fn every_set_of_instructions_finds_the_same() {
        let mut grid = OccupancyGrid::new(GridConfig::new(0.5).unwrap()).unwrap();
        let mut wide = [0; BLOCK_VOXELS];
        wide.iter_mut().enumerate().for_each(|(n, value)| *value = n as i32 - 100);
        grid.put_block([0; 3], Block::Dense(&wide)).unwrap();
        let window = Window::new(&grid, [Values::of(Block::Uniform(0)); 2], Values::of).unwrap();
        let points: Vec<[f64; 3]> =
            (0..CHUNK).map(|n| each(|a| 3.0 + 3.5 * (n as f64 * (0.3 + a as f64)).sin())).collect();
        let found = |points: &[[f64; 3]], instructions: Instructions| {
            let mut answers = vec![0; points.len()];
            let (window, answer) = (&window, &|evidence| evidence);
            let finite = instructions.run(Find { window, voxel_size: 0.5, points, answers: &mut answers, answer });
            (answers, finite)
        };
        let naive: Vec<i32> = points.iter().map(|p| evidence(&grid, each(|a| (p[a] / 0.5).floor() as i32))).collect();
        assert!(naive.contains(&0) && naive.iter().any(|&value| value != 0));
        for instructions in Instructions::all() {
            assert_eq!(found(&points, instructions), (naive.clone(), true), "{instructions:?}");
            assert!(!found(&[[0.0, f64::NAN, 0.0]], instructions).1, "{instructions:?}");
        }
    }
}
