//! Files of HSCSM: any valid model comes back, and what only they can hold is refused.
#![allow(missing_docs, clippy::unwrap_used)]

use proptest::prelude::*;
use surfabet::hscsm::{self, order};
use surfabet::{HscsmModel, Save};
use surfabet_codec::bytes::ByteWriter;
use surfabet_codec::models::{SInt, UInt};
use surfabet_codec::{Encoder, Error, Features, Tag};
use surfabet_geom::morton::encode_wide;
use surfabet_models::hscsm::{
    Channel, Codes, HscsmModelParts, IntensityLimits, Level, PatchPose, QuantizedDictionary, Steps,
};
use surfabet_tests::contract::assert_usable;
use surfabet_tests::files::{codec_error, put_together, read, sections};

const TAGS: [&[u8; 4]; 6] = [b"META", b"POSE", b"MASK", b"DICT", b"DPTH", b"COLR"];

/// The header section, field by field as in `docs/format.md`, for one level.
#[derive(Clone, Copy)]
struct Meta {
    levels: u64,
    pixel_size: f64,
    pixels: u64,
    step: f64,
    patches: u64,
    depth_atoms: u64,
    color_atoms: u64,
    /// Low and high limit, with the feature "attributes".
    intensity: Option<[f64; 2]>,
}

impl Meta {
    fn bytes(&self) -> Vec<u8> {
        let mut out = ByteWriter::new();
        (0..3).for_each(|_| out.f64(0.0));
        out.varint(1);
        out.varint(self.levels);
        for _ in 0..self.levels.min(20) {
            out.f64(self.pixel_size);
            out.varint(self.pixels);
            (0..5).for_each(|_| out.f64(self.step));
            out.varint(self.patches);
            out.varint(self.depth_atoms);
            out.varint(self.color_atoms);
        }
        self.intensity.iter().flatten().for_each(|&limit| out.f64(limit));
        out.finish()
    }

    /// A file of these sections with the features of this header.
    fn file(&self, sections: &[(Tag, Vec<u8>)]) -> Vec<u8> {
        let features = self.intensity.map_or(Features::NONE, |_| Features::ATTRIBUTES);
        put_together::<HscsmModel>(features, sections)
    }
}

const SOUND: Meta = Meta {
    levels: 1,
    pixel_size: 0.01,
    pixels: 8,
    step: 0.0025,
    patches: 1,
    depth_atoms: 0,
    color_atoms: 0,
    intensity: None,
};

/// A file of nothing but a header: empty streams decode as zeros, which are sound for one plain patch.
fn bare(meta: &Meta) -> Vec<u8> {
    let empty = |tag: &&[u8; 4]| (Tag::new(tag), Vec::new());
    let mut all: Vec<_> = TAGS.iter().map(empty).collect();
    all[0].1 = meta.bytes();
    meta.file(&all)
}

#[test]
fn headers_that_promise_too_much_are_refused_by_name() {
    let file = |change: &dyn Fn(&mut Meta)| {
        let mut meta = SOUND;
        change(&mut meta);
        bare(&meta)
    };
    for patches in [999_999_999, 80_000, 40_000] {
        // 64 MiB hold 80 thousand patches at most.
        let error = codec_error::<HscsmModel>(&file(&|m| m.patches = patches));
        let named = matches!(
            error,
            Error::TooLarge { .. } | Error::Truncated { .. } | Error::Corrupt { .. }
        );
        assert!(named, "{patches}: {error:?}");
    }
    for (name, change) in [
        ("no pixels", &(|m: &mut Meta| m.pixels = 0) as &dyn Fn(&mut Meta)),
        ("negative steps", &|m| m.step = -1.0),
        ("zero steps", &|m| m.step = 0.0),
        ("many levels", &|m| m.levels = 17),
        ("a dictionary without bytes", &|m| m.depth_atoms = 65_536),
        ("a colour dictionary without bytes", &|m| m.color_atoms = 65_537),
    ] {
        let error = codec_error::<HscsmModel>(&file(change));
        let named = matches!(
            error,
            Error::TooLarge { .. } | Error::Truncated { .. } | Error::Corrupt { .. }
        );
        assert!(named, "{name}: {error:?}");
    }
}

