//! A pass along one axis, over those lines only that something was changed on.

use super::line::{Lanes, Line};
use super::reach::Reach;
use super::tile::{Tile, UNTOUCHED, bits, input, next_place, output};
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

/// Where a group of lines has changed: of each place, the least squared distance that was or is there. Before the first
/// place and after the last stand as many unchanged ones as anything reaches.
fn changes<const AXIS: usize>(run: &[&mut Tile], group: usize, reach: Reach) -> Vec<u16> {
    let ends = reach.radius() + 1;
    let mut changes = vec![u16::MAX; run.len() * BLOCK_EDGE + 2 * ends];
    let places = changes[ends..].chunks_mut(BLOCK_EDGE);
    for (changes, tile) in places.zip(run).filter(|(_, tile)| tile.is_touched()) {
        for (place, change) in changes.iter_mut().enumerate() {
            // To those who look for its old side, or its new one, a voxel that changed sides is a place at no distance.
            let flipped = bits::<AXIS>(&tile.flips, group, place) != 0;
            *change = if flipped { 0 } else { tile.touched[group * BLOCK_EDGE + place] };
        }
    }
    changes
}

/// The places of a group of lines whose values may change: those that a changed place was, or is, the nearest to.
fn affected<const AXIS: usize>(run: &[&mut Tile], group: usize, changes: &[u16], reach: Reach) -> Vec<usize> {
    let ends = reach.radius() + 1;
    let mut within_reach = vec![false; changes.len()];
    for (at, &least) in changes.iter().enumerate() {
        if let Some(far) = reach.left_after(least) {
            within_reach[at - far..=at + far].fill(true);
        }
    }
    let is_affected = |at: &usize| {
        let tile = &run[at / BLOCK_EDGE];
        let now = |lane| tile.squared[AXIS][output::<AXIS>(group, at % BLOCK_EDGE, lane)];
        let farthest = (0..BLOCK_EDGE).map(now).fold(0, u16::max);
        is_near_change(&changes[*at..=at + 2 * ends], farthest)
    };
    (0..run.len() * BLOCK_EDGE).filter(|at| within_reach[at + ends]).filter(is_affected).collect()
}

/// Whether the place in the middle is as near to the other side, or nearer, by way of a change than it was: if not, the
/// change makes no difference to it.
fn is_near_change(changes: &[u16], squared: u16) -> bool {
    let (before, from_here) = changes.split_at(changes.len() / 2);
    let pairs = before.iter().rev().zip(&from_here[1..]).map(|(before, after)| *before.min(after));
    let nearest = std::iter::once(from_here[0]).chain(pairs);
    (0_u16..).map(|step| step * step).zip(nearest).take_while(|(way, _)| *way <= squared).any(|(way, least)| least <= squared - way)
}

/// Computes places of a group of lines, given in their order, and notes what changed.
fn compute<const AXIS: usize>(line: &mut Line, run: &mut [&mut Tile], group: usize, places: &[usize], reach: Reach) {
    let (radius, beyond) = (reach.radius(), reach.beyond());
    let first = places[0].saturating_sub(radius);
    let end = (places[places.len() - 1] + radius + 1).min(run.len() * BLOCK_EDGE);
    line.read(radius, (first..end).map(|at| {
        let (tile, place) = (&run[at / BLOCK_EDGE], at % BLOCK_EDGE);
        (load::<AXIS>(tile, group, place), bits::<AXIS>(&tile.inside, group, place))
    }));
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
