//! Decisions with the inputs of their estimates, recorded for the training of the networks. Without the feature `trace` nothing is
//! recorded, and nothing of this is left.

/// Numbers of the decisions in what is recorded.
pub(super) const ANY: u8 = 0;
pub(super) const NONZERO: u8 = 1;
pub(super) const NEGATIVE: u8 = 2;
pub(super) const EXPONENT: u8 = 3;

/// Bytes of a record: the decision, its outcome, its inputs, and zeros.
#[cfg(feature = "trace")]
const RECORD: usize = 34;

#[cfg(feature = "trace")]
std::thread_local! {
    static RECORDS: std::cell::RefCell<Vec<u8>> = const { std::cell::RefCell::new(Vec::new()) };
}

/// What fields that this thread read or wrote have decided since the last call, a record of 34 bytes each.
#[cfg(feature = "trace")]
#[doc(hidden)]
#[must_use]
pub fn decisions() -> Vec<u8> {
    RECORDS.take()
}

/// Records a decision.
#[cfg(feature = "trace")]
pub(super) fn record(decision: u8, inputs: &[&[i16]], outcome: bool) {
    let mut bytes = vec![decision, u8::from(outcome)];
    // Between -64 and 64.
    bytes.extend(inputs.iter().copied().flatten().map(|&x| x as i8 as u8));
    bytes.resize(RECORD, 0);
    RECORDS.with_borrow_mut(|all| all.extend(bytes));
}

#[cfg(not(feature = "trace"))]
pub(super) fn record(_: u8, _: &[&[i16]], _: bool) {}
