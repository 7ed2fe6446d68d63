//! The container of `.sfb` files: families, features and versions that are refused by name.
#![allow(missing_docs, clippy::unwrap_used)]

use surfabet::{Container, Family, HscsmModel, Model, Save};
use surfabet_codec::Error;
use surfabet_tests::LIMITS;
use surfabet_tests::contract::small;
use surfabet_tests::files::{codec_error, read};

/// The small file with one byte of its header changed and the header's checksum made to match.
fn with_header_byte(at: usize, value: u8) -> Vec<u8> {
    let mut file = small::<HscsmModel>().to_bytes().unwrap();
    let overhead = Container::parse(&file, &LIMITS).unwrap().overhead();
    file[at] = value;
    let checksum = crc32c::crc32c(&file[..overhead - 4]);
    file[overhead - 4..overhead].copy_from_slice(&checksum.to_le_bytes());
    file
}

#[test]
fn other_families_features_and_versions_are_refused_by_name() {
    assert!(read::<HscsmModel>(&with_header_byte(7, Family::Patches as u8)).is_ok());
    let planes = with_header_byte(7, Family::Planes as u8);
    let container = Container::parse(&planes, &LIMITS).unwrap();
    assert_eq!(
        surfabet_codec::read::<HscsmModel>(&container, &LIMITS, None).unwrap_err(),
        Error::WrongFamily { expected: Family::Patches, found: Family::Planes }
    );
    assert!(Model::from_bytes(&planes, &LIMITS).is_err());
    assert!(matches!(
        codec_error::<HscsmModel>(&with_header_byte(7, 99)),
        Error::UnknownFamily { found: 99, .. }
    ));
    let feature = codec_error::<HscsmModel>(&with_header_byte(8, 0x40));
    assert!(feature.to_string().contains("attributes predicted from those beside"), "{feature:?}");
    assert!(matches!(
        codec_error::<HscsmModel>(&with_header_byte(4, 9)),
        Error::UnsupportedVersion { found: 9, .. }
    ));
    assert!(matches!(codec_error::<HscsmModel>(b"ply\nformat ascii 1.0"), Error::NotSfb { .. }));
}
