//! What can be split.

/// A random path that is made step by step, one at a time in the same place.
pub trait Path {
    /// Everything of it at one instant, random numbers included.
    type Saved;
    /// Why a path cannot be begun.
    type Error;

    /// Begins anew, with random numbers of a seed.
    ///
    /// # Errors
    /// Where there is no such path.
    fn begin(&mut self, noise_seed: u64) -> Result<(), Self::Error>;

    /// Goes on by a step; false, and nothing else, where it is at its end.
    fn step(&mut self) -> bool;

    /// How near the event it has come so far: the larger, the nearer. It never falls.
    fn score(&self) -> f64;

    /// Everything as it is now.
    fn save(&self) -> Self::Saved;

    /// Becomes what was saved and goes on with the same bits as if it had never been left; with a `noise_seed`, all that is drawn
    /// from now on is drawn from it and nothing else changes.
    fn restore(&mut self, saved: &Self::Saved, noise_seed: Option<u64>);
}
