//! `.sfb` files that are damaged, hostile, random, or old.
#![allow(missing_docs, clippy::unwrap_used)]

use proptest::prelude::*;
use surfabet::hscsm::{self, order};
use surfabet::{
    CloudParts, Container, DecodeOptions, Family, HscsmModel, HscsmOptions, Model, PointCloud,
    Silent,
};
use surfabet_codec::bytes::ByteWriter;
use surfabet_codec::models::{SInt, UInt};
use surfabet_codec::{ContainerWriter, Encoder, Error, Features, Tag};
use surfabet_geom::morton::encode_wide;
use surfabet_models::hscsm::{
    Channel, Codes, HscsmModelParts, Level, PatchPose, QuantizedDictionary, Steps,
};
use surfabet_tests::{
    LIMITS, assert_cuts_are_errors, assert_flipped_bits_are_noticed, assert_same_numbers, golden,
};

const TAGS: [&[u8; 4]; 6] = [b"META", b"POSE", b"MASK", b"DICT", b"DPTH", b"COLR"];

/// A striped dome of 0.3 m: a few patches with depth and colour codes.
fn small_model() -> HscsmModel {
    let mut parts = CloudParts { origin: [10.0, -20.0, 5.0], ..CloudParts::default() };
    let mut colors = Vec::new();
    for i in 0..900 {
        let (x, y) = ((i % 30) as f32 * 0.01, (i / 30) as f32 * 0.01);
        let (dx, dy) = (x - 0.15, y - 0.15);
        parts.positions.push([x, y, -4.0 * (dx * dx + dy * dy)]);
        let stripe = i % 30 / 3 % 2 == 0;
        colors.push(if stripe { [220, 40, 30] } else { [20, 90, 200] });
    }
    parts.colors = Some(colors);
    let cloud = PointCloud::from_parts(parts).unwrap().0;
    let options = HscsmOptions {
        resolution: 0.02,
        patch_pixels: 6,
        depth_atoms: 4,
        color_atoms: 4,
        iterations: 2,
        ..HscsmOptions::default()
    };
    let model = hscsm::learn(&cloud, &options, &Silent).unwrap();
    let level = &model.levels()[0];
    assert!(!level.depth.codes.atoms.is_empty());
    assert!(!level.color.as_ref().unwrap().codes.atoms.is_empty());
    model
}

fn small_file() -> Vec<u8> {
    Model::from(small_model()).to_bytes().unwrap()
}

fn read(file: &[u8]) -> Result<HscsmModel, surfabet::Error> {
    match Model::from_bytes(file, &LIMITS)? {
        Model::Hscsm(model) => Ok(model),
        other => panic!("a model of family {}", other.family()),
    }
}

fn codec_error(file: &[u8]) -> Error {
    match read(file) {
        Err(surfabet::Error::Codec(error)) => error,
        other => panic!("{other:?}"),
    }
}

/// The sections of a file, to be changed and put together again with valid checksums.
fn sections(file: &[u8]) -> Vec<(Tag, Vec<u8>)> {
    let container = Container::parse(file, &LIMITS).unwrap();
    container.sections().iter().map(|s| (s.tag, s.bytes.to_vec())).collect()
}

fn put_together(sections: &[(Tag, Vec<u8>)]) -> Vec<u8> {
    let writer = ContainerWriter::new(Family::Patches, Features::NONE);
    sections.iter().fold(writer, |w, (tag, bytes)| w.section(*tag, bytes.clone())).finish().unwrap()
}

/// The small file with other bytes in one section.
fn with_section(tag: &[u8; 4], bytes: Vec<u8>) -> Vec<u8> {
    let mut all = sections(&small_file());
    all.iter_mut().find(|(t, _)| *t == Tag::new(tag)).unwrap().1 = bytes;
    put_together(&all)
}

/// Whatever was read must be usable: it decodes, and is written to bytes that give it back.
fn assert_sound(model: &HscsmModel) {
    let options = DecodeOptions { max_points: 100_000, normals: true, ..DecodeOptions::default() };
    let _ = model.decode(options, &Silent);
    let coarse = DecodeOptions { resolution: Some(1.0), ..options };
    let _ = model.decode(coarse, &Silent);
    let bytes = Model::from(model.clone()).to_bytes().unwrap();
    assert_eq!(read(&bytes).unwrap().levels(), model.levels());
}

/// The header section, field by field as in `docs/format.md`, for one level.
#[derive(Clone)]
struct Meta {
    origin: f64,
    levels: u64,
    pixel_size: f64,
    pixels: u64,
    step: f64,
    patches: u64,
    depth_atoms: u64,
    color_atoms: u64,
}

impl Meta {
    fn bytes(&self) -> Vec<u8> {
        let mut out = ByteWriter::new();
        (0..3).for_each(|_| out.f64(self.origin));
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
        out.finish()
    }
}

const SOUND: Meta = Meta {
    origin: 0.0,
    levels: 1,
    pixel_size: 0.01,
    pixels: 8,
    step: 0.0025,
    patches: 1,
    depth_atoms: 0,
    color_atoms: 0,
};

