//! Eight neighbouring lines of voxels at once, and one pass of a separable distance transform along them.
//!
//! Each voxel is on one of two sides and looks for the nearest on the other. Along the first axis that is counted. Along
//! the others squared distances to what lies off the line become squared distances to what lies anywhere in the plane
//! or in space: `after(v) = min over w of before(w) + (v - w)^2`, where `before(w)` is 0 if `w` itself is on the other
//! side. The search goes outwards from `v` until the way alone is as far as the best so far, which mostly is not far:
//! all in whole numbers, without a division, and eight lines in a register.

/// Squared distances, in voxels, at one place of eight neighbouring lines.
pub type Lanes = [u16; 8];

/// One place of eight lines.
#[derive(Clone, Copy)]
struct Place {
    squared: Lanes,
    /// All bits of a lane are set where its voxel is inside.
    sides: Lanes,
}

/// A part of eight lines.
#[derive(Default)]
pub struct Line {
    /// With as many places before the first and after the last as a search goes.
    places: Vec<Place>,
    radius: usize,
}

impl Line {
    /// Reads places, each given by its squared distances so far and a bit for each lane that is inside, for searches up
    /// to `radius` away.
    pub fn read(&mut self, radius: usize, places: impl ExactSizeIterator<Item = (Lanes, u8)>) {
        self.radius = radius;
        self.places.clear();
        self.places.resize(radius, Place { squared: NOTHING, sides: NOTHING });
        let places = places.map(|(squared, inside)| Place { squared, sides: LANES_OF_BITS[usize::from(inside)] });
        self.places.extend(places);
        // Beyond an end nothing changes sides: what is found there was found nearer already.
        let end_at = |place: Place| Place { squared: NOTHING, ..place };
        let (first, last) = (end_at(self.places[radius]), end_at(self.places[self.places.len() - 1]));
        self.places[..radius].fill(first);
        self.places.resize(self.places.len() + radius, last);
    }

    /// Sets all places to their squared distances along the line itself, whatever was read.
    pub fn count(&mut self) {
        let mut count = Count::new(self.places[0].sides);
        for place in &mut self.places {
            place.squared = count.step(&place.sides);
        }
        let mut count = Count::new(self.places[self.places.len() - 1].sides);
        for place in self.places.iter_mut().rev() {
            let after = count.step(&place.sides);
            for (squared, after) in place.squared.iter_mut().zip(after) {
                let steps = after.min(*squared);
                *squared = steps.saturating_mul(steps);
            }
        }
    }

    /// The squared distances at a place, counted from the first that was read, as they are.
    pub fn at(&self, place: usize) -> Lanes {
        self.places[place + self.radius].squared
    }

    /// The squared distances at a place to what lies anywhere within the radius along the line.
    #[inline]
    pub fn lower_envelope(&self, place: usize) -> Lanes {
        let (before, from_here) = self.places[place..=place + 2 * self.radius].split_at(self.radius);
        let (here, after) = from_here.split_first().expect("the place itself");
        let mut best = here.squared;
        // By index: the compiler keeps no count of two iterators that run apart.
        let after = &after[..before.len()];
        for i in 0..before.len() {
            let (step, before, after) = (i as u16 + 1, &before[before.len() - 1 - i], &after[i]);
            let way = step * step;
            if best.iter().fold(0, |open, lane| open | lane.saturating_sub(way)) == 0 {
                break;
            }
            for (l, best) in best.iter_mut().enumerate() {
                let seen = |other: &Place| (other.squared[l] & !(other.sides[l] ^ here.sides[l])).saturating_add(way);
                *best = seen(before).min(seen(after)).min(*best);
            }
        }
        best
    }
}

/// Steps since the lanes last changed sides.
struct Count {
    steps: Lanes,
    side: Lanes,
}

impl Count {
    fn new(side: Lanes) -> Self {
        Self { steps: NOTHING, side }
    }

    #[inline(always)]
    fn step(&mut self, side: &Lanes) -> Lanes {
        for ((steps, before), now) in self.steps.iter_mut().zip(&self.side).zip(side) {
            *steps = (*steps & !(before ^ now)).saturating_add(1);
        }
        self.side = *side;
        self.steps
    }
}

/// Nothing is near.
const NOTHING: Lanes = [u16::MAX; 8];

/// For each byte, its bits as lanes.
static LANES_OF_BITS: [Lanes; 256] = {
    let mut table = [[0; 8]; 256];
    let mut i = 0;
    while i < 256 * 8 {
        table[i / 8][i % 8] = if (i / 8) >> (i % 8) & 1 == 1 { u16::MAX } else { 0 };
        i += 1;
    }
    table
};

#[cfg(test)]
mod tests {
    use super::super::reach::MAX_RADIUS;
    use super::*;

    /// The largest radius, where squares come near to the end of 16 bits; each lane with voxels inside at other places.
    #[test]
    fn the_widest_searches_are_those_of_a_naive_one() {
        let inside = |place: usize| match place {
            7 => 0b0000_0001,
            290 => 0b0001_0110,
            291..600 if place.is_multiple_of(97) => 0b1000_0100,
            _ => 0,
        };
        let squared =
            |place: usize| [u16::MAX, 64_000, 3, 0, 40_000, 17, 9999, 60_000].map(|n| n / (place % 5 + 1) as u16);
        let mut line = Line::default();
        line.read(MAX_RADIUS, (0..600).map(|place| (squared(place), inside(place))));
        let mut counted = Line::default();
        counted.read(MAX_RADIUS, (0..600).map(|place| (squared(place), inside(place))));
        counted.count();
        let most = (MAX_RADIUS * MAX_RADIUS) as u32;
        for (place, lane) in (0..600).flat_map(|place| (0..8).map(move |lane| (place, lane))) {
            let side = |place: usize| inside(place) >> lane & 1;
            let nearest = |before: &dyn Fn(usize) -> u32| {
                let seen = |other: usize| match side(other) == side(place) {
                    true => before(other).saturating_add(other.abs_diff(place).pow(2) as u32),
                    false => other.abs_diff(place).pow(2) as u32,
                };
                (0..600).map(seen).min().unwrap().min(most + 1)
            };
            let cut = |squared: u16| u32::from(squared).min(most + 1);
            assert_eq!(cut(counted.at(place)[lane]), nearest(&|_| u32::MAX), "place {place}, lane {lane}");
            let expected = nearest(&|other| u32::from(squared(other)[lane]));
            assert_eq!(cut(line.lower_envelope(place)[lane]), expected, "place {place}, lane {lane}");
        }
    }
}
