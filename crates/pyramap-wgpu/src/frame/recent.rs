//! What is made for the sensors and sensor models of the last frames, so that several take turns at no cost.

use pyramap::error::Result;

/// Of so many sensors it is kept.
pub const RECENT: usize = 4;

/// What was made for the keys that were last asked for, the last one first.
pub struct Recent<K, V>(Vec<(K, V)>);

impl<K, V> Default for Recent<K, V> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<K: PartialEq, V> Recent<K, V> {
    /// What belongs to a key; it is made unless it is there.
    ///
    /// # Errors
    /// As making it.
    pub fn get(&mut self, key: K, make: impl FnOnce(&K) -> Result<V>) -> Result<&V> {
        if let Some(known) = self.0.iter().position(|(of, _)| *of == key) {
            self.0[..=known].rotate_right(1);
        } else {
            let made = make(&key)?;
            self.0.truncate(RECENT - 1);
            self.0.insert(0, (key, made));
        }
        Ok(&self.0[0].1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_ones_are_kept() {
        let mut recent = Recent::default();
        let mut made = Vec::new();
        for key in [1, 2, 1, 3, 4, 1, 5, 2, 1] {
            let value = recent.get(key, |&key| {
                made.push(key);
                Ok(10 * key)
            });
            assert_eq!(*value.unwrap(), 10 * key);
        }
        assert_eq!(made, [1, 2, 3, 4, 5, 2], "2 was the one that nobody had asked for longest");
    }
}
