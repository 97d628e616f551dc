//! Disjoint sets of numbers, joined as it is found that they belong together.

/// Numbers from 0 on in disjoint sets. Each points to another of its set that comes before it, the first to itself.
pub(crate) struct DisjointSets {
    before: Vec<u32>,
}

impl DisjointSets {
    /// Each number in a set of its own.
    pub(crate) fn new(count: usize) -> Self {
        Self { before: (0..count as u32).collect() }
    }

    /// The least number of the set that holds `n`.
    pub(crate) fn first(&self, mut n: u32) -> u32 {
        while self.before[n as usize] != n {
            n = self.before[n as usize];
        }
        n
    }

    /// Makes one set of the two that hold `a` and `b`.
    pub(crate) fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.shortened(a), self.shortened(b));
        self.before[a.max(b) as usize] = a.min(b);
    }

    /// [`Self::first`]; the way there is halved in passing, so that ways stay short.
    fn shortened(&mut self, mut n: u32) -> u32 {
        while self.before[n as usize] != n {
            self.before[n as usize] = self.before[self.before[n as usize] as usize];
            n = self.before[n as usize];
        }
        n
    }
}
