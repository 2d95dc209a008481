//! Many flights at once.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

/// Calls `make` for 0, 1, ... below `count`, taken in this order by so many threads, and gives what it made in this order.
///
/// Within, rayon has one thread: whole flights are side by side and never the parts of one, so that no thread that waits for
/// a part begins another flight on top, and memory is that of one flight a thread. Where the system gives no thread at all,
/// the calling one does the work.
pub fn in_parallel<T: Send>(count: usize, threads: usize, make: &(dyn Fn(usize) -> T + Sync)) -> Vec<T> {
    let next = AtomicUsize::new(0);
    let take = || {
        let number = next.fetch_add(1, Ordering::Relaxed);
        (number < count).then(|| (number, make(number)))
    };
    let work = || {
        // Without a pool of its own, parts of a flight go to that of all: slower, with the same bits.
        let _single = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build();
        std::iter::from_fn(take).collect::<Vec<_>>()
    };
    let mut made: Vec<_> = thread::scope(|scope| {
        let started = (0..threads.min(count)).map_while(|_| thread::Builder::new().spawn_scoped(scope, work).ok());
        let started: Vec<_> = started.collect();
        let done =
            started.into_iter().map(|thread| thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        done.flatten().collect()
    });
    made.extend(std::iter::from_fn(take));
    made.sort_by_key(|&(number, _)| number);
    made.into_iter().map(|(_, made)| made).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_made_comes_in_order_once_each_for_any_number_of_threads() {
        for threads in [0, 1, 2, 7, 100] {
            let made = in_parallel(50, threads, &|number| number * number);
            assert!(made.iter().enumerate().all(|(number, &square)| square == number * number), "{threads}");
            assert_eq!(made.len(), 50);
        }
        assert_eq!(in_parallel(0, 4, &|number| number), [] as [usize; 0]);
    }

    #[test]
    fn within_a_flight_there_is_one_thread() {
        let threads = in_parallel(8, 2, &|_| rayon::current_num_threads());
        assert_eq!(threads, [1; 8]);
    }
}
