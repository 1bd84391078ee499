//! Two halves of the work on a chain at once.

/// Runs both, on two threads where there are more than one. A panic of either is one of the caller's.
pub fn both<A: Send, B>(threads: usize, left: impl FnOnce() -> A + Send, right: impl FnOnce() -> B) -> (A, B) {
    if threads <= 1 {
        return (left(), right());
    }
    std::thread::scope(|scope| {
        let left = scope.spawn(left);
        let right = right();
        (left.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)), right)
    })
}
