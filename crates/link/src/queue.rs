//! Bounded ring buffers between two threads, in order; values that do not fit are dropped and
//! counted.
//!
//! # Practice
//! All memory is allocated at creation. Sending and receiving are wait-free and cost about 10 ns
//! plus the copy (60 ns for a tick record, both ends). Size a ring for the longest pause of its
//! receiver: 1 kHz of records and a recorder that may stall for 2 s need 2048 slots.
//!
//! # When not to use it
//! When only the newest value matters: use [`crate::cell`].

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// The sending end.
#[derive(Debug)]
pub struct Sender<T> {
    ring: rtrb::Producer<T>,
    dropped: Arc<AtomicU64>,
}

/// The receiving end.
#[derive(Debug)]
pub struct Receiver<T> {
    ring: rtrb::Consumer<T>,
    dropped: Arc<AtomicU64>,
}

/// Creates a ring of `capacity` slots.
///
/// ```
/// let (mut sender, mut receiver) = trepan_link::queue::bounded(2);
/// assert!(sender.send('a') && sender.send('b') && !sender.send('c'));
/// assert_eq!((receiver.receive(), receiver.dropped()), (Some('a'), 1));
/// ```
pub fn bounded<T>(capacity: usize) -> (Sender<T>, Receiver<T>) {
    let (producer, consumer) = rtrb::RingBuffer::new(capacity);
    let dropped = Arc::new(AtomicU64::new(0));
    (Sender { ring: producer, dropped: dropped.clone() }, Receiver { ring: consumer, dropped })
}

impl<T> Sender<T> {
    /// Sends a value; false if the ring was full and the value was dropped and counted.
    pub fn send(&mut self, value: T) -> bool {
        let sent = self.ring.push(value).is_ok();
        if !sent {
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
        sent
    }

    /// Number of values dropped since creation.
    pub fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed)
    }

    /// Whether the receiver was dropped.
    pub fn is_abandoned(&self) -> bool {
        self.ring.is_abandoned()
    }
}

impl<T> Receiver<T> {
    /// Receives the oldest value.
    pub fn receive(&mut self) -> Option<T> {
        self.ring.pop().ok()
    }

    /// Number of waiting values.
    pub fn waiting(&self) -> usize {
        self.ring.slots()
    }

    /// Number of values dropped since creation.
    pub fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed)
    }

    /// Whether the sender was dropped; values may still wait.
    pub fn is_abandoned(&self) -> bool {
        self.ring.is_abandoned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn order_is_kept_and_losses_are_counted_on_both_sides() {
        let (mut sender, mut receiver) = bounded(4);
        let sent = (0..10).filter(|&i| sender.send(i)).count();
        assert_eq!((sent, receiver.waiting(), sender.dropped(), receiver.dropped()), (4, 4, 6, 6));
        assert_eq!(std::iter::from_fn(|| receiver.receive()).collect::<Vec<_>>(), [0, 1, 2, 3]);
        assert!(sender.send(10));
        drop(sender);
        assert!(receiver.is_abandoned());
        assert_eq!(receiver.receive(), Some(10));
    }

    #[test]
    fn across_threads_nothing_is_lost_that_was_accepted() {
        let (mut sender, mut receiver) = bounded(64);
        let sending = std::thread::spawn(move || (0..10_000u32).filter(|&i| sender.send(i)).count());
        let mut received = Vec::new();
        while !(receiver.is_abandoned() && receiver.waiting() == 0) {
            received.extend(receiver.receive());
        }
        assert_eq!(received.len(), sending.join().unwrap());
        assert_eq!(received.len() as u64 + receiver.dropped(), 10_000);
        assert!(received.is_sorted());
    }
}