#[test]
fn limits_of_no_intensities_are_refused_by_name() {
    let grey = Meta { color_atoms: 1, intensity: Some([-2.0, 6.0]), ..SOUND };
    let model: HscsmModel = read(&bare(&grey)).unwrap();
    assert_eq!(model.intensity(), Some(IntensityLimits { low: -2.0, high: 6.0 }));
    assert!(model.has_intensity() && !model.has_color());
    assert_eq!(model.to_bytes().unwrap(), bare(&grey));

    for limits in [[6.0, -2.0], [0.0, 1e39], [-f64::MAX, f64::MAX]] {
        let error = codec_error::<HscsmModel>(&bare(&Meta { intensity: Some(limits), ..grey }));
        assert!(error.to_string().contains("intensities from"), "{limits:?}: {error}");
    }
    for limits in [[f64::NAN, 1.0], [0.0, f64::NAN], [0.0, f64::INFINITY]] {
        let error = codec_error::<HscsmModel>(&bare(&Meta { intensity: Some(limits), ..grey }));
        assert!(matches!(error, Error::Corrupt { .. }), "{limits:?}: {error:?}");
    }
    // Without images there is nothing that the limits are of.
    let error = codec_error::<HscsmModel>(&bare(&Meta { color_atoms: 0, ..grey }));
    assert!(error.to_string().contains("a level without images"), "{error}");
    // Limits without the feature, and the feature without limits.
    let all = sections(&bare(&grey));
    let error = codec_error::<HscsmModel>(&SOUND.file(&all));
    assert!(matches!(error, Error::TrailingBytes { .. }), "{error:?}");
    let all = sections(&bare(&Meta { intensity: None, ..grey }));
    let error = codec_error::<HscsmModel>(&grey.file(&all));
    assert!(matches!(error, Error::Truncated { .. }), "{error:?}");
}

#[test]
fn codes_beyond_the_dictionary_are_refused() {
    // A mean of zero, then a code of three entries, where the dictionary has none.
    let mut stream = Encoder::new();
    stream.sint(&mut SInt::new(), 0);
    stream.uint(&mut UInt::new(), 3);
    let mut all = sections(&bare(&SOUND));
    all.iter_mut().find(|(t, _)| *t == Tag::new(b"DPTH")).unwrap().1 = stream.finish();
    let error = codec_error::<HscsmModel>(&SOUND.file(&all));
    assert!(
        matches!(&error, Error::Corrupt { section, .. } if *section == Tag::new(b"DPTH")),
        "{error:?}"
    );
    assert!(error.to_string().contains("a code of 3 in 0 entries"), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn random_streams_never_panic(
        streams in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..120), 5),
        patches in 0_u64..200,
        pixels in 2_u64..33,
        atoms in prop::array::uniform2(0_u64..20),
        pixel_size in prop_oneof![Just(0.01), Just(1e-300), Just(1e300), 0.001..1.0],
        step in prop_oneof![Just(0.0025), Just(1e-300), Just(1e300), 0.0001..1.0],
        intensity in prop::option::of(Just([-1e30, f64::from(f32::MAX)])),
    ) {
        let [depth_atoms, color_atoms] = atoms;
        let meta =
            Meta { patches, pixels, depth_atoms, color_atoms, pixel_size, step, intensity, ..SOUND };
        let mut all = sections(&bare(&meta));
        for (section, stream) in all[1..].iter_mut().zip(streams) {
            section.1 = stream;
        }
        if let Ok(model) = read::<HscsmModel>(&meta.file(&all)) {
            assert_usable(&model);
        }
    }
}

/// Codes of `patches` patches in a dictionary of `n_atoms` entries.
fn codes(patches: usize, n_atoms: usize) -> impl Strategy<Value = Codes> {
    let most = n_atoms.min(5);
    let entry =
        (0..n_atoms.max(1) as u16, prop_oneof![-9..0, 1..10, Just(i32::MIN), Just(i32::MAX)]);
    let code = prop::collection::btree_map(
        entry.clone().prop_map(|e| e.0),
        entry.prop_map(|e| e.1),
        0..=most,
    );
    prop::collection::vec(code, patches).prop_map(|all| {
        let mut codes = Codes { offsets: vec![0], ..Codes::default() };
        for code in all {
            codes.atoms.extend(code.keys());
            codes.coefficients.extend(code.values());
            codes.offsets.push(codes.atoms.len() as u32);
        }
        codes
    })
}