/// A file of nothing but a header: empty streams decode as zeros, which are sound for one plain patch.
fn bare(meta: &Meta) -> Vec<u8> {
    let empty = |tag: &&[u8; 4]| (Tag::new(tag), Vec::new());
    let mut all: Vec<_> = TAGS.iter().map(empty).collect();
    all[0].1 = meta.bytes();
    put_together(&all)
}

#[test]
fn every_truncation_is_an_error() {
    assert_cuts_are_errors(&small_file());
}

#[test]
fn every_flipped_bit_is_an_error_or_changes_nothing() {
    assert_flipped_bits_are_noticed(&small_file());
}

#[test]
fn damage_behind_valid_checksums_never_panics() {
    let all = sections(&small_file());
    for at in 0..all.len() {
        for bit in 0..8 * all[at].1.len() {
            let mut damaged = all.clone();
            damaged[at].1[bit / 8] ^= 1 << (bit % 8);
            if let Ok(model) = read(&put_together(&damaged)) {
                assert_sound(&model);
            }
        }
        for length in 0..all[at].1.len() {
            let mut damaged = all.clone();
            damaged[at].1.truncate(length);
            if let Ok(model) = read(&put_together(&damaged)) {
                assert_sound(&model);
            }
        }
    }
}

#[test]
fn hostile_headers_are_refused_by_name() {
    let file = |change: &dyn Fn(&mut Meta)| {
        let mut meta = SOUND;
        change(&mut meta);
        bare(&meta)
    };
    for patches in [u64::MAX, 1 << 40, 999_999_999, 1_000_001, 80_000, 40_000] {
        // 64 MiB hold 80 thousand patches at most.
        let error = codec_error(&file(&|m| m.patches = patches));
        let named = matches!(
            error,
            Error::TooLarge { .. } | Error::Truncated { .. } | Error::Corrupt { .. }
        );
        assert!(named, "{patches}: {error:?}");
    }
    for (name, change) in [
        ("no pixels", &(|m: &mut Meta| m.pixels = 0) as &dyn Fn(&mut Meta)),
        ("many pixels", &|m| m.pixels = 33),
        ("huge pixels", &|m| m.pixels = u64::MAX),
        ("NaN steps", &|m| m.step = f64::NAN),
        ("negative steps", &|m| m.step = -1.0),
        ("zero steps", &|m| m.step = 0.0),
        ("infinite pixel", &|m| m.pixel_size = f64::INFINITY),
        ("NaN origin", &|m| m.origin = f64::NAN),
        ("many levels", &|m| m.levels = 17),
        ("huge levels", &|m| m.levels = u64::MAX),
        ("huge dictionary", &|m| m.depth_atoms = u64::MAX),
        ("a dictionary without bytes", &|m| m.depth_atoms = 65_536),
        ("a colour dictionary without bytes", &|m| m.color_atoms = 65_537),
    ] {
        let error = codec_error(&file(change));
        let named = matches!(
            error,
            Error::TooLarge { .. } | Error::Truncated { .. } | Error::Corrupt { .. }
        );
        assert!(named, "{name}: {error:?}");
    }
}

#[test]
fn codes_beyond_the_dictionary_are_refused() {
    // A mean of zero, then a code of three entries, where the dictionary has none.
    let mut stream = Encoder::new();
    stream.sint(&mut SInt::new(), 0);
    stream.uint(&mut UInt::new(), 3);
    let mut all = sections(&bare(&SOUND));
    all.iter_mut().find(|(t, _)| *t == Tag::new(b"DPTH")).unwrap().1 = stream.finish();
    let error = codec_error(&put_together(&all));
    assert!(
        matches!(&error, Error::Corrupt { section, .. } if *section == Tag::new(b"DPTH")),
        "{error:?}"
    );
    assert!(error.to_string().contains("a code of 3 in 0 entries"), "{error}");
}

#[test]
fn trailing_bytes_are_refused_everywhere() {
    let file = small_file();
    let mut longer = file.clone();
    longer.push(0);
    assert!(matches!(codec_error(&longer), Error::TrailingBytes { .. }));
    for (tag, bytes) in sections(&file) {
        let mut longer = bytes.clone();
        longer.extend([1; 16]);
        let error = codec_error(&with_section(&tag.as_bytes(), longer));
        assert!(
            matches!(error, Error::TrailingBytes { section, .. } if section == tag),
            "{error:?}"
        );
    }
}

#[test]
fn sections_must_be_the_ones_of_the_family() {
    let all = sections(&small_file());
    for at in 0..all.len() {
        let mut fewer = all.clone();
        let (missing, _) = fewer.remove(at);
        assert_eq!(codec_error(&put_together(&fewer)), Error::MissingSection { section: missing });
    }
    let strange = Tag::new(b"WHAT");
    let mut more = all.clone();
    more.push((strange, vec![1, 2, 3]));
    assert!(
        matches!(codec_error(&put_together(&more)), Error::UnknownSection { section, .. } if section == strange)
    );
    // A small first letter says that it may be skipped.
    let mut more = all.clone();
    more.push((Tag::new(b"what"), vec![1, 2, 3]));
    assert_eq!(read(&put_together(&more)).unwrap(), read(&small_file()).unwrap());
}

