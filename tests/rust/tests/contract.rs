//! What every model promises, tested on every method: the promises are written in `src/contract.rs`, the small scenes
//! in `src/scenes`.
#![allow(missing_docs)]

use surfabet::{
    AlphabetModel, BicAlphabetModel, GasModel, HscsmModel, Model, PatchModel, PlaneModel,
    SurfaceModel,
};
use surfabet_tests::contract;

/// A module of tests for each method.
macro_rules! contract_tests {
    ($($method:ident: $model:ty,)+) => {
        $(mod $method {
            use super::*;

            contract_tests!(@promises $model:
                a_file_gives_the_model_back
                a_saved_file_opens
                equality_ignores_the_report
                a_file_is_inspected
                every_truncation_is_an_error
                every_flipped_bit_is_an_error_or_harmless
                damage_behind_valid_checksums_is_refused_or_harmless
                random_sections_are_refused_or_harmless
                hostile_headers_are_refused_by_name
                trailing_bytes_are_refused_everywhere
                sections_are_those_of_the_method
                prices_are_the_lengths_of_the_streams
                threads_change_nothing
                points_come_in_any_order_where_promised
                work_stops_when_asked
                decode_options_are_refused_alike
                files_of_release_0_1_stay_readable
            );

            /// Run once per release, before it is published: `cargo test -p surfabet-tests --test contract --
            /// --ignored`.
            #[test]
            #[ignore = "writes tests/golden; files of a published release must never change"]
            fn write_golden() {
                contract::write_golden::<$model>();
            }
        })+

        #[test]
        fn every_method_is_tested() {
            assert_eq!(Model::METHODS, [$(<$model as SurfaceModel>::METHOD,)+]);
        }
    };
    (@promises $model:ty: $($promise:ident)+) => {
        $(#[test]
        fn $promise() {
            contract::$promise::<$model>();
        })+
    };
}

contract_tests! {
    patches: PatchModel,
    hscsm: HscsmModel,
    alphabet: AlphabetModel,
    bic_alphabet: BicAlphabetModel,
    planes: PlaneModel,
    gas: GasModel,
}

/// A test for each method whose files can share their words.
macro_rules! vocabulary_tests {
    ($($method:ident: $model:ty,)+) => {
        mod a_vocabulary_describes_another_scene {
            use super::*;

            $(#[test]
            fn $method() {
                contract::a_vocabulary_describes_another_scene::<$model>();
            })+
        }
    };
}

vocabulary_tests! {
    hscsm: HscsmModel,
    alphabet: AlphabetModel,
    bic_alphabet: BicAlphabetModel,
}
