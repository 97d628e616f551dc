//! What a map knows of a voxel: whether it is unknown, free or occupied.

use crate::block::Blocks;
use crate::log_odds::STEPS;

/// What a map knows of a voxel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(i8)]
pub enum State {
    /// Never seen, or seen with evidence that adds up to nothing.
    #[default]
    Unknown = -1,
    /// Seen, and not more likely occupied than free.
    Free = 0,
    /// More likely occupied than free.
    Occupied = 1,
}

/// Whether a question takes unknown space for free or for occupied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unknown {
    /// What nobody has seen is taken to be occupied: the safe answer.
    Occupied,
    /// What nobody has seen is taken to be free: the hopeful answer.
    Free,
}

/// Turns stored evidence into states: what separates free from occupied, as a whole number.
#[derive(Clone, Copy, Debug)]
pub struct Threshold(i32);

impl Threshold {
    /// That of a map: a voxel is occupied if its log-odds, prior included, are above 0.
    pub fn of(blocks: &(impl Blocks + ?Sized)) -> Self {
        // Evidence is a whole number of steps, so that evidence + prior > 0 just if it exceeds the whole part of -prior.
        Self((-blocks.prior_log_odds() * f64::from(STEPS)).floor() as i32)
    }

    /// The state of a voxel with this evidence.
    #[inline(always)]
    pub fn state(self, evidence: i32) -> State {
        // Not a branch first for what is unknown: there is nothing to guess it by.
        let known = if evidence > self.0 { State::Occupied } else { State::Free };
        if evidence == 0 { State::Unknown } else { known }
    }

    /// Whether a voxel with this evidence is occupied, or unknown and that is taken for it.
    #[inline(always)]
    pub fn blocked(self, evidence: i32, unknown: Unknown) -> bool {
        match self.state(evidence) {
            State::Occupied => true,
            State::Free => false,
            State::Unknown => unknown == Unknown::Occupied,
        }
    }
}
