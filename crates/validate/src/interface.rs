//! What a file of claims is told, and how it answers.

use rayon::prelude::*;

use super::claim::Claim;

/// Counts further units of finished work, from any thread.
pub(super) type Progress<'a> = dyn Fn(u64) + Sync + 'a;

/// Why claims could not be tried: a law, a scenario or a flight failed. It cannot happen in a program that works.
pub(super) type Untried = Box<dyn std::error::Error + Send + Sync>;

/// Claims, judged.
pub(super) type Judged = Result<Vec<Claim>, Untried>;

/// The claim of this name as `claims.json` states it: it fails until it is judged.
pub(super) fn stated(id: &str) -> Result<Claim, Untried> {
    let claims: Vec<Claim> = serde_json::from_str(include_str!("claims.json"))?;
    claims.into_iter().find(|claim| claim.id == id).ok_or_else(|| format!("there is no claim {id}").into())
}

/// Tries each of these in parallel, a unit of work each; the results are in their order.
pub(super) fn try_each<T: Sync, R: Send>(
    trials: &[T],
    progress: &Progress<'_>,
    attempt: impl Fn(&T) -> Result<R, Untried> + Sync,
) -> Result<Vec<R>, Untried> {
    trials.par_iter().map(|trial| attempt(trial).inspect(|_| progress(1))).collect()
}