fn channel(patches: usize, area: usize, planes: usize) -> impl Strategy<Value = Channel> {
    (0_usize..6, any::<bool>()).prop_flat_map(move |(n_atoms, wide)| {
        let range = if wide { i16::MIN..=i16::MAX } else { -128..=127 };
        let features = area * planes;
        let values = prop::collection::vec(prop_oneof![-9_i16..10, range], n_atoms * features)
            .prop_map(move |mut values| {
                // No entry may be all zero.
                values
                    .chunks_mut(features)
                    .filter(|c| c.iter().all(|v| *v == 0))
                    .for_each(|c| c[0] = 1);
                QuantizedDictionary::new(features, values).unwrap()
            });
        let means = prop::collection::vec(prop_oneof![-20..20, any::<i32>()], patches * planes);
        (values, means, codes(patches, n_atoms)).prop_map(|(dictionary, means, codes)| Channel {
            dictionary,
            means,
            codes,
        })
    })
}

fn level() -> impl Strategy<Value = Level> {
    let far = hscsm::MAX_POSITION;
    let coordinate = prop_oneof![4 => -300..300, 1 => -far..=far];
    let pose = (prop::array::uniform3(coordinate), prop::array::uniform2(-63_i16..=63))
        .prop_map(|(position, normal)| PatchPose { position, normal });
    let size = (2_u32..7, 0_u32..3);
    (size, prop::collection::vec(pose, 0..12), 0.001..1.0).prop_flat_map(
        |((pixels, doublings), poses, pixel_size)| {
            let mask_scale = 1 << doublings;
            let (area, n) = ((pixels * pixels) as usize, poses.len());
            let color = prop::option::of(channel(n, area, 3));
            let mask_area = area * (mask_scale * mask_scale) as usize;
            // Some pixels with all, some with none of their mask pixels.
            let mask = prop::collection::vec(prop_oneof![Just(0_u8), Just(1), 0_u8..2], 1..9)
                .prop_map(move |v: Vec<u8>| -> Vec<u8> {
                    (0..mask_area).map(|i| v[i * v.len() / mask_area]).collect()
                });
            let mask = prop_oneof![mask, prop::collection::vec(0_u8..2, mask_area)];
            let masks =
                prop::collection::vec(mask, n).prop_map(|masks: Vec<Vec<u8>>| masks.concat());
            (masks, channel(n, area, 1), color).prop_map(move |(masks, depth, color)| {
                let position = 0.25 * pixel_size;
                let mut poses = poses.clone();
                let side = order::steps_per_cell(pixel_size, pixels, position);
                let (_, cells) = order::cells(&poses, side);
                let mut keyed: Vec<_> = cells.into_iter().map(encode_wide).zip(poses).collect();
                keyed.sort();
                poses = keyed.into_iter().map(|(_, pose)| pose).collect();
                let steps = Steps {
                    position,
                    depth_mean: 0.002,
                    depth_code: 0.01,
                    color_mean: 5.0,
                    color_code: 50.0,
                };
                Level { pixel_size, pixels, steps, mask_scale, poses, masks, depth, color }
            })
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn any_valid_model_comes_back(
        levels in prop::collection::vec(level(), 0..4),
        origin in prop::array::uniform3(-1e7..1e7),
        n_points: u64,
        low in -1e9..0.0,
        high in prop::option::of(0.0..1e9),
    ) {
        let has_images = levels.iter().all(|level| level.color.is_some());
        let limits = high.map(|high| IntensityLimits { low, high });
        let intensity = limits.filter(|_| has_images);
        let parts = HscsmModelParts {
            origin,
            n_points,
            levels,
            intensity,
            shares_vocabulary: false,
            one_dictionary: false,
        };
        let model = HscsmModel::from_parts(parts.clone()).unwrap();
        let bytes = model.to_bytes().unwrap();
        prop_assert_eq!(read::<HscsmModel>(&bytes).unwrap(), model);

        // The first level three times, with its dictionaries stored once.
        let levels = parts.levels.first().map(|level| vec![level.clone(); 3]).unwrap_or_default();
        let of = |one_dictionary| HscsmModelParts { levels: levels.clone(), one_dictionary, ..parts.clone() };
        let [once, thrice] = [true, false].map(|one| HscsmModel::from_parts(of(one)).unwrap());
        let [bytes, more] = [&once, &thrice].map(|model| model.to_bytes().unwrap());
        prop_assert_eq!(read::<HscsmModel>(&bytes).unwrap(), once);
        // The section by itself is not longer; what says so in the header is at most 16 bytes.
        prop_assert!(bytes.len() <= more.len() + 16);
    }
}
