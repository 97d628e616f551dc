//! A pass along one axis, over those lines only that something was changed on.

use super::line::{Lanes, Line};
use super::reach::Reach;
use super::tile::{Tile, UNCHANGED, UNTOUCHED, bits, input, next_place, output};
use super::tiles::{Slot, Tiles};
use crate::block::{BLOCK_EDGE, BlockKey};
use rayon::prelude::*;
use std::array;

/// Computes again what changes on lines along `AXIS` because of the `touched` tiles; gives the tiles that are touched for
/// the next pass.
pub fn sweep<const AXIS: usize>(tiles: &mut Tiles, touched: &[Slot], reach: Reach) -> Vec<Slot> {
    let slots = tiles.beside::<AXIS>(touched, reach.blocks_read());
    let mut picked = tiles.pick(&slots);
    picked.sort_unstable_by_key(|tile| row_and_place::<AXIS>(tile.key));
    // What lies on the other side of a gap is too far away to matter: whatever is near to anything has a tile.
    let adjacent = |one: &&mut Tile, next: &&mut Tile| {
        let ((row, place), next) = (row_and_place::<AXIS>(one.key), row_and_place::<AXIS>(next.key));
        next == (row, place + 1)
    };
    picked.par_chunk_by_mut(adjacent).for_each_init(Line::default, |line, run| {
        let changes: [Vec<u16>; BLOCK_EDGE] = array::from_fn(|group| changes::<AXIS>(run, group, reach));
        run.iter_mut().for_each(|tile| tile.touched = UNTOUCHED);
        for (group, changes) in changes.iter().enumerate() {
            let affected = affected::<AXIS>(run, group, changes, reach);
            affected
                .chunk_by(|one, next| next - one <= 2 * reach.radius())
                .for_each(|places| compute::<AXIS>(line, run, group, places, reach));
        }
    });
    slots.into_iter().filter(|&slot| tiles.tile(slot).is_touched()).collect()
}

/// The line of blocks that a block is in, and where.
fn row_and_place<const AXIS: usize>(key: BlockKey) -> ([i32; 2], i32) {
    ([key[(AXIS + 1) % 3], key[(AXIS + 2) % 3]], key[AXIS])
}

/// Where a group of lines has changed: of each place, the least squared distance that was or is there; nothing at all if
/// none has. Before the first place and after the last stand as many unchanged ones as anything reaches.
fn changes<const AXIS: usize>(run: &[&mut Tile], group: usize, reach: Reach) -> Vec<u16> {
    let ends = reach.radius();
    let mut changes = Vec::new();
    for (at, tile) in run.iter().enumerate().filter(|(_, tile)| tile.is_touched()) {
        for place in 0..BLOCK_EDGE {
            // To those who look for its old side, or its new one, a voxel that changed sides is a place at no distance.
            let flipped = bits::<AXIS>(&tile.flips, group, place) != 0;
            let least = if flipped { 0 } else { tile.touched[group * BLOCK_EDGE + place] };
            if least != UNCHANGED {
                changes.resize(run.len() * BLOCK_EDGE + 2 * ends, UNCHANGED);
                changes[ends + at * BLOCK_EDGE + place] = least;
            }
        }
    }
    changes
}

/// The places of a group of lines whose values may change: those that are as near to the other side, or nearer, by way
/// of a change than they were. To all others the change makes no difference.
fn affected<const AXIS: usize>(run: &[&mut Tile], group: usize, changes: &[u16], reach: Reach) -> Vec<usize> {
    let farthest = |at: usize| {
        let squared = &run[at / BLOCK_EDGE].squared[AXIS];
        (0..BLOCK_EDGE).map(|lane| squared[output::<AXIS>(group, at % BLOCK_EDGE, lane)]).fold(0, u16::max)
    };
    let by_changes = by_way_of(changes, reach.radius());
    let near = by_changes.into_iter().enumerate().filter(|(_, squared)| *squared <= reach.beyond());
    near.filter(|&(at, squared)| squared <= farthest(at)).map(|(at, _)| at).collect()
}

/// The lower envelope of changes, without the unchanged ends.
fn by_way_of(changes: &[u16], radius: usize) -> Vec<u16> {
    let Some(places) = changes.len().checked_sub(2 * radius) else { return Vec::new() };
    let mut envelope = changes[radius..][..places].to_vec();
    for step in 1..=radius {
        let way = (step * step) as u16;
        let sides = changes[radius - step..].iter().zip(&changes[radius + step..]);
        for (squared, (before, after)) in envelope.iter_mut().zip(sides) {
            *squared = (*squared).min((*before).min(*after).saturating_add(way));
        }
    }
    envelope
}

/// Computes places of a group of lines, given in their order, and notes what changed.
fn compute<const AXIS: usize>(line: &mut Line, run: &mut [&mut Tile], group: usize, places: &[usize], reach: Reach) {
    let (radius, beyond) = (reach.radius(), reach.beyond());
    let first = places[0].saturating_sub(radius);
    let end = (places[places.len() - 1] + radius + 1).min(run.len() * BLOCK_EDGE);
    line.read(
        radius,
        (first..end).map(|at| {
            let (tile, place) = (&run[at / BLOCK_EDGE], at % BLOCK_EDGE);
            (load::<AXIS>(tile, group, place), bits::<AXIS>(&tile.inside, group, place))
        }),
    );
    if AXIS == 0 {
        line.count();
    }
    for &at in places {
        let squared = if AXIS == 0 { line.at(at - first) } else { line.lower_envelope(at - first) };
        store::<AXIS>(&mut *run[at / BLOCK_EDGE], group, at % BLOCK_EDGE, squared.map(|squared| squared.min(beyond)));
    }
}

/// What the pass before left at a place; the first has nothing to go by.
#[inline(always)]
fn load<const AXIS: usize>(tile: &Tile, group: usize, place: usize) -> Lanes {
    if AXIS == 0 {
        return [0; BLOCK_EDGE];
    }
    let lanes = &tile.squared[AXIS - 1][input(group, place)..][..BLOCK_EDGE];
    array::from_fn(|lane| lanes[lane])
}

#[inline(always)]
fn store<const AXIS: usize>(tile: &mut Tile, group: usize, place: usize, squared: Lanes) {
    for (lane, new) in squared.into_iter().enumerate() {
        let old = &mut tile.squared[AXIS][output::<AXIS>(group, place, lane)];
        if new != *old {
            let least = new.min(*old);
            *old = new;
            if AXIS < 2 {
                let touched = &mut tile.touched[next_place::<AXIS>(group, place, lane)];
                *touched = least.min(*touched);
            }
        }
    }
}
