//! The adaptive models of `surfabet-entropy`, here because every section of a file is written with them; their
//! tests with the coder.

pub use surfabet_entropy::{Bit, SInt, Symbols, UInt};

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use proptest::test_runner::{RngAlgorithm, TestRng};

    use super::*;
    use crate::container::Tag;
    use crate::entropy::{Decoder, Encoder};
    use crate::error::Result;

    const TEST: Tag = Tag::new(b"TEST");

    /// The stream of `values`, checked to decode to them, and the sum of their costs in bits.
    fn coded<T: Copy + PartialEq + std::fmt::Debug, M: Clone>(
        values: &[T],
        model: &M,
        cost: impl Fn(&M, T) -> f32,
        encode: impl Fn(&mut Encoder, &mut M, T),
        decode: impl Fn(&mut Decoder<'_>, &mut M) -> Result<T>,
    ) -> (Vec<u8>, f64) {
        let (mut encoder, mut encoding) = (Encoder::new(), model.clone());
        let mut bits = 0.0;
        for value in values {
            bits += f64::from(cost(&encoding, *value));
            encode(&mut encoder, &mut encoding, *value);
        }
        let bytes = encoder.finish();
        let (mut decoder, mut decoding) = (Decoder::new(TEST, &bytes), model.clone());
        decoder.check_count("values", values.len() as u64).unwrap();
        for value in values {
            assert_eq!(decode(&mut decoder, &mut decoding), Ok(*value));
        }
        decoder.finish().unwrap();
        (bytes, bits)
    }

    fn coded_bits(values: &[bool], model: &Bit) -> (Vec<u8>, f64) {
        coded(values, model, Bit::cost, Encoder::bit, |d, m| d.bit(m))
    }

    fn coded_uints(values: &[u32], model: &UInt) -> (Vec<u8>, f64) {
        coded(values, model, UInt::cost, Encoder::uint, |d, m| d.uint(m))
    }

    fn coded_sints(values: &[i32], model: &SInt) -> (Vec<u8>, f64) {
        coded(values, model, SInt::cost, Encoder::sint, |d, m| d.sint(m))
    }

    fn coded_symbols(values: &[u32], model: &Symbols) -> (Vec<u8>, f64) {
        coded(values, model, Symbols::cost, Encoder::symbol, |d, m| d.symbol(m))
    }

    /// Numbers uniform in [0, 1).
    fn uniforms(count: usize) -> impl Iterator<Item = f64> {
        let mut random = TestRng::deterministic_rng(RngAlgorithm::ChaCha);
        (0..count).map(move |_| f64::from(random.next_u32()) / 2.0_f64.powi(32))
    }

    /// Bits that the values take with the best fixed code for their frequencies.
    fn empirical_bits<T: Ord + Copy>(values: &[T]) -> f64 {
        let mut sorted = values.to_vec();
        sorted.sort_unstable();
        let total = values.len() as f64;
        let run_bits = |run: &[T]| run.len() as f64 * (total / run.len() as f64).log2();
        sorted.chunk_by(|a, b| a == b).map(run_bits).sum()
    }

    /// Small and extreme integers alike.
    fn any_size_u32() -> impl Strategy<Value = u32> {
        prop_oneof![
            0_u32..20,
            any::<u32>(),
            (0_u32..32, any::<u32>()).prop_map(|(shift, value)| value >> shift),
            (0_u32..=32, -2_i64..2)
                .prop_map(|(e, near)| ((1_i64 << e) + near).clamp(0, u32::MAX.into()) as u32),
        ]
    }

    proptest! {
        #[test]
        fn bits_round_trip_from_any_state(values: Vec<bool>, memory: u16, before: Vec<bool>) {
            let mut bit = Bit::with_memory(memory);
            before.into_iter().for_each(|value| bit.update(value));
            coded_bits(&values, &bit);
        }

        #[test]
        fn uints_round_trip(values in prop::collection::vec(any_size_u32(), 0..300)) {
            coded_uints(&values, &UInt::new());
        }

        #[test]
        fn sints_round_trip(values in prop::collection::vec(any_size_u32(), 0..300)) {
            let values: Vec<i32> = values.into_iter().map(u32::cast_signed).collect();
            coded_sints(&values, &SInt::new());
        }

        #[test]
        fn symbols_round_trip(
            (size, values) in (1_u32..=Symbols::MAX_SIZE)
                .prop_flat_map(|size| (Just(size), prop::collection::vec(0..size, 0..300))),
        ) {
            coded_symbols(&values, &Symbols::new(size)?);
        }

        #[test]
        fn garbage_never_leaves_the_alphabet(bytes: Vec<u8>, size in 1_u32..300) {
            let (mut decoder, mut model) = (Decoder::new(TEST, &bytes), Symbols::new(size)?);
            for _ in 0..1000 {
                match decoder.symbol(&mut model) {
                    Ok(symbol) => prop_assert!(symbol < size),
                    Err(_) => break,
                }
            }
        }
    }

    #[test]
    fn all_extremes_round_trip() {
        let uints = [0, 1, 2, 6, 7, u32::MAX - 2, u32::MAX - 1, u32::MAX, 1 << 31, (1 << 31) - 1];
        coded_uints(&uints, &UInt::new());
        let sints = [0, 1, -1, i32::MIN, i32::MAX, i32::MIN + 1];
        coded_sints(&sints, &SInt::new());
        coded_symbols(&[0; 40], &Symbols::new(1).unwrap());
        coded_symbols(&[0, 65535, 1], &Symbols::new(1 << 16).unwrap());
        assert!(Symbols::new(0).is_err());
        assert!(Symbols::new((1 << 16) + 1).is_err());
    }

    #[test]
    fn an_alphabet_of_one_takes_no_bytes() {
        assert!(coded_symbols(&[0; 100], &Symbols::new(1).unwrap()).0.is_empty());
    }

    #[test]
    fn short_streams_cost_what_krichevsky_and_trofimov_say() {
        // -log2 of their estimate is below that of the best fixed probability plus log2(n) / 2 + 1, whatever
        // the values; the coder adds at most a byte and what probabilities of 16 bits lose.
        let mut uniforms = uniforms(1 << 20);
        for n in [1_usize, 2, 3, 5, 10, 30, 100, 255] {
            for ones in [0, 1, n / 10, n / 3, n / 2, n - 1, n] {
                let mut values: Vec<bool> = (0..n).map(|i| i < ones).collect();
                for i in (1..n).rev() {
                    let j = (uniforms.next().unwrap() * (i + 1) as f64) as usize;
                    values.swap(i, j);
                }
                let bound = empirical_bits(&values) + 0.5 * (n as f64).log2() + 1.0;
                let (bytes, bits) = coded_bits(&values, &Bit::new());
                let stream = 8.0 * bytes.len() as f64;
                assert!(stream <= bound + 8.1, "{n} {ones}: {stream} > {bound}");
                // The sum of costs to the precision of their table.
                assert!(bits <= bound + 0.002 * n as f64 + 0.1, "{n} {ones}: {bits} > {bound}");
            }
        }
    }

    #[test]
    fn the_fast_start_beats_a_fixed_rate() {
        // 100 equal bits: log2 of 1 / P = log2(pi) / 2 + log2(100) / 2 + small = 4.15 bits. An average with
        // the fixed rate of the steady state, as without the start, takes 70.
        let mut fixed = Bit::new();
        (0..2 * Bit::DEFAULT_MEMORY).for_each(|i| fixed.update(i % 2 == 0));
        let (fast, fast_bits) = coded_bits(&[true; 100], &Bit::new());
        let (slow, slow_bits) = coded_bits(&[true; 100], &fixed);
        assert!((fast_bits - 4.15).abs() < 0.2, "{fast_bits}");
        assert!(slow_bits > 65.0, "{slow_bits}");
        assert!(fast.len() <= 2 && slow.len() >= 8);
    }

    #[test]
    fn long_stationary_bits_are_within_two_percent_of_their_entropy() {
        for (probability, memory) in
            [(0.5, 255), (0.2, 255), (0.05, 255), (0.02, 255), (0.01, 1023)]
        {
            let values: Vec<bool> = uniforms(200_000).map(|u| u < probability).collect();
            let (bytes, bits) = coded_bits(&values, &Bit::with_memory(memory));
            let ideal = empirical_bits(&values);
            let stream = 8.0 * bytes.len() as f64;
            assert!(stream <= 1.02 * ideal + 32.0, "{probability}: {stream} {ideal}");
            assert!(
                (bits - stream).abs() <= 0.005 * stream + 32.0,
                "{probability}: {bits} {stream}"
            );
        }
    }

    #[test]
    fn long_stationary_integers_are_within_two_percent_of_their_entropy() {
        for mean in [0.1, 0.5, 2.0, 10.0, 50.0] {
            // Geometric with this mean.
            let ratio: f64 = mean / (1.0 + mean);
            let values: Vec<u32> =
                uniforms(200_000).map(|u| ((1.0 - u).ln() / ratio.ln()) as u32).collect();
            let entropy = ((1.0 + mean) * (1.0 + mean).log2() - mean * mean.log2()) * 200_000.0;
            let (bytes, bits) = coded_uints(&values, &UInt::new());
            let stream = 8.0 * bytes.len() as f64;
            assert!(stream <= 1.02 * entropy + 400.0, "{mean}: {}", stream / entropy);
            assert!((bits - stream).abs() <= 0.005 * stream + 32.0, "{mean}: {bits} {stream}");

            let signed: Vec<i32> = values
                .iter()
                .zip(uniforms(400_000).skip(200_000))
                .map(|(v, u)| if u < 0.5 { *v as i32 } else { -(*v as i32) })
                .collect();
            let nonzero = values.iter().filter(|v| **v != 0).count() as f64;
            let (bytes, bits) = coded_sints(&signed, &SInt::new());
            let stream = 8.0 * bytes.len() as f64;
            assert!(stream <= 1.02 * (entropy + nonzero) + 400.0, "{mean}: {stream}");
            assert!((bits - stream).abs() <= 0.005 * stream + 32.0, "{mean}: {bits} {stream}");
        }
    }

    #[test]
    fn long_stationary_symbols_are_within_two_percent_of_their_entropy() {
        for size in [2_u32, 5, 16, 37] {
            // The square skews the frequencies to small symbols.
            let values: Vec<u32> =
                uniforms(200_000).map(|u| (u * u * f64::from(size)) as u32).collect();
            let (bytes, bits) = coded_symbols(&values, &Symbols::new(size).unwrap());
            let stream = 8.0 * bytes.len() as f64;
            let ideal = empirical_bits(&values);
            // A few bits to learn each of the size - 1 nodes.
            assert!(stream <= 1.02 * ideal + 10.0 * f64::from(size), "{size}: {stream} {ideal}");
            assert!((bits - stream).abs() <= 0.005 * stream + 32.0, "{size}: {bits} {stream}");
        }
    }

    #[test]
    fn change_is_followed() {
        let values: Vec<bool> = (0..20_000).map(|i| i >= 10_000).collect();
        let (bytes, _) = coded_bits(&values, &Bit::new());
        // From a probability of 2^-12 at 1/257 per step: about 257 steps of 12 bits and falling.
        assert!(bytes.len() < 257 * 12 / 8, "{}", bytes.len());
    }
}
