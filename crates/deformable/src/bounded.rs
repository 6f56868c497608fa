//! Lists that never take new memory.

/// Adds an item when it fits without new memory; returns 1 when it does not.
pub fn push_bounded<T>(out: &mut Vec<T>, item: T) -> u32 {
    if out.len() == out.capacity() {
        return 1;
    }
    out.push(item);
    0
}