/// The small file with one byte of its header changed and the header's checksum made to match.
fn with_header_byte(at: usize, value: u8) -> Vec<u8> {
    let mut file = small_file();
    let overhead = Container::parse(&file, &LIMITS).unwrap().overhead();
    file[at] = value;
    let checksum = crc32c::crc32c(&file[..overhead - 4]);
    file[overhead - 4..overhead].copy_from_slice(&checksum.to_le_bytes());
    file
}

#[test]
fn other_families_features_and_versions_are_refused_by_name() {
    assert!(read(&with_header_byte(7, Family::Patches as u8)).is_ok());
    let planes = with_header_byte(7, Family::Planes as u8);
    let container = Container::parse(&planes, &LIMITS).unwrap();
    assert_eq!(
        surfabet_codec::hscsm::read(&container, &LIMITS, None).unwrap_err(),
        Error::WrongFamily { expected: Family::Patches, found: Family::Planes }
    );
    assert!(read(&planes).is_err());
    assert!(matches!(
        codec_error(&with_header_byte(7, 99)),
        Error::UnknownFamily { found: 99, .. }
    ));
    let feature = codec_error(&with_header_byte(8, 0x40));
    assert!(matches!(feature, Error::UnknownFeature { bits: 0x40, .. }), "{feature:?}");
    assert!(feature.to_string().contains("or newer"));
    assert!(matches!(
        codec_error(&with_header_byte(4, 9)),
        Error::UnsupportedVersion { found: 9, .. }
    ));
    assert!(matches!(codec_error(b"ply\nformat ascii 1.0"), Error::NotSfb { .. }));
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
    ) {
        let [depth_atoms, color_atoms] = atoms;
        let meta =
            Meta { patches, pixels, depth_atoms, color_atoms, pixel_size, step, ..SOUND };
        let mut all = sections(&bare(&meta));
        for (section, stream) in all[1..].iter_mut().zip(streams) {
            section.1 = stream;
        }
        if let Ok(model) = read(&put_together(&all)) {
            assert_sound(&model);
        }
    }

    #[test]
    fn random_headers_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..120)) {
        if let Ok(model) = read(&with_section(b"META", bytes)) {
            assert_sound(&model);
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
    (0_usize..6).prop_flat_map(move |n_atoms| {
        let features = area * planes;
        let values = prop::collection::vec(prop_oneof![-9_i8..10, any::<i8>()], n_atoms * features)
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
    (2_u32..7, prop::collection::vec(pose, 0..12), 0.001..1.0).prop_flat_map(
        |(pixels, poses, pixel_size)| {
            let (area, n) = ((pixels * pixels) as usize, poses.len());
            let color = prop::option::of(channel(n, area, 3));
            let masks = prop::collection::vec(0_u8..2, n * area);
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
                Level { pixel_size, pixels, steps, poses, masks, depth, color }
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
    ) {
        let parts = HscsmModelParts { origin, n_points, levels, shared_dictionary: false };
        let model = HscsmModel::from_parts(parts).unwrap();
        let bytes = Model::from(model.clone()).to_bytes().unwrap();
        prop_assert_eq!(read(&bytes).unwrap(), model);
    }
}

/// One line per decoded point: position in the world, metres, and colour.
fn listing(model: &HscsmModel) -> String {
    let options = DecodeOptions { resolution: Some(0.04), ..DecodeOptions::default() };
    let cloud = model.decode(options, &Silent).unwrap();
    let colors = cloud.colors().unwrap();
    let line = |i: usize| {
        let ([x, y, z], [r, g, b]) = (cloud.world(i), colors[i]);
        format!("{x:.7} {y:.7} {z:.7} {r} {g} {b}\n")
    };
    (0..cloud.len()).map(line).collect()
}

/// Writes the golden file of this release. Run once per release, before it is published:
/// `cargo test -p surfabet-tests --test sfb -- --ignored`.
#[test]
#[ignore = "writes tests/golden; files of a published release must never change"]
fn write_golden() {
    let model = small_model();
    Model::from(model.clone()).save(golden("hscsm_0_1.sfb")).unwrap();
    std::fs::write(golden("hscsm_0_1.txt"), listing(&model)).unwrap();
}

#[test]
fn files_of_release_0_1_stay_readable() {
    let file = std::fs::read(golden("hscsm_0_1.sfb")).unwrap();
    let container = Container::parse(&file, &LIMITS).unwrap();
    assert_eq!(container.needed_version().to_string(), "0.1");
    let model = read(&file).unwrap();
    assert_eq!(model.n_points(), 900);
    assert_eq!(model.origin(), [10.0, -20.0, 5.0]);
    assert_eq!((model.levels().len(), model.levels()[0].pixels), (1, 6));
    assert_eq!(model.levels()[0].pixel_size, 0.02);
    let expected = std::fs::read_to_string(golden("hscsm_0_1.txt")).unwrap();
    // The last step of a position in single precision may differ; a colour may round the other way.
    assert_same_numbers(&listing(&model), &expected, |i, _| if i < 3 { 1e-6 } else { 1.0 });
}
