//! What a message is said to cost, against the memory that decoding it takes. One test, because it
//! counts the memory of the whole process.

use chefshat_proto::cost::{Cost, Filling, shapes};
use peak_alloc::PeakAlloc;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Longest message that is tried, bytes.
const LONGEST: usize = 16 * 1024;
const MOST: Cost = Cost {
    elements: 100_000,
    memory: 64 * 1024 * 1024,
};

#[test]
fn decoding_takes_no_more_memory_than_a_message_costs() {
    let (mut decoded, mut grew) = (0, 0);
    for method in shapes::METHODS {
        for filling in Filling::all(method.request) {
            let message = filling.longest(LONGEST);
            let cost = (method.request.cost(&message, MOST)).expect("within what is allowed");
            let take = || {
                MEMORY.reset_peak_usage();
                let before = MEMORY.current_usage();
                let request = (method.decode)(&message);
                let taken = MEMORY.peak_usage() - before;
                drop(request.expect("it can be decoded"));
                taken
            };
            // What the thread of the test runner allocates meanwhile only adds.
            let mut taken = take();
            for _ in 0..10 {
                if taken > cost.memory {
                    taken = taken.min(take());
                }
            }
            assert!(
                taken <= cost.memory,
                "{}: {} of {} bytes takes {taken} bytes, and costs {cost:?}",
                method.path,
                filling.name,
                message.len()
            );
            decoded += 1;
            grew = grew.max(taken / message.len().max(1));
        }
    }
    assert!(decoded > 1_000, "only {decoded} messages");
    assert!(grew > 50, "no message grew more than {grew} times");
}
